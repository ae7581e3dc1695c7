//! What agents receive: observations, the state, and the available actions.

mod avail;
mod features;
mod gathered;
mod obs;
mod state;
#[cfg(test)]
mod tests;

pub(crate) use avail::Available;
pub use features::{FeatureBlock, obs_features, state_features};
pub(crate) use gathered::Gathered;
pub(crate) use obs::{ObsScratch, write_obs};
pub use state::UnitFeatures;
pub(crate) use state::write_state;

use crate::arena::Arena;
use crate::units::Units;

/// The parts of a battle that the encoders read.
pub(crate) struct View<'a> {
    pub arena: &'a Arena,
    pub units: &'a Units,
    pub gathered: &'a Gathered,
    pub available: &'a Available,
}

/// A value divided by its maximum; 0 if the maximum is 0.
fn ratio(value: f64, max: f64) -> f32 {
    if max == 0.0 { 0.0 } else { (value / max) as f32 }
}
