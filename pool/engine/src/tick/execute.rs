//! Phase 4, execution: units move, recover and act one after another, in an order that is handed in.

use std::hint::select_unpredictable;

use super::{World, targeters};
use crate::command::Command;
use crate::units::{least, most};
use crate::{ENERGY_PER_TICK, SHIELD_PER_TICK, TICK};

/// Lets every unit of the order have its turn; returns the reward, unscaled.
#[inline(never)] // so that profiles show it
pub(super) fn all(world: &mut World) -> f64 {
    let mut earned = 0.0;
    for i in 0..world.plan.order.len() {
        let id = world.plan.order[i];
        // Who was killed earlier in this tick does nothing, unless a heal came in between (R2).
        if world.units.alive[id as usize] && world.units.has_health(id) {
            earned += turn(world, id);
        }
    }
    earned
}

fn turn(world: &mut World, id: u32) -> f64 {
    recover(world, id);
    let i = id as usize;
    if !world.units.declared[i] {
        return 0.0;
    }
    let target = match world.plan.commands[i] {
        Command::Target(target) => Some(target),
        Command::AttackMove => world.units.target[i],
        Command::Stop | Command::MoveTo(_) => None,
    };
    // Rule R4: what was declared in an earlier tick waits until there is a target.
    let Some(target) = target else { return 0.0 };
    world.units.declared[i] = false;
    if world.units.cooldown[i] > 0.0 {
        return 0.0;
    }
    // There is no second range check: a target that was in reach when the attack was declared is hit.
    world.units.cooldown[i] = world.arena.kind(id).cooldown;
    targeters::act(world, id, target)
}

/// Movement, and what time alone does.
fn recover(world: &mut World, id: u32) {
    let (units, kind, i) = (&mut *world.units, world.arena.kind(id), id as usize);
    units.vel[i] = units.planned_vel[i];
    units.pos[i] += units.vel[i] * TICK as f32;
    units.cooldown[i] = most(0.0, units.cooldown[i] - TICK);
    units.shield_cooldown[i] = most(0.0, units.shield_cooldown[i] - TICK);
    let shield = least(kind.shield, units.shield[i] + SHIELD_PER_TICK);
    units.shield[i] = select_unpredictable(units.shield_cooldown[i] == 0.0, shield, units.shield[i]);
    units.energy[i] = least(kind.energy, units.energy[i] + ENERGY_PER_TICK);
    units.hp[i] = least(kind.hp, units.hp[i] + kind.hp_regen_per_tick);
}
