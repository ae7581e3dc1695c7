//! Unit types: what a body in a battle is made of, the ten standard types, and the reader of unit files.
//!
//! Nothing here moves or fights; a [`UnitType`] is a table of figures that the engine reads. The checked JSON
//! reader in [`mod@file`] serves unit files here and scenario files in `smaclite-scenarios`, so that both
//! speak of mistakes in the same way.
//!
//! ```
//! use smaclite_units::UnitType;
//!
//! let stalker = UnitType::standard("STALKER").unwrap();
//! let marauder = UnitType::standard("MARAUDER").unwrap();
//! assert_eq!(stalker.radius(), 0.625);
//! assert_eq!(marauder.damage_against(&stalker), 20.0); // 10, and 10 more against ARMORED
//! ```
#![forbid(unsafe_code)]

pub mod file;
mod kinds;
mod parse;
mod standard;
mod unit_type;

pub use file::FileError;
pub use kinds::{Attribute, AttributeSet, CombatType, Plane, PlaneSet, Targeter, Word};
pub use unit_type::UnitType;

/// Why a unit file was refused; its message is one line that names the file, the key and what would be right.
pub type UnitError = FileError;
