//! Phase 4, execution: units move, regenerate and act, one after another in the execution order.
//!
//! The order is part of the rules: a unit acts on positions and health that the units before it have changed.

use std::hint::select_unpredictable;

use super::{World, targeters};
use crate::fast_math;
use crate::{ENERGY_PER_TICK, SHIELD_PER_TICK, TICK};

/// Runs the turns of all units in the execution order; returns the reward, unscaled.
#[inline(never)]
pub(super) fn take_turns(world: &mut World) -> f64 {
    let mut earned = 0.0;
    for i in 0..world.scratch.order.len() {
        let id = world.scratch.order[i];
        if !world.units.alive[id as usize] {
            continue;
        }
        // A unit that was killed earlier in this tick does nothing, unless it was healed in between (R2).
        if world.units.has_health(id) {
            earned += take_turn(world, id);
        } else {
            skip_turn(world, id);
        }
    }
    // The velocities of phase 3 become current for all units at once. A unit whose turn was skipped did not
    // move with the new velocity, so it keeps the old one.
    let World { units, scratch, .. } = world;
    units.vel.copy_from_slice(&units.planned_vel);
    scratch.unmoved.drain(..).for_each(|(id, vel)| units.vel[id as usize] = vel);
    earned
}

fn take_turn(world: &mut World, id: u32) -> f64 {
    move_and_regenerate(world, id);
    let i = id as usize;
    match world.scratch.attack[i] {
        // The cooldown starts with the attack, in the turn that executes it, and counts down from the unit's
        // next turn on. There is no second range check: a target that was in reach when the attack was
        // declared is hit wherever it is now.
        Some(target) if world.units.cooldown[i] == 0.0 => {
            world.units.cooldown[i] = world.arena.stats(id).cooldown;
            targeters::act(world, id, target)
        }
        _ => 0.0,
    }
}

/// The turn of a unit without health. It has an effect only if the unit is healed later in this tick (R2):
/// its attack is held (R4), and it keeps the velocity with which it last moved.
#[cold]
fn skip_turn(world: &mut World, id: u32) {
    let i = id as usize;
    world.units.declared[i] |= world.scratch.attack[i].is_some();
    world.scratch.unmoved.push((id, world.units.vel[i]));
}

/// Moves a unit by its planned velocity, counts its cooldowns down, and regenerates shield, energy and
/// health.
fn move_and_regenerate(world: &mut World, id: u32) {
    let (units, stats, i) = (&mut *world.units, world.arena.stats(id), id as usize);
    units.pos[i] += units.planned_vel[i] * TICK as f32;
    units.cooldown[i] = fast_math::max(0.0, units.cooldown[i] - TICK);
    // A hit sets the shield cooldown to SHIELD_DELAY; the shield regenerates only when it has reached 0.
    units.shield_cooldown[i] = fast_math::max(0.0, units.shield_cooldown[i] - TICK);
    let shield = fast_math::min(stats.shield, units.shield[i] + SHIELD_PER_TICK);
    // Whether a shield regenerates is hard to predict in a fight: a select avoids branch mispredictions.
    units.shield[i] = select_unpredictable(units.shield_cooldown[i] == 0.0, shield, units.shield[i]);
    units.energy[i] = fast_math::min(stats.energy, units.energy[i] + ENERGY_PER_TICK);
    units.hp[i] = fast_math::min(stats.hp, units.hp[i] + stats.hp_regen_per_tick);
}
