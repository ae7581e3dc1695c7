//! Scenarios: units, start positions and maps. The 23 standard scenarios, 15 generated ones, the nine terrain
//! presets, and the reader of scenario files.
//!
//! A [`Scenario`] is plain, checked data: types, start positions, terrain with its obstacle rectangles.
//! This crate plays no battles; it checks everything that the engine relies on (ids, counts, positions on the
//! map).
//!
//! ```
//! use smaclite_scenarios::Scenario;
//!
//! let scenario = Scenario::resolve("2s3z").unwrap();
//! assert_eq!((scenario.n_agents(), scenario.n_enemies()), (5, 5));
//! assert_eq!(scenario.unit_types[scenario.units[0].unit_type].name, "STALKER");
//!
//! let error = Scenario::resolve("2s3zz").unwrap_err();
//! assert!(error.to_string().contains("did you mean `2s3z`?"));
//! ```
#![forbid(unsafe_code)]

mod error;
mod files;
mod formation;
mod generation;
mod groups;
mod keys;
mod open;
mod read;
mod rewards;
mod scenario;
mod smacv2;
mod standard;
mod terrain;
mod unit_files;
mod warnings;

pub use error::ScenarioError;
pub use files::ScenarioFiles;
pub use formation::formation;
pub use generation::{Drawer, Drawn, DrawnTeams, Generation, Starts, Teams};
pub use rewards::Rewards;
pub use scenario::{Destination, Faction, March, Placement, Scenario};
/// What is wrong with scenario and unit files.
pub use smaclite_units::{Problem, Problems};
pub use smacv2::{Capability, EnemyMask, Smacv2};
pub use terrain::{MAX_OUTLINE_IN_SIGHT, MAX_SIDE, Rect, Terrain};
pub use unit_files::{UnitFile, is_replaceable, unit_file_candidates};

/// The largest number of units of a scenario, both factions together.
pub const MAX_UNITS: u32 = 1000;
