//! One tick under rules `starcraft`: attacks have phases, units keep to the figures of the game, and enemies
//! look for targets only now and then.
//!
//! [`run`] lists the phases. All units decide from what the last tick left, and move at once; then hits in
//! flight land, and units attack, both by ascending id: a unit that is killed before its turn attacks no
//! more. What is random, the delays of attacks and when enemies first look, is drawn from the battle's
//! generator.

mod attack;
mod bodies;
mod choice;
mod crowd;
mod detours;
mod hits;
mod walk;

use super::{Earned, World, deaths};
use crate::random::Generator;

pub(super) use bodies::Posture;
pub(super) use choice::Chooser;
pub(crate) use choice::{LOOK_INTERVAL, first_look};
pub(super) use crowd::Crowd;
pub(super) use detours::Near;

/// The greatest time that a projectile flies, in seconds: longer than any battle.
pub(crate) const MAX_FLIGHT: f64 = 1e12;

/// Plays one tick. Returns what it earns.
pub(crate) fn run(world: &mut World, generator: &mut Generator) -> Earned {
    choice::choose_targets(world);
    walk::prefer(world);
    detours::take(world);
    bodies::push_apart(world);
    walk::move_all(world);
    let mut earned = Earned::default();
    choice::remember(world);
    hits::land(world, &mut earned);
    attack::act(world, generator, &mut earned);
    hits::explode_killed(world, &mut earned);
    choice::alarm(world, &earned);
    deaths::remove_dead(world);
    world.scratch.exploded.clear();
    world.scratch.is_first_tick = false;
    earned
}
