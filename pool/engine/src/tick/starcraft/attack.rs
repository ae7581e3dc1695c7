//! The phases of an attack: a unit in range turns to its target and begins one when its cooldown is over, its
//! effect comes at the damage point, and after it the unit swings back.

use glam::Vec2;
use smaclite_units::Targeter;

use super::super::{Earned, World, targeters};
use super::{MAX_FLIGHT, hits};
use crate::TICK;
use crate::arena::Matchup;
use crate::distance::distance;
use crate::fast_math;
use crate::random::Generator;
use crate::units::AttackPhase;

/// Cosine of 11.25 degrees: a unit attacks what is within that angle of where it faces.
const ARC: f32 = 0.980_785_3;

/// Lets every living unit begin or go on with its attack.
#[inline(never)]
pub(super) fn act(world: &mut World, generator: &mut Generator, earned: &mut Earned) {
    let arena = world.arena;
    for at in 0..world.alive_ids.all.len() {
        let id = world.alive_ids.all[at];
        let i = id as usize;
        let phase = &mut world.units.phases[i];
        phase.backswing = fast_math::max(0.0, phase.backswing - TICK);
        let Some(target) = world.units.target[i] else { continue };
        let matchup = arena.matchup(id, target);
        if world.units.hp[i] > 0.0 && matchup.can_attack {
            advance(world, generator, id, target, matchup, earned);
        }
    }
}

/// Lets a unit begin an attack on its target or go on with it, or heal it.
#[inline(always)]
fn advance(
    world: &mut World,
    generator: &mut Generator,
    id: u32,
    target: u32,
    matchup: &Matchup,
    earned: &mut Earned,
) {
    let (i, t) = (id as usize, target as usize);
    let phase = &mut world.units.phases[i];
    let is_winding_up = phase.windup > 0.0;
    let is_healer = world.arena.starcraft_stats[i].is_healer;
    // The target of the last attack is attacked again without a step after it.
    let goes_on = !is_healer && (is_winding_up || phase.hit_target == Some(target));
    let is_in_reach = matchup.reaches(world.units.pos[i], world.units.pos[t], goes_on);
    if is_healer {
        if is_in_reach && world.units.hp[t] > 0.0 {
            targeters::act(world, id, target, earned);
        }
        return;
    }
    if !is_in_reach {
        phase.cancel(&mut world.units.cooldown[i]);
        return;
    }
    let way = world.units.pos[t] - world.units.pos[i];
    let is_facing = phase.turn_to(way, world.arena.starcraft_stats[i].turn);
    if is_winding_up {
        phase.windup = fast_math::max(0.0, phase.windup - TICK);
        if phase.windup < TICK / 2.0 {
            phase.windup = 0.0;
        }
    } else {
        // Cooldowns are no multiples of a tick: an attack begins in the tick that is nearest to its end.
        if !is_facing || world.units.cooldown[i] >= TICK / 2.0 {
            return;
        }
        let stats = world.arena.stats(id);
        let conduct = &stats.conduct;
        let (least, greatest) = (conduct.min_random_delay, conduct.max_random_delay);
        let delay = least + (greatest - least) * generator.next_share();
        world.units.cooldown[i] = f64::max(0.0, stats.cooldown + delay);
        phase.windup = conduct.damage_point;
        phase.target = Some(target);
    }
    if phase.windup == 0.0 {
        phase.backswing = world.arena.stats(id).conduct.backswing;
        phase.target = None;
        phase.last = Some(target);
        launch(world, id, target, earned);
    }
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
    pub(super) fn turn_to(&mut self, way: Vec2, turn: Vec2) -> bool {
        let way = way.normalize_or_zero();
        if way == Vec2::ZERO || self.facing == Vec2::ZERO || self.facing.dot(way) >= turn.x {
            self.face(way);
            return true;
        }
        let side = if self.facing.perp_dot(way) < 0.0 { -turn.y } else { turn.y };
        self.face(Vec2::new(turn.x, side).rotate(self.facing).normalize_or_zero());
        self.facing.dot(way) >= ARC
    }

    fn face(&mut self, way: Vec2) {
        // Rounding makes coordinates that are a little greater than 1.
        self.facing = way.clamp(Vec2::NEG_ONE, Vec2::ONE);
    }
}
