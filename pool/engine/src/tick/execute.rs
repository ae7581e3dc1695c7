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
    let mut turn = 0;
    while let Some(action) = take_turns_until_action(world, &mut turn) {
        earned += targeters::act(world, action.id, action.target);
    }
    // The velocities of phase 3 become current for all units at once. A unit whose turn was skipped did not
    // move with the new velocity, so it keeps the old one.
    let World { units, scratch, .. } = world;
    units.vel.copy_from_slice(&units.planned_vel);
    scratch.unmoved.drain(..).for_each(|(id, vel)| units.vel[id as usize] = vel);
    earned
}

/// An attack or heal that is due.
struct Action {
    id: u32,
    target: u32,
}

/// Runs the turns from `turn` on up to that of a unit that acts. It has moved and regenerated; its action
/// concludes its turn.
#[inline(always)]
fn take_turns_until_action(world: &mut World, turn: &mut usize) -> Option<Action> {
    let World { arena, units, scratch, .. } = world;
    // Slices of one length: one check of an id serves all columns.
    let n = units.pos.len();
    let (pos, vel, planned_vel) = (&mut units.pos[..n], &units.vel[..n], &units.planned_vel[..n]);
    let (hp, shield, energy) = (&mut units.hp[..n], &mut units.shield[..n], &mut units.energy[..n]);
    let (cooldown, shield_cooldown) = (&mut units.cooldown[..n], &mut units.shield_cooldown[..n]);
    let (alive, declared) = (&units.alive[..n], &mut units.declared[..n]);
    let (attacks, regenerations) = (&scratch.attack[..n], &arena.regenerations[..n]);
    for &id in &scratch.order[*turn..] {
        *turn += 1;
        let i = id as usize;
        if !alive[i] {
            continue;
        }
        // A unit that was killed earlier in this tick does nothing, unless it was healed in between (R2).
        // Such a turn has an effect only if the unit is healed later in this tick: its attack is held (R4),
        // and it keeps the velocity with which it last moved.
        if hp[i] <= 0.0 {
            declared[i] |= attacks[i].is_some();
            scratch.unmoved.push((id, vel[i]));
            continue;
        }
        let limits = &regenerations[i];
        pos[i] += planned_vel[i] * TICK as f32;
        cooldown[i] = fast_math::max(0.0, cooldown[i] - TICK);
        // A hit sets the shield cooldown to SHIELD_DELAY; the shield regenerates only when it has reached 0.
        shield_cooldown[i] = fast_math::max(0.0, shield_cooldown[i] - TICK);
        let regenerated = fast_math::min(limits.shield, shield[i] + SHIELD_PER_TICK);
        // Whether a shield regenerates is hard to predict in a fight: a select avoids branch mispredictions.
        shield[i] = select_unpredictable(shield_cooldown[i] == 0.0, regenerated, shield[i]);
        energy[i] = fast_math::min(limits.energy, energy[i] + ENERGY_PER_TICK);
        hp[i] = fast_math::min(limits.hp, hp[i] + limits.hp_per_tick);
        // The cooldown starts with the attack, in the turn that executes it, and counts down from the unit's
        // next turn on. There is no second range check: a target that was in reach when the attack was
        // declared is hit wherever it is now.
        if let Some(target) = attacks[i]
            && cooldown[i] == 0.0
        {
            cooldown[i] = arena.stats(id).cooldown;
            return Some(Action { id, target });
        }
    }
    None
}
