//! The enums of unit files and the keywords of their values: planes, attributes, combat types and targeters,
//! and sets of them. `parse` reads the files.

use std::fmt;

/// A type whose values have fixed names in files.
pub trait Keyword: Copy + PartialEq + 'static {
    /// Every keyword and its value, in the order in which error messages list them.
    const KEYWORDS: &'static [(&'static str, Self)];

    /// The value that a keyword names.
    fn from_name(name: &str) -> Option<Self> {
        Self::KEYWORDS.iter().find(|(keyword, _)| *keyword == name).map(|(_, value)| *value)
    }

    /// The keyword of this value; empty if it has none.
    fn name(self) -> &'static str {
        Self::KEYWORDS.iter().find(|(_, value)| *value == self).map_or("", |(keyword, _)| keyword)
    }

    /// All keywords.
    fn names() -> impl Iterator<Item = &'static str> {
        Self::KEYWORDS.iter().map(|(keyword, _)| *keyword)
    }
}

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

impl Keyword for Plane {
    const KEYWORDS: &'static [(&'static str, Plane)] =
        &[("GROUND", Plane::Ground), ("AIR", Plane::Air), ("COLOSSUS", Plane::Colossus)];
}

impl fmt::Display for Plane {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

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

impl Keyword for Attribute {
    const KEYWORDS: &'static [(&'static str, Attribute)] = &[
        ("LIGHT", Attribute::Light),
        ("ARMORED", Attribute::Armored),
        ("MASSIVE", Attribute::Massive),
        ("BIOLOGICAL", Attribute::Biological),
        ("MECHANICAL", Attribute::Mechanical),
        ("PSIONIC", Attribute::Psionic),
        ("STRUCTURE", Attribute::Structure),
        ("HEROIC", Attribute::Heroic),
    ];
}

impl fmt::Display for Attribute {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

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

impl Keyword for CombatType {
    const KEYWORDS: &'static [(&'static str, CombatType)] =
        &[("DAMAGE", CombatType::Damage), ("HEALING", CombatType::Healing)];
}

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
