//! What agents receive: observations, the state, and the available actions.

mod avail;
mod features;
mod obs;
mod state;
#[cfg(test)]
mod tests;
mod unit_tables;

pub(crate) use avail::Available;
pub use features::{FeatureBlock, obs_features, state_features};
pub(crate) use obs::{ObsScratch, write_obs};
pub use state::UnitFeatures;
pub(crate) use state::write_state;
pub(crate) use unit_tables::UnitTables;

use crate::arena::Arena;
use crate::units::Units;

/// The parts of a battle that the encoders read.
pub(crate) struct View<'a> {
    pub arena: &'a Arena,
    pub units: &'a Units,
    pub tables: &'a UnitTables,
    pub available: &'a Available,
}

/// A value divided by its maximum; 0 if the maximum is 0.
fn ratio(value: f64, max: f64) -> f32 {
    if max == 0.0 { 0.0 } else { (value / max) as f32 }
}
