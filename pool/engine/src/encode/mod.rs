//! What agents get to see: observations, the state, and which actions are available.

mod avail;
mod features;
mod obs;
mod state;

pub(crate) use avail::Available;
pub use features::{FeatureBlock, obs_features, state_features};
pub(crate) use obs::{Sights, write_obs};
pub(crate) use state::write_state;

use crate::arena::Arena;
use crate::units::Units;

/// What the encoders look at.
pub(crate) struct View<'a> {
    pub arena: &'a Arena,
    pub units: &'a Units,
    pub available: &'a Available,
}

/// Writes the figures of a unit's body: health, \[shield\], \[type\].
fn write_body(view: &View, id: u32, out: &mut [f32]) {
    let (arena, i) = (view.arena, id as usize);
    let (stats, layout) = (arena.stats(id), &arena.layout);
    out.fill(0.0);
    out[0] = ratio(view.units.hp[i], stats.hp);
    let has_shield = if arena.is_enemy(id) { layout.enemy_shields } else { layout.ally_shields };
    if has_shield {
        out[1] = ratio(view.units.shield[i], stats.shield);
    }
    if layout.n_types > 0 {
        out[1 + usize::from(has_shield) + layout.type_of[i]] = 1.0;
    }
}

/// A share of a maximum; nothing of nothing is 0.
fn ratio(value: f64, max: f64) -> f32 {
    if max == 0.0 { 0.0 } else { (value / max) as f32 }
}
