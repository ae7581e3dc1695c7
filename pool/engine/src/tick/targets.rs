//! Phase 1, targets: which units keep the target of the last tick.

use glam::Vec2;

use super::World;
use super::preferred::in_reach;
use crate::arena::{Approach, Arena};
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
    let targets = &mut units.target[..n];
    let now = Now { arena, pos: &units.pos[..n], hp: &units.hp[..n], approaches: &arena.approaches[..n] };
    if scratch.is_first_tick {
        for &id in &alive_ids.all {
            let i = id as usize;
            targets[i] = match scratch.commands[i] {
                Command::Stop | Command::MoveTo(_) => None,
                Command::Target(target) => now.if_alive(target),
                Command::AttackMove(_) => now.kept(targets, id),
            };
        }
        return;
    }
    // In later ticks of a step, units that stop or move have no target, and whether a unit with a target
    // command comes before or after others has no effect: its target changes only if that died, and then no
    // living unit is it.
    for &(id, target) in &scratch.targeting {
        targets[id as usize] = now.if_alive(target);
    }
    for &(id, _) in &scratch.attack_moving {
        targets[id as usize] = now.kept(targets, id);
    }
}

/// What this phase reads, besides the targets.
struct Now<'a> {
    arena: &'a Arena,
    pos: &'a [Vec2],
    hp: &'a [f64],
    approaches: &'a [Approach],
}

impl Now<'_> {
    /// The target of a target command. Only the field is cleared when the target is dead. The command
    /// remains: until the step ends the unit walks to the place of the dead unit and acts on it.
    #[inline(always)]
    fn if_alive(&self, target: u32) -> Option<u32> {
        (self.hp[target as usize] > 0.0).then_some(target)
    }

    /// The target of an attack-moving unit: it keeps one that targets this unit, or is within attack range.
    ///
    /// Whether the target's own target was updated before in this phase depends on the ids. That is part of
    /// the rules: units are updated in place, by ascending id.
    #[inline(always)]
    fn kept(&self, targets: &[Option<u32>], id: u32) -> Option<u32> {
        let i = id as usize;
        let target = targets[i]?;
        let t = target as usize;
        let matchup = self.arena.matchup_of(&self.approaches[i], &self.approaches[t]);
        let in_reach = in_reach(self.pos[i], self.pos[t], matchup);
        // No short circuits: the outcomes are hard to predict.
        ((self.hp[t] > 0.0) & ((targets[t] == Some(id)) | in_reach)).then_some(target)
    }
}
