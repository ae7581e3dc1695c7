//! The phases of an attack: a unit in range turns to its target and begins one when its cooldown is over, its
//! effect comes at the damage point, and after it the unit swings back.

use glam::Vec2;
use smaclite_units::Targeter;

use super::super::{Earned, World, targeters};
use super::{MAX_FLIGHT, hits};
use crate::TICK;
use crate::distance::distance;
use crate::fast_math;
use crate::random::Generator;
use crate::units::AttackPhase;

/// Cosine of 11.25 degrees: a unit attacks what is within that angle of where it faces.
const ARC: f32 = 0.980_785_3;

/// Lets every living unit begin an attack on its target or go on with it, or heal it.
#[inline(never)]
pub(super) fn act(world: &mut World, generator: &mut Generator, earned: &mut Earned) {
    let mut turn = 0;
    while let Some((id, target)) = take_plain_turns(world, generator, &mut turn) {
        match world.arena.starcraft_stats[id as usize].is_healer {
            true => targeters::act(world, id, target, earned),
            false => launch(world, id, target, earned),
        }
    }
}

/// Runs turns from `turn` on, up to the first in which a unit heals or comes to its damage point; returns
/// that unit and its target.
#[inline(always)]
fn take_plain_turns(world: &mut World, generator: &mut Generator, turn: &mut usize) -> Option<(u32, u32)> {
    let World { arena, units, alive_ids, .. } = world;
    // Slices of one length: one check of an id serves all columns.
    let n = units.pos.len();
    let (pos, hp, targets) = (&units.pos[..n], &units.hp[..n], &units.target[..n]);
    let (cooldown, phases) = (&mut units.cooldown[..n], &mut units.phases[..n]);
    let all_stats = &arena.starcraft_stats[..n];
    for &id in &alive_ids.all[*turn..] {
        *turn += 1;
        let i = id as usize;
        let phase = &mut phases[i];
        phase.backswing = fast_math::max(0.0, phase.backswing - TICK);
        let Some(target) = targets[i] else { continue };
        let (t, matchup) = (target as usize, arena.matchup(id, target));
        if hp[i] <= 0.0 || !matchup.can_attack {
            continue;
        }
        let is_winding_up = phase.windup > 0.0;
        if all_stats[i].is_healer {
            if matchup.reaches(pos[i], pos[t], false) && hp[t] > 0.0 {
                return Some((id, target));
            }
            continue;
        }
        // The target of the last attack is attacked again without a step after it.
        let goes_on = is_winding_up | (phase.hit_target == Some(target));
        if !matchup.reaches(pos[i], pos[t], goes_on) {
            phase.cancel(&mut cooldown[i]);
            continue;
        }
        let is_facing = phase.turn_to(pos[t] - pos[i], all_stats[i].turn);
        if is_winding_up {
            phase.windup = fast_math::max(0.0, phase.windup - TICK);
            if phase.windup < TICK / 2.0 {
                phase.windup = 0.0;
            }
        } else {
            // Cooldowns are no multiples of a tick: an attack begins in the tick that is nearest to its end.
            if !is_facing | (cooldown[i] >= TICK / 2.0) {
                continue;
            }
            let stats = arena.stats(id);
            let conduct = &stats.conduct;
            let (least, greatest) = (conduct.min_random_delay, conduct.max_random_delay);
            let delay = least + (greatest - least) * generator.next_share();
            cooldown[i] = f64::max(0.0, stats.cooldown + delay);
            phase.windup = conduct.damage_point;
            phase.target = Some(target);
        }
        if phase.windup == 0.0 {
            phase.backswing = arena.stats(id).conduct.backswing;
            phase.target = None;
            phase.last = Some(target);
            return Some((id, target));
        }
    }
    None
}

/// The damage point: the hit, or what becomes one later.
#[inline(never)]
fn launch(world: &mut World, id: u32, target: u32, earned: &mut Earned) {
    let stats = world.arena.stats(id);
    let (i, t, conduct) = (id as usize, target as usize, &stats.conduct);
    // What an earlier attack still has in flight arrives now: a unit has one at a time.
    hits::land_all(world, id, earned);
    let way = distance(world.units.pos[i], world.units.pos[t]) - world.arena.stats(target).radius;
    let later = match stats.targeter {
        Targeter::LaserBeam { .. } => conduct.effect_delay,
        // The slowest projectiles of files would fly longer than a snapshot can hold.
        _ if conduct.projectile_speed > 0.0 => {
            f64::min(f64::max(0.0, way) / conduct.projectile_speed, MAX_FLIGHT)
        }
        _ => 0.0,
    };
    let phase = &mut world.units.phases[i];
    phase.hit_target = Some(target);
    phase.hit_at = world.units.pos[t];
    phase.hits = if conduct.hit_interval > 0.0 { stats.attacks } else { 1 };
    phase.hit_time = later;
    if later == 0.0 {
        hits::hit(world, id, earned);
    }
    world.scratch.may_have_hits |= world.units.phases[i].hits > 0;
}

impl AttackPhase {
    /// Turns by at most an angle, given by its cosine and sine. Returns whether the unit then faces that way,
    /// as near as an attack needs.
    #[cfg_attr(not(target_family = "wasm"), inline(always))] // in browsers size counts
    pub(super) fn turn_to(&mut self, way: Vec2, turn: Vec2) -> bool {
        let length = way.length();
        if length < f32::MIN_POSITIVE {
            self.facing = Vec2::ZERO;
            return true;
        }
        let way = way * length.recip();
        if self.facing.dot(way) >= turn.x {
            self.face(way);
            return true;
        }
        self.turn_part(way, turn)
    }

    /// Turns by an angle that is less than the way needs.
    #[inline(never)]
    fn turn_part(&mut self, way: Vec2, turn: Vec2) -> bool {
        // Who faced nowhere so far turns at once.
        if self.facing == Vec2::ZERO {
            self.face(way);
            return true;
        }
        let side = if self.facing.perp_dot(way) < 0.0 { -turn.y } else { turn.y };
        self.face(Vec2::new(turn.x, side).rotate(self.facing).normalize_or_zero());
        self.facing.dot(way) >= ARC
    }

    #[inline(always)]
    fn face(&mut self, way: Vec2) {
        // Rounding makes coordinates that are a little greater than 1.
        self.facing = Vec2::new(
            fast_math::max(fast_math::min(way.x, 1.0), -1.0),
            fast_math::max(fast_math::min(way.y, 1.0), -1.0),
        );
    }
}
