//! Where units want to go, and their way there.

use std::hint::select_unpredictable;

use glam::Vec2;

use super::super::{TickScratch, World};
use super::Posture;
use super::bodies::{NO_SIDE, side_of};
use super::crowd::{Crowd, Member};
use crate::arena::{Arena, StarcraftStats};
use crate::command::Command;
use crate::fast_math;
use crate::units::AttackPhase;
use crate::{ENERGY_PER_TICK, SHIELD_PER_TICK, TICK};

/// Sets the preferred velocity of every living unit.
#[inline(never)]
pub(super) fn prefer(world: &mut World) {
    let World { arena, units, alive_ids, scratch, .. } = world;
    let TickScratch { commands, preferred, postures, standing, .. } = &mut **scratch;
    standing.iter_mut().for_each(Crowd::clear);
    // Slices of one length: one check of an id serves all columns.
    let n = units.pos.len();
    let walks = Walks {
        arena,
        all_stats: &arena.starcraft_stats[..n],
        commands: &commands[..n],
        pos: &units.pos[..n],
        vel: &units.vel[..n],
        targets: &units.target[..n],
        phases: &units.phases[..n],
    };
    let (preferred, postures) = (&mut preferred[..n], &mut postures[..n]);
    for &id in &alive_ids.all {
        let i = id as usize;
        let (goal, stats) = (walks.goal(id), &walks.all_stats[i]);
        preferred[i] = match goal {
            Goal::Point(goal) => walks.velocity(i, goal),
            _ => Vec2::ZERO,
        };
        postures[i] = match goal {
            _ if preferred[i] != Vec2::ZERO => Posture::Walks,
            Goal::Hold => Posture::Holds,
            _ if stats.speed == 0.0 => Posture::Holds,
            _ => Posture::IsIdle,
        };
        let side = if postures[i] == Posture::Holds { NO_SIDE } else { side_of(arena, id) };
        let member = Member { id: id as f32, side, at: walks.pos[i], body: stats.body };
        standing[stats.plane as usize].add_if(postures[i] != Posture::Walks, &member);
    }
}

/// Where a unit walks to.
enum Goal {
    Point(Vec2),
    None,
    /// It stands and attacks.
    Hold,
}

/// What decides where units walk to, by battle-wide id.
struct Walks<'a> {
    arena: &'a Arena,
    all_stats: &'a [StarcraftStats],
    commands: &'a [Command],
    pos: &'a [Vec2],
    vel: &'a [Vec2],
    targets: &'a [Option<u32>],
    phases: &'a [AttackPhase],
}

impl Walks<'_> {
    #[inline(always)]
    fn goal(&self, id: u32) -> Goal {
        let i = id as usize;
        let phase = &self.phases[i];
        // One branch: which of these lets a unit stand is hard to predict.
        let attacks = (phase.windup > 0.0) | (phase.backswing > 0.0);
        if let Some(target) = self.targets[i] {
            let (matchup, at) = (self.arena.matchup(id, target), self.pos[target as usize]);
            let is_near = matchup.reaches(self.pos[i], at, phase.hit_target == Some(target));
            return if attacks | (is_near & matchup.can_attack) { Goal::Hold } else { Goal::Point(at) };
        }
        if attacks {
            return Goal::Hold;
        }
        match self.commands[i] {
            Command::MoveTo([x, y]) | Command::AttackMove([x, y]) => {
                Goal::Point(Vec2::new(x as f32, y as f32))
            }
            Command::Stop | Command::Target(_) => Goal::None,
        }
    }

    /// On the way to a goal, as fast as the unit can be, and not beyond the goal.
    #[inline(always)]
    fn velocity(&self, i: usize, goal: Vec2) -> Vec2 {
        let (stats, at) = (&self.all_stats[i], self.pos[i]);
        let next = self.arena.next_point(stats.plane, at, goal);
        let way = next - at;
        let length = way.length();
        if length == 0.0 || stats.speed == 0.0 {
            return Vec2::ZERO;
        }
        // No unit slows down at a corner.
        let left = if next == goal { length } else { f32::INFINITY };
        let mut speed = fast_math::min(stats.speed, left / TICK as f32);
        if stats.acceleration > 0.0 {
            // The speed grows before the unit moves, and it brakes for the goal, as recorded medivacs do.
            let reached = self.vel[i].length() + stats.acceleration * TICK as f32;
            speed = speed.min(reached).min((2.0 * stats.acceleration * left).sqrt());
        }
        way * (speed / length)
    }
}

/// Moves all living units, and lets them regenerate.
#[inline(never)]
pub(super) fn move_all(world: &mut World) {
    let World { arena, units, alive_ids, scratch, .. } = world;
    // Slices of one length: one check of an id serves all columns.
    let n = units.pos.len();
    let (pos, vel, planned_vel) = (&mut units.pos[..n], &mut units.vel[..n], &units.planned_vel[..n]);
    let (hp, shield, energy) = (&mut units.hp[..n], &mut units.shield[..n], &mut units.energy[..n]);
    let (cooldown, shield_cooldown) = (&mut units.cooldown[..n], &mut units.shield_cooldown[..n]);
    let (all_stats, regenerations) = (&arena.starcraft_stats[..n], &arena.regenerations[..n]);
    let (phases, preferred) = (&mut units.phases[..n], &scratch.preferred[..n]);
    for &id in &alive_ids.all {
        let i = id as usize;
        let limits = &regenerations[i];
        vel[i] = planned_vel[i];
        if preferred[i] != Vec2::ZERO {
            phases[i].turn_to(preferred[i], all_stats[i].turn);
        }
        pos[i] = arena.extent.nearest(pos[i] + vel[i] * TICK as f32);
        cooldown[i] = fast_math::max(0.0, cooldown[i] - TICK);
        shield_cooldown[i] = fast_math::max(0.0, shield_cooldown[i] - TICK);
        if arena.has_reserves {
            let regenerated = fast_math::min(limits.shield, shield[i] + SHIELD_PER_TICK);
            shield[i] = select_unpredictable(shield_cooldown[i] == 0.0, regenerated, shield[i]);
            energy[i] = fast_math::min(limits.energy, energy[i] + ENERGY_PER_TICK);
        }
        hp[i] = fast_math::min(limits.hp, hp[i] + limits.hp_per_tick);
    }
    // Searches of area attacks use these positions.
    scratch.start.clear();
    scratch.start.extend_from_slice(&units.pos);
}
