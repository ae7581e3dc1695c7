//! The stats of unit types as a tick needs them, computed once per scenario.

use glam::Vec2;
use smaclite_units::{Conduct, Plane, Targeter, UnitType};

use crate::block_index::search_bound;
use crate::distance::{distance_squared, square_within};
use crate::{TICK, TICKS_PER_SECOND};

/// Under rules `starcraft`, units look less far than their scan range by this: between 0.5, which fits where
/// recorded enemies stop, and 0.2, which fits what random play earns in SMAC.
const SCAN_MARGIN: f64 = 0.3;

/// Under rules `starcraft`, how far units reach into others: recorded ones touch at the sum of their radii
/// less twice this.
const OVERLAP: f64 = 1.0 / 32.0;

/// The stats of a unit type, and values derived from them that a tick reads.
///
/// Distances are in squares, times in seconds. Collision avoidance computes in f32, everything else in f64.
#[derive(Clone, Debug)]
pub(crate) struct UnitStats {
    pub hp: f64,
    pub hp_regen_per_tick: f64,
    pub shield: f64,
    pub energy: f64,
    pub initial_energy: f64,
    pub armor: f64,
    pub attacks: u32,
    pub cooldown: f64,
    /// With the greatest random delay; observations are divided by it.
    pub greatest_cooldown: f64,
    pub speed: f64,
    pub radius: f64,
    pub conduct: Conduct,
    pub plane: Plane,
    pub is_healer: bool,
    pub targeter: Targeter,
    pub scan_range: f64,
    /// The unit's search for targets finds units whose centres are within this distance.
    pub search_radius: f64,
    pub avoid: AvoidanceParams,
}

/// The parameters of collision avoidance.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct AvoidanceParams {
    pub radius: f32,
    pub max_speed: f32,
    /// Centres nearer than the root of this are neighbours.
    pub neighbour_range_squared: f32,
    /// Obstacle edges nearer than the root of this are seen; `None` for units that see no obstacles.
    pub edge_range_squared: Option<f32>,
}

impl UnitStats {
    /// `largest_radius` is that of all units in the scenario.
    pub fn new(unit_type: &UnitType, largest_radius: f64) -> UnitStats {
        let radius = unit_type.radius();
        UnitStats {
            hp: unit_type.hp,
            hp_regen_per_tick: unit_type.hp_regen / TICKS_PER_SECOND,
            shield: unit_type.shield,
            energy: unit_type.energy,
            initial_energy: unit_type.initial_energy,
            armor: unit_type.armor,
            attacks: unit_type.attacks,
            cooldown: unit_type.cooldown,
            greatest_cooldown: unit_type.greatest_cooldown(),
            speed: unit_type.speed,
            radius,
            conduct: unit_type.conduct,
            plane: unit_type.plane,
            is_healer: unit_type.is_healer(),
            targeter: unit_type.targeter,
            scan_range: unit_type.minimum_scan_range,
            // Searches are by centres; the largest radius ensures that no unit whose edge is in range is
            // missed.
            search_radius: unit_type.minimum_scan_range + largest_radius,
            avoid: AvoidanceParams::new(unit_type, largest_radius),
        }
    }

    /// Whether its attacks can hit other units than the target.
    pub fn attacks_an_area(&self) -> bool {
        matches!(self.targeter, Targeter::Kamikaze { .. } | Targeter::LaserBeam { .. })
    }
}

fn turn_per_tick(degrees_per_second: f64) -> Vec2 {
    let angle = (degrees_per_second * TICK).to_radians();
    if angle == 0.0 || angle >= std::f64::consts::PI {
        return Vec2::NEG_X;
    }
    Vec2::new(libm::cos(angle) as f32, libm::sin(angle) as f32)
}

/// The stats that phases 1 and 2 read of every unit in every tick: few enough that all of them stay in the
/// cache of the processor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Approach {
    pub speed: f64,
    /// The search radius, as searches of targets use it.
    pub search_bound: f32,
    /// Index among the scenario's unit types.
    pub unit_type: u32,
    pub is_healer: bool,
    /// Whether it can attack the plane of any agent that is a healer.
    pub attacks_healers: bool,
}

impl Approach {
    /// What phases 1 and 2 read of a unit with these stats; `attacks_healers`: of the agents.
    pub fn new(unit_type: u32, stats: &UnitStats, attacks_healers: bool) -> Approach {
        Approach {
            speed: stats.speed,
            search_bound: search_bound(stats.search_radius),
            unit_type,
            is_healer: stats.is_healer,
            attacks_healers,
        }
    }
}

/// The stats that phase 4 reads of every unit in every tick, packed for the same reason.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Regeneration {
    pub hp: f64,
    pub hp_per_tick: f64,
    pub shield: f64,
    pub energy: f64,
}

impl Regeneration {
    /// What phase 4 reads of a unit with these stats.
    pub fn new(stats: &UnitStats) -> Regeneration {
        let &UnitStats { hp, hp_regen_per_tick: hp_per_tick, shield, energy, .. } = stats;
        Regeneration { hp, hp_per_tick, shield, energy }
    }
}

/// The stats that every tick under rules `starcraft` reads of every unit: few enough for the cache, as
/// [`Approach`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct StarcraftStats {
    /// From edge to edge.
    pub attack_range: f64,
    /// How far the unit looks for targets, from edge to edge.
    pub look_range: f64,
    pub radius: f64,
    /// Cosine and sine of the angle by which the unit turns in a tick.
    pub turn: Vec2,
    pub speed: f32,
    pub acceleration: f32,
    pub plane: Plane,
    pub is_healer: bool,
    pub body: BodyStats,
    /// How near the unit comes to walls, if it is on the ground.
    pub wall_distance: f32,
}

/// What decides how units push each other under rules `starcraft`.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BodyStats {
    /// Two units touch at the sum of their radii.
    pub radius: f32,
    /// Of two units that walk, each gives a share in proportion to this.
    pub weight: f32,
}

impl StarcraftStats {
    /// What a tick reads of a unit of a type.
    pub fn new(unit_type: &UnitType) -> StarcraftStats {
        let &UnitType { attack_range, minimum_scan_range, plane, conduct, .. } = unit_type;
        StarcraftStats {
            attack_range,
            look_range: f64::max(minimum_scan_range - SCAN_MARGIN, attack_range),
            radius: unit_type.radius(),
            turn: turn_per_tick(conduct.turn_rate),
            speed: unit_type.speed as f32,
            acceleration: conduct.acceleration as f32,
            plane,
            is_healer: unit_type.is_healer(),
            body: BodyStats::new(unit_type),
            // No step leads through a wall.
            wall_distance: f64::max(body_radius(unit_type), unit_type.speed * TICK) as f32,
        }
    }

    /// How near a wall must be to matter in a tick; `None` if none stops the unit.
    pub fn wall_range(&self) -> Option<f64> {
        let range = f64::from(self.wall_distance + self.speed * TICK as f32);
        (self.plane == Plane::Ground).then_some(range)
    }
}

impl BodyStats {
    fn new(unit_type: &UnitType) -> BodyStats {
        let square = unit_type.radius() * unit_type.radius();
        BodyStats { radius: body_radius(unit_type) as f32, weight: (square * square) as f32 }
    }
}

fn body_radius(unit_type: &UnitType) -> f64 {
    f64::max(unit_type.radius() - OVERLAP, 0.0)
}

/// What an attacker of one type can do to a victim of another.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Matchup {
    /// Damage of one hit, before shield and armor.
    pub damage: f64,
    /// Whether the attacker can attack the plane of the victim; of healers: whether it can heal it.
    pub can_attack: bool,
    /// The victim is within attack range if the squared distance between the centres is at most this.
    pub reach_squared: f64,
    /// The same within the attacker's range slop, which is at least 0.
    pub slop_reach_squared: f64,
}

impl Matchup {
    /// What a unit of one type can do to a unit of another.
    pub fn new(attacker: &UnitType, victim: &UnitType) -> Matchup {
        // The attack range is measured between the edges of the two units.
        let reach = attacker.attack_range + attacker.radius() + victim.radius();
        Matchup {
            damage: attacker.damage_against(victim),
            can_attack: attacker.can_attack(victim.plane),
            reach_squared: square_within(reach),
            slop_reach_squared: square_within(reach + attacker.conduct.range_slop),
        }
    }

    /// Whether the attacker reaches the victim from where it is: within the range slop, too, if its attack
    /// goes on.
    #[inline(always)]
    pub fn reaches(&self, from: Vec2, at: Vec2, goes_on: bool) -> bool {
        distance_squared(from, at) <= if goes_on { self.slop_reach_squared } else { self.reach_squared }
    }
}

impl AvoidanceParams {
    pub(super) fn new(unit_type: &UnitType, largest_radius: f64) -> AvoidanceParams {
        let radius = unit_type.radius();
        let neighbour_range = (largest_radius + radius) as f32;
        let (radius, max_speed) = (radius as f32, unit_type.speed as f32);
        // Units are neighbours only if they would touch, should the other have the largest radius. Edges
        // matter if the unit could reach them within the time horizon of 1 s.
        let edge_range = max_speed + radius;
        AvoidanceParams {
            radius,
            max_speed,
            neighbour_range_squared: neighbour_range * neighbour_range,
            edge_range_squared: (unit_type.plane == Plane::Ground).then_some(edge_range * edge_range),
        }
    }
}
