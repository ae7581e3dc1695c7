//! The closed vocabularies of unit files: planes, attributes, combat types and targeters, and sets of them.
//! How a file is read is in `parse`.

use std::fmt;

/// A closed set of words that stand for values in a file.
pub trait Word: Copy + 'static {
    /// Every word with what it stands for, in the order error messages list them.
    const WORDS: &'static [(&'static str, Self)];
}

/// The layer a unit lives in. Units avoid only bodies of their own plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Plane {
    /// On foot or wheels: the only plane that obstacles stop.
    Ground,
    /// Flying: passes over obstacles.
    Air,
    /// Attackable by everyone, whatever their `valid_targets`.
    Colossus,
}

impl Word for Plane {
    const WORDS: &'static [(&'static str, Plane)] =
        &[("GROUND", Plane::Ground), ("AIR", Plane::Air), ("COLOSSUS", Plane::Colossus)];
}

impl fmt::Display for Plane {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(word_of(*self))
    }
}

/// A set of planes; a unit type's `valid_targets`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct PlaneSet(u8);

impl PlaneSet {
    /// Whether `plane` was put into the set. The rule that everyone may attack `COLOSSUS` is not in here but
    /// in [`UnitType::can_attack`](crate::UnitType::can_attack).
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
#[allow(missing_docs)] // the game's own words, which say what they are
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

impl Word for Attribute {
    const WORDS: &'static [(&'static str, Attribute)] = &[
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
        f.write_str(word_of(*self))
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

/// A unit's part in the battle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CombatType {
    /// Attacks units of the other side.
    Damage,
    /// Heals units of its own side.
    Healing,
}

impl Word for CombatType {
    const WORDS: &'static [(&'static str, CombatType)] =
        &[("DAMAGE", CombatType::Damage), ("HEALING", CombatType::Healing)];
}

/// What a unit's attack does. Lengths are in terrain squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Targeter {
    /// Hits its target.
    Standard,
    /// Kills the attacker and hits all enemies around it.
    Kamikaze {
        /// Reach of the blast from the attacker's centre, to which the victim's radius is added.
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

fn word_of<T: Word + PartialEq>(value: T) -> &'static str {
    T::WORDS.iter().find(|(_, candidate)| *candidate == value).map_or("?", |(word, _)| word)
}
