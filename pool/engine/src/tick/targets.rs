//! Phase 1, target clean-up: who loses or keeps the target of the tick before.

use super::World;
use super::preferred::in_reach;
use crate::command::Command;

#[inline(never)] // so that profiles show it
pub(super) fn clean_up(world: &mut World) {
    let World { units, plan, .. } = &mut *world;
    plan.start.clear();
    plan.start.extend_from_slice(&units.pos);
    plan.previous_target.clear();
    plan.previous_target.extend_from_slice(&units.target);
    for i in 0..world.living.all.len() {
        let id = world.living.all[i];
        world.units.target[id as usize] = match world.plan.commands[id as usize] {
            Command::Stop | Command::MoveTo(_) => None,
            Command::Target(unit) => Some(unit).filter(|&unit| world.units.has_health(unit)),
            Command::AttackMove => world.units.target[id as usize].filter(|&target| keeps(world, id, target)),
        };
    }
}

/// Whether an attack-moving unit keeps its target: one that is after itself, or within reach.
fn keeps(world: &World, id: u32, target: u32) -> bool {
    // The target's own target may or may not have been cleaned up yet: ids decide, as the rules have it.
    let turned_on_me = world.units.target[target as usize] == Some(id);
    world.units.has_health(target) && (turned_on_me || in_reach(world, id, target))
}
