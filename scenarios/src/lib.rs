//! Scenarios: who fights where. The twelve standard scenarios, the eight terrain presets, and the reader of
//! scenario files.
//!
//! A [`Scenario`] is plain, checked data: types, start positions, terrain with its obstacle rectangles. Nothing in
//! here plays a battle, and everything the engine relies on (ids, counts, positions on the map) is checked here.
#![forbid(unsafe_code)]

mod error;
mod scenario;
mod terrain;

pub use error::ScenarioError;
pub use scenario::{Faction, Placement, Scenario};
pub use terrain::{Rect, Terrain};
