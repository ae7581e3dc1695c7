//! The stats of one unit type, and the values that the engine derives from them. They come from `parse` and
//! `standard`.

use crate::{Attribute, AttributeSet, CombatType, Plane, PlaneSet, Targeter};

/// The stats of a unit type, as its file gives them. Distances are in terrain squares, times in seconds.
#[derive(Clone, Debug, PartialEq)]
pub struct UnitType {
    /// A standard type's name (`MARINE`), or the stem of the file it was read from.
    pub name: String,
    /// Maximum and starting health, above 0.
    pub hp: f64,
    /// Maximum and starting shield; 0 for none.
    pub shield: f64,
    /// Health regained per second.
    pub hp_regen: f64,
    /// Maximum energy; 0 for none.
    pub energy: f64,
    /// Energy at the start of an episode, at most `energy`.
    pub initial_energy: f64,
    /// Subtracted from the part of each hit that reaches health.
    pub armor: f64,
    /// Damage of one hit before bonuses and armor.
    pub damage: f64,
    /// Hits per attack, at least 1.
    pub attacks: u32,
    /// Extra damage of each hit for each attribute that the victim has, in file order.
    pub bonuses: Vec<(Attribute, f64)>,
    /// Time between attacks; 0 lets it act in every tick.
    pub cooldown: f64,
    /// Maximum speed in squares per second; 0 for a unit that never moves.
    pub speed: f64,
    /// Range of the attack, measured between the edges of the two units.
    pub attack_range: f64,
    /// How far the unit searches for targets under an attack-move command.
    pub minimum_scan_range: f64,
    /// How far agents of this type see under SMACv2's `use_unit_ranges`.
    pub sight_range: f64,
    /// Distance between the centres within which agents of this type can target others under SMACv2's
    /// `use_unit_ranges`.
    pub targeting_range: f64,
    /// Diameter, above 0.
    pub size: f64,
    /// The layer it lives in.
    pub plane: Plane,
    /// Whether it attacks or heals.
    pub combat_type: CombatType,
    /// The planes whose units it can attack; [`can_attack`](Self::can_attack) adds the exception.
    pub valid_targets: PlaneSet,
    /// The attributes that other types' bonuses refer to.
    pub attributes: AttributeSet,
    /// What its attack does; `Heal` exactly when `combat_type` is `Healing`.
    pub targeter: Targeter,
    /// How it moves and attacks under rules `starcraft`; the other rules take no notice.
    pub conduct: Conduct,
}

/// How a unit type moves and attacks under rules `starcraft`. The default is what the other rules mean:
/// attacks take effect at once, units reach their speed at once, and their bodies are as large as they look.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Conduct {
    /// Time from the start of an attack to its effect.
    pub damage_point: f64,
    /// Time after that in which the unit does not walk without a new order.
    pub backswing: f64,
    /// The least time that is added, at random, to the time between two attacks; it may be below 0.
    pub min_random_delay: f64,
    /// The greatest such time.
    pub max_random_delay: f64,
    /// An attack that has begun hits a target that is so much farther away than the attack range.
    pub range_slop: f64,
    /// Time between the hits of one attack; 0 if they are one.
    pub hit_interval: f64,
    /// Speed of what the unit fires, in squares per second; 0 if it hits at once.
    pub projectile_speed: f64,
    /// Time from the damage point to the hit of an area.
    pub effect_delay: f64,
    /// Acceleration in squares per second per second; 0 for at once.
    pub acceleration: f64,
    /// How fast the unit turns to what it attacks, in degrees per second; 0 for at once.
    pub turn_rate: f64,
    /// Whether a unit with the targeter `Kamikaze` also explodes when it is killed.
    pub explodes_when_killed: bool,
}

impl UnitType {
    /// Half of [`size`](Self::size), in squares.
    pub fn radius(&self) -> f64 {
        self.size / 2.0
    }

    /// The greatest time between two attacks, in seconds.
    pub fn greatest_cooldown(&self) -> f64 {
        self.cooldown + f64::max(0.0, self.conduct.max_random_delay)
    }

    /// Whether units of this type heal instead of attacking.
    pub fn is_healer(&self) -> bool {
        self.combat_type == CombatType::Healing
    }

    /// Whether this type can hit units in `plane`: those in its `valid_targets`, and always `COLOSSUS`.
    pub fn can_attack(&self, plane: Plane) -> bool {
        plane == Plane::Colossus || self.valid_targets.contains(plane)
    }

    /// Damage of one hit on `victim`: `damage` and the bonus for each attribute that the victim has. Shield
    /// and armor are not included.
    pub fn damage_against(&self, victim: &UnitType) -> f64 {
        let bonuses = self.bonuses.iter().filter(|(attribute, _)| victim.attributes.contains(*attribute));
        bonuses.fold(self.damage, |damage, (_, bonus)| damage + bonus)
    }
}
