//! Phase 1, targets: which units keep the target of the last tick.

use super::World;
use super::preferred::in_reach;
use crate::command::Command;

/// Drops targets that are lost, and sets those of target commands.
#[inline(never)]
pub(super) fn drop_lost(world: &mut World) {
    let World { arena, units, alive_ids, scratch, .. } = world;
    // Each copy has few readers: searches of area attacks, and healers.
    if arena.has_area_attacks {
        scratch.start.clear();
        scratch.start.extend_from_slice(&units.pos);
    }
    if arena.agents_heal || arena.enemies_heal {
        scratch.previous_target.clear();
        scratch.previous_target.extend_from_slice(&units.target);
    }
    // Slices of one length: one check of an id serves all columns.
    let n = units.pos.len();
    let (pos, hp, targets) = (&units.pos[..n], &units.hp[..n], &mut units.target[..n]);
    let (commands, approaches) = (&scratch.commands[..n], &arena.approaches[..n]);
    for &id in &alive_ids.all {
        let i = id as usize;
        targets[i] = match commands[i] {
            Command::Stop | Command::MoveTo(_) => None,
            // Only the field is cleared when the target is dead. The command remains: the unit goes on
            // walking to the place of the dead unit and acting on it until the step ends.
            Command::Target(target) => Some(target).filter(|&target| hp[target as usize] > 0.0),
            // An attack-moving unit keeps a target that targets this unit, or is within attack range.
            Command::AttackMove => targets[i].filter(|&target| {
                let t = target as usize;
                // Whether the target's own target was updated before in this phase depends on the ids. That
                // is part of the rules: units are updated in place, by ascending id.
                hp[t] > 0.0
                    && (targets[t] == Some(id)
                        || in_reach(pos[i], pos[t], arena.matchup_of(&approaches[i], &approaches[t])))
            }),
        };
    }
}
