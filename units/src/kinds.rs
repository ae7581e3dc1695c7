//! The enums of unit files and the keywords of their values: planes, attributes, combat types and targeters,
//! and sets of them. `parse` reads the files.

use crate::keywords;

/// The layer a unit lives in. Units avoid only units of the same plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Plane {
    /// On foot or wheels: the only plane that obstacles stop.
    Ground,
    /// Flying: passes over obstacles.
    Air,
    /// Can be attacked by every unit, whatever its `valid_targets`.
    Colossus,
}

keywords!(Plane, "plane", "GROUND" => Ground, "AIR" => Air, "COLOSSUS" => Colossus);

/// A set of planes; a unit type's `valid_targets`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct PlaneSet(u8);

impl PlaneSet {
    /// Whether `plane` is in the set. The rule that every unit may attack `COLOSSUS` is not here but in
    /// [`UnitType::can_attack`](crate::UnitType::can_attack).
    pub fn contains(self, plane: Plane) -> bool {
        self.0 & (1 << plane as u8) != 0
    }
}

impl FromIterator<Plane> for PlaneSet {
    fn from_iter<I: IntoIterator<Item = Plane>>(planes: I) -> Self {
        PlaneSet(planes.into_iter().fold(0, |bits, plane| bits | 1 << plane as u8))
    }
}

/// A trait of a unit type that other types can have a damage bonus against.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs)] // StarCraft II's attributes by their names there
pub enum Attribute {
    Light,
    Armored,
    Massive,
    Biological,
    Mechanical,
    Psionic,
    Structure,
    Heroic,
}

keywords!(
    Attribute,
    "attribute",
    "LIGHT" => Light,
    "ARMORED" => Armored,
    "MASSIVE" => Massive,
    "BIOLOGICAL" => Biological,
    "MECHANICAL" => Mechanical,
    "PSIONIC" => Psionic,
    "STRUCTURE" => Structure,
    "HEROIC" => Heroic,
);

/// A set of attributes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct AttributeSet(u8);

impl AttributeSet {
    /// Whether `attribute` is in the set.
    pub fn contains(self, attribute: Attribute) -> bool {
        self.0 & (1 << attribute as u8) != 0
    }
}

impl FromIterator<Attribute> for AttributeSet {
    fn from_iter<I: IntoIterator<Item = Attribute>>(attributes: I) -> Self {
        AttributeSet(attributes.into_iter().fold(0, |bits, attribute| bits | 1 << attribute as u8))
    }
}

/// Whether a unit attacks or heals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CombatType {
    /// Attacks units of the other faction.
    Damage,
    /// Heals units of the same faction.
    Healing,
}

keywords!(CombatType, "combat_type", "DAMAGE" => Damage, "HEALING" => Healing);

/// What a unit's attack does. Lengths are in terrain squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Targeter {
    /// Hits its target.
    Standard,
    /// Kills the attacker and hits all enemies around it.
    Kamikaze {
        /// Radius of the blast around the attacker's centre, to which the victim's radius is added.
        radius: f64,
    },
    /// Hits all enemies that touch a rectangle centred on the target.
    LaserBeam {
        /// Length across the line of fire.
        width: f64,
        /// Depth along the line of fire.
        height: f64,
    },
    /// Heals its target.
    Heal,
}
