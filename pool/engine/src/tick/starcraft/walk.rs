//! Where units want to go, and their way there.

use glam::Vec2;

use super::super::{TickScratch, World};
use super::reach;
use crate::arena::Arena;
use crate::buffers::clear_and_reserve;
use crate::command::Command;
use crate::distance::distance_squared;
use crate::fast_math;
use crate::simd::x4::{F32x4, Vec2x4, WIDTH, four};
use crate::units::Units;
use crate::{ENERGY_PER_TICK, SHIELD_PER_TICK, TICK};

/// How far ahead of itself a unit looks for others that stand in its way, in squares.
const LOOK_AHEAD: f32 = 1.0;
/// Cosine and sine of 20 degrees, by which a unit turns to find a free way; given as numbers, since the last
/// bits of trigonometric functions depend on the machine.
const TURN: [f32; 2] = [0.939_692_6, 0.342_020_15];
/// How often it turns at most, to either side: up to 100 degrees.
const MAX_TURNS: usize = 5;
/// Units that touch do not block the way past each other.
const TOUCH: f32 = 0.98;

/// The units of a plane that stand in this tick. A list per number, so that one instruction computes several.
#[derive(Debug, Default)]
pub(in crate::tick) struct Standing {
    ids: Vec<u32>,
    x: Vec<f32>,
    y: Vec<f32>,
    radii: Vec<f32>,
}

/// A unit that walks past those that stand.
struct Walker {
    at: Vec2,
    radius: f32,
    /// It is not in the way.
    target: Option<u32>,
}

impl Standing {
    pub fn reserve(&mut self, n_units: usize) {
        let n_units = n_units.next_multiple_of(WIDTH);
        clear_and_reserve(&mut self.ids, n_units);
        for list in [&mut self.x, &mut self.y, &mut self.radii] {
            clear_and_reserve(list, n_units);
        }
    }

    fn clear(&mut self) {
        self.ids.clear();
        [&mut self.x, &mut self.y, &mut self.radii].into_iter().for_each(Vec::clear);
    }

    fn push(&mut self, id: u32, at: Vec2, radius: f32) {
        self.ids.push(id);
        self.x.push(at.x);
        self.y.push(at.y);
        self.radii.push(radius);
    }

    /// Fills the last register with units that are near no other.
    fn pad(&mut self) {
        while !self.ids.len().is_multiple_of(WIDTH) {
            self.push(u32::MAX, Vec2::INFINITY, 0.0);
        }
    }

    /// Whether one of them is in the way of a unit in a direction.
    fn are_in_way(&self, walker: &Walker, to: Vec2) -> bool {
        let four = four();
        let [at, to] = [walker.at, to].map(|vector| Vec2x4::splat(four, vector));
        let [own, ahead, touch, zero] =
            [walker.radius, LOOK_AHEAD, TOUCH, 0.0].map(|number| F32x4::splat(four, number));
        let places = Vec2x4::all(four, &self.x, &self.y).zip(F32x4::all(four, &self.radii));
        places.zip(self.ids.chunks_exact(WIDTH)).any(|((place, radius), ids)| {
            let (way, reach) = (place - at, own + radius);
            let is_near = way.length_squared().lt((reach + ahead) * (reach + ahead));
            let is_ahead = way.dot(to).gt(zero);
            let is_in_lane = way.perp_dot(to).abs().lt(reach * touch);
            let mut in_way = (is_near & is_ahead & is_in_lane).bits();
            // Nearly always none is.
            while in_way != 0 {
                if Some(ids[in_way.trailing_zeros() as usize]) != walker.target {
                    return true;
                }
                in_way &= in_way - 1;
            }
            false
        })
    }
}

/// Sets the preferred velocity of every living unit.
pub(super) fn prefer(world: &mut World) {
    let World { arena, units, alive_ids, scratch, .. } = world;
    for &id in &alive_ids.all {
        let i = id as usize;
        let goal = goal(arena, units, id, scratch.commands[i]);
        scratch.preferred[i] = goal.map_or(Vec2::ZERO, |goal| velocity(arena, units, id, goal));
    }
    let TickScratch { preferred, standing, .. } = scratch;
    standing.iter_mut().for_each(Standing::clear);
    for &id in alive_ids.all.iter().filter(|id| preferred[**id as usize] == Vec2::ZERO) {
        let (plane, radius) = (arena.stats(id).plane, arena.avoidance[id as usize].radius);
        standing[plane as usize].push(id, units.pos[id as usize], radius);
    }
    standing.iter_mut().for_each(Standing::pad);
    for &id in &alive_ids.all {
        go_around(arena, units, scratch, id);
    }
}

/// Where a unit walks to; `None` if it stands.
fn goal(arena: &Arena, units: &Units, id: u32, command: Command) -> Option<Vec2> {
    let phase = &units.phases[id as usize];
    if phase.windup > 0.0 || phase.backswing > 0.0 {
        return None;
    }
    if let Some(target) = units.target[id as usize] {
        let at = units.pos[target as usize];
        let matchup = arena.matchup(id, target);
        let is_near = || {
            let is_in_range = distance_squared(units.pos[id as usize], at) <= matchup.reach_squared;
            is_in_range || phase.hit_target == Some(target) && reach::is_in_slop(arena, units, id, target)
        };
        return (!matchup.can_attack || !is_near()).then_some(at);
    }
    match command {
        Command::MoveTo([x, y]) | Command::AttackMove([x, y]) => Some(Vec2::new(x as f32, y as f32)),
        Command::Stop | Command::Target(_) => None,
    }
}

/// On the way to a goal, as fast as the unit can be, and not beyond the goal.
fn velocity(arena: &Arena, units: &Units, id: u32, goal: Vec2) -> Vec2 {
    let (i, stats) = (id as usize, arena.stats(id));
    let next = arena.next_point(id, units.pos[i], goal);
    let way = next - units.pos[i];
    let length = way.length();
    if length == 0.0 || stats.speed == 0.0 {
        return Vec2::ZERO;
    }
    // No unit slows down at a corner.
    let left = if next == goal { length } else { f32::INFINITY };
    let mut speed = (stats.speed as f32).min(left / TICK as f32);
    let acceleration = stats.conduct.acceleration as f32;
    if acceleration > 0.0 {
        // The speed grows before the unit moves, and it brakes for the goal, as recorded medivacs do.
        let reached = units.vel[i].length() + acceleration * TICK as f32;
        speed = speed.min(reached).min((2.0 * acceleration * left).sqrt());
    }
    way * (speed / length)
}

/// Turns a unit that walks into others that stand: it goes past them on the side to which it moves already.
fn go_around(arena: &Arena, units: &Units, scratch: &mut TickScratch, id: u32) {
    let (i, own) = (id as usize, arena.stats(id));
    let TickScratch { preferred, standing, .. } = scratch;
    let wanted = preferred[i];
    let speed = wanted.length();
    if speed == 0.0 {
        return;
    }
    let standing = &standing[own.plane as usize];
    let walker = Walker { at: units.pos[i], radius: own.avoid.radius, target: units.target[i] };
    let is_free = |to: Vec2| !standing.are_in_way(&walker, to);
    let straight = wanted / speed;
    if is_free(straight) {
        return;
    }
    let side = if straight.perp_dot(units.vel[i]) < 0.0 { -1.0 } else { 1.0 };
    let [cos, sin] = TURN;
    let (first, second) = (Vec2::new(cos, sin * side), Vec2::new(cos, -sin * side));
    let (mut one, mut other) = (straight, straight);
    for _ in 0..MAX_TURNS {
        (one, other) = (first.rotate(one), second.rotate(other));
        if let Some(free) = [one, other].into_iter().find(|to| is_free(*to)) {
            preferred[i] = free * speed;
            return;
        }
    }
}

/// Moves all living units, and lets them regenerate.
pub(super) fn move_all(world: &mut World) {
    let World { arena, units, alive_ids, scratch, .. } = world;
    for &id in &alive_ids.all {
        let i = id as usize;
        let limits = &arena.regenerations[i];
        units.vel[i] = units.planned_vel[i];
        if units.vel[i] != Vec2::ZERO {
            units.phases[i].turn_to(units.vel[i], arena.stats(id).turn);
        }
        units.pos[i] = arena.extent.nearest(units.pos[i] + units.vel[i] * TICK as f32);
        units.cooldown[i] = fast_math::max(0.0, units.cooldown[i] - TICK);
        units.shield_cooldown[i] = fast_math::max(0.0, units.shield_cooldown[i] - TICK);
        if units.shield_cooldown[i] == 0.0 {
            units.shield[i] = fast_math::min(limits.shield, units.shield[i] + SHIELD_PER_TICK);
        }
        units.energy[i] = fast_math::min(limits.energy, units.energy[i] + ENERGY_PER_TICK);
        units.hp[i] = fast_math::min(limits.hp, units.hp[i] + limits.hp_per_tick);
    }
    // Searches of area attacks use these positions.
    scratch.start.clear();
    scratch.start.extend_from_slice(&units.pos);
}
