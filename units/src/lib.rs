//! Unit types: the stats of a unit, the ten standard types, and the reader of unit files.
//!
//! Nothing here moves or fights; a [`UnitType`] is a record of stats that the engine reads. The checked JSON
//! reader in [`mod@file`] reads unit files here and scenario files in `smaclite-scenarios`, so that both
//! report mistakes in the same form.
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
mod keys;
mod keyword;
mod kinds;
mod parse;
mod standard;
mod unit_type;

pub use file::{Problem, Problems};
pub use keys::MIN_POSITIVE;
pub use keyword::{Keyword, UnknownKeyword};
pub use kinds::{Attribute, AttributeSet, CombatType, Plane, PlaneSet, Targeter};
pub use unit_type::{Conduct, UnitType};
