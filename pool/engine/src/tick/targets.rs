//! Phase 1, targets: which units keep the target of the last tick.

use super::World;
use super::preferred::in_reach;
use crate::command::Command;

/// Drops targets that are lost, and sets those of target commands.
#[inline(never)]
pub(super) fn drop_lost(world: &mut World) {
    let World { units, scratch, .. } = &mut *world;
    scratch.start.clear();
    scratch.start.extend_from_slice(&units.pos);
    scratch.previous_target.clear();
    scratch.previous_target.extend_from_slice(&units.target);
    for i in 0..world.alive_ids.all.len() {
        let id = world.alive_ids.all[i];
        world.units.target[id as usize] = match world.scratch.commands[id as usize] {
            Command::Stop | Command::MoveTo(_) => None,
            // Only the field is cleared when the target is dead. The command remains: the unit goes on
            // walking to the place of the dead unit and acting on it until the step ends.
            Command::Target(target) => Some(target).filter(|&target| world.units.has_health(target)),
            Command::AttackMove => world.units.target[id as usize].filter(|&target| keeps(world, id, target)),
        };
    }
}

/// Whether an attack-moving unit keeps its target: one that targets this unit, or is within attack range.
fn keeps(world: &World, id: u32, target: u32) -> bool {
    // Whether the target's own target was updated before in this phase depends on the ids. That is part of
    // the rules: units are updated in place, by ascending id.
    let targets_me = world.units.target[target as usize] == Some(id);
    world.units.has_health(target) && (targets_me || in_reach(world, id, target))
}
