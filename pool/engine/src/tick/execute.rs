//! Phase 4, execution: units move, regenerate and act, one after another in the execution order.
//!
//! The order is part of the rules: a unit acts on positions and health that the units before it have changed.

use std::hint::select_unpredictable;

use super::{Earned, World, targeters};
use crate::fast_math;
use crate::{ENERGY_PER_TICK, SHIELD_PER_TICK, TICK};

/// Runs the turns of all units in the execution order; returns what they earn.
#[inline(never)]
pub(super) fn take_turns(world: &mut World) -> Earned {
    let mut earned = Earned::default();
    let mut turn = 0;
    while let Some((id, event)) = take_plain_turns(world, &mut turn) {
        match event {
            Event::Acts { target } => targeters::act(world, id, target, &mut earned),
            Event::IsWithoutHealth => skip_turn(world, id),
        }
    }
    // The velocities of phase 3 become current for all units at once. A unit whose turn was skipped did not
    // move with the new velocity, so it keeps the old one.
    let World { units, scratch, .. } = world;
    units.vel.copy_from_slice(&units.planned_vel);
    scratch.unmoved.drain(..).for_each(|(id, vel)| units.vel[id as usize] = vel);
    earned
}

/// What makes a turn more than moving and regenerating.
enum Event {
    /// The attack or heal on this target is due.
    Acts { target: u32 },
    /// The unit was killed earlier in this tick: it does nothing, unless it was healed in between (R2).
    IsWithoutHealth,
}

/// Runs turns from `turn` on, up to the first with an event, and returns that unit. A unit that acts has
/// moved and regenerated then; its action concludes its turn.
#[inline(always)]
fn take_plain_turns(world: &mut World, turn: &mut usize) -> Option<(u32, Event)> {
    let World { arena, units, scratch, .. } = world;
    // Slices of one length: one check of an id serves all columns.
    let n = units.pos.len();
    let (pos, planned_vel, alive) = (&mut units.pos[..n], &units.planned_vel[..n], &units.alive[..n]);
    let (hp, shield, energy) = (&mut units.hp[..n], &mut units.shield[..n], &mut units.energy[..n]);
    let (cooldown, shield_cooldown) = (&mut units.cooldown[..n], &mut units.shield_cooldown[..n]);
    let (attacks, regenerations) = (&scratch.attack[..n], &arena.regenerations[..n]);
    for &id in &scratch.order[*turn..] {
        *turn += 1;
        let i = id as usize;
        if !alive[i] {
            continue;
        }
        if hp[i] <= 0.0 {
            return Some((id, Event::IsWithoutHealth));
        }
        let limits = &regenerations[i];
        pos[i] = arena.extent.nearest(pos[i] + planned_vel[i] * TICK as f32);
        cooldown[i] = fast_math::max(0.0, cooldown[i] - TICK);
        // A hit sets the shield cooldown to SHIELD_DELAY; the shield regenerates only when it has reached 0.
        shield_cooldown[i] = fast_math::max(0.0, shield_cooldown[i] - TICK);
        if arena.has_reserves {
            let regenerated = fast_math::min(limits.shield, shield[i] + SHIELD_PER_TICK);
            // Whether a shield regenerates is hard to predict in a fight: a select avoids mispredictions.
            shield[i] = select_unpredictable(shield_cooldown[i] == 0.0, regenerated, shield[i]);
            energy[i] = fast_math::min(limits.energy, energy[i] + ENERGY_PER_TICK);
        }
        hp[i] = fast_math::min(limits.hp, hp[i] + limits.hp_per_tick);
        // The cooldown starts with the attack, in the turn that executes it, and counts down from the unit's
        // next turn on. There is no second range check: a target that was in reach when the attack was
        // declared is hit wherever it is now.
        // One branch, seldom taken: whether a unit has declared an attack is hard to predict. The cooldown is
        // 0, and not -0, if it has no bits.
        if cooldown[i].to_bits() | u64::from(attacks[i].is_none()) == 0
            && let Some(target) = attacks[i]
        {
            cooldown[i] = arena.stats(id).cooldown;
            return Some((id, Event::Acts { target }));
        }
    }
    None
}

/// The turn of a unit without health. It has an effect only if the unit is healed later in this tick (R2):
/// its attack is held (R4), and it keeps the velocity with which it last moved.
#[cold]
fn skip_turn(world: &mut World, id: u32) {
    let i = id as usize;
    world.units.declared[i] |= world.scratch.attack[i].is_some();
    world.scratch.unmoved.push((id, world.units.vel[i]));
}
