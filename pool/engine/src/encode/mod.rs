//! What agents receive: observations, the state, and the available actions.

mod avail;
mod features;
mod obs;
mod state;

pub(crate) use avail::Available;
pub use features::{FeatureBlock, obs_features, state_features};
pub(crate) use obs::{ObsScratch, write_obs};
pub use state::UnitFeatures;
pub(crate) use state::write_state;

use crate::arena::Arena;
use crate::units::Units;

/// The parts of a battle that the encoders read.
pub(crate) struct View<'a> {
    pub arena: &'a Arena,
    pub units: &'a Units,
    pub available: &'a Available,
}

/// Writes the features of a unit that do not depend on the observer: health, \[shield\], \[type\].
fn write_body(view: &View, id: u32, out: &mut [f32]) {
    let (arena, i) = (view.arena, id as usize);
    let (stats, features) = (arena.stats(id), &arena.features);
    out.fill(0.0);
    out[0] = ratio(view.units.hp[i], stats.hp);
    // A scenario decides per faction whether shields are features, whatever its unit types have.
    let has_shield = features.has_shield(arena.is_enemy(id));
    if has_shield {
        out[1] = ratio(view.units.shield[i], stats.shield);
    }
    if features.n_types > 0 {
        out[1 + usize::from(has_shield) + features.type_of[i]] = 1.0;
    }
}

/// A value divided by its maximum; 0 if the maximum is 0.
fn ratio(value: f64, max: f64) -> f32 {
    if max == 0.0 { 0.0 } else { (value / max) as f32 }
}
