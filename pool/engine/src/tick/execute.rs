//! Phase 4, execution: units move, recover and act one after another, in an order that is handed in.

use std::hint::select_unpredictable;

use super::{World, targeters};
use crate::units::{least, most};
use crate::{ENERGY_PER_TICK, SHIELD_PER_TICK, TICK};

/// Lets every unit of the order have its turn; returns the reward, unscaled.
#[inline(never)] // so that profiles show it
pub(super) fn all(world: &mut World) -> f64 {
    let mut earned = 0.0;
    for i in 0..world.plan.order.len() {
        let id = world.plan.order[i];
        if !world.units.alive[id as usize] {
            continue;
        }
        // A unit that was killed earlier in this tick does nothing, unless a heal came in between (R2).
        if world.units.has_health(id) {
            earned += turn(world, id);
        } else {
            hold(world, id);
        }
    }
    let World { units, plan, .. } = world;
    units.vel.copy_from_slice(&units.planned_vel);
    plan.unmoved.drain(..).for_each(|(id, vel)| units.vel[id as usize] = vel);
    earned
}

fn turn(world: &mut World, id: u32) -> f64 {
    recover(world, id);
    let i = id as usize;
    match world.plan.attack[i] {
        // There is no second range check: a unit that was in reach when the attack was declared is hit.
        Some(target) if world.units.cooldown[i] == 0.0 => {
            world.units.cooldown[i] = world.arena.stats(id).cooldown;
            targeters::act(world, id, target)
        }
        _ => 0.0,
    }
}

/// What becomes of the turn of a unit that is dead when it comes: it matters if the unit is healed to life in
/// this tick (R2). Its attack is held (R4), and it keeps the velocity with which it last moved.
#[cold]
fn hold(world: &mut World, id: u32) {
    let i = id as usize;
    world.units.declared[i] |= world.plan.attack[i].is_some();
    world.plan.unmoved.push((id, world.units.vel[i]));
}

/// Movement, and what time alone does.
fn recover(world: &mut World, id: u32) {
    let (units, stats, i) = (&mut *world.units, world.arena.stats(id), id as usize);
    units.pos[i] += units.planned_vel[i] * TICK as f32;
    units.cooldown[i] = most(0.0, units.cooldown[i] - TICK);
    units.shield_cooldown[i] = most(0.0, units.shield_cooldown[i] - TICK);
    let shield = least(stats.shield, units.shield[i] + SHIELD_PER_TICK);
    units.shield[i] = select_unpredictable(units.shield_cooldown[i] == 0.0, shield, units.shield[i]);
    units.energy[i] = least(stats.energy, units.energy[i] + ENERGY_PER_TICK);
    units.hp[i] = least(stats.hp, units.hp[i] + stats.hp_regen_per_tick);
}
