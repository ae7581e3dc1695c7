//! Where units want to go, and their way there.

use std::hint::select_unpredictable;

use glam::Vec2;

use super::super::{TickScratch, World};
use crate::arena::{Arena, StarcraftStats};
use crate::command::Command;
use crate::fast_math;
use crate::simd::x4::{F32x4, Vec2x4, WIDTH, four};
use crate::units::AttackPhase;
use crate::{ENERGY_PER_TICK, SHIELD_PER_TICK, TICK};

/// How far ahead of itself a unit looks for others that stand in its way, in squares.
const LOOK_AHEAD: f32 = 1.0;
/// Cosine and sine of 20 degrees, by which a unit turns to find a free way; given as numbers, since the last
/// bits of trigonometric functions depend on the machine.
const TURN: [f32; 2] = [0.939_692_6, 0.342_020_15];
/// How often it turns at most, to either side: up to 100 degrees.
const MAX_TURNS: usize = 5;
/// How many registers the directions fill into which it turns.
const TURN_REGISTERS: usize = (2 * MAX_TURNS).div_ceil(WIDTH);
/// Units that touch do not block the way past each other.
const TOUCH: f32 = 0.98;

/// The units of a plane that stand in this tick, in groups that one instruction computes. There are groups
/// for all units, of which the first `len` count.
#[derive(Debug, Default)]
pub(in crate::tick) struct Standing {
    len: usize,
    groups: Vec<Group>,
}

/// Four units, one per entry of each column.
#[derive(Clone, Debug, Default)]
struct Group {
    ids: [u32; WIDTH],
    x: [f32; WIDTH],
    y: [f32; WIDTH],
    radii: [f32; WIDTH],
}

/// A standing unit near one that walks.
#[derive(Debug)]
pub(in crate::tick) struct Near {
    /// From the unit that walks to this one.
    way: Vec2,
    /// It blocks a way that passes it within this.
    reach: f32,
}

impl Standing {
    pub fn reserve(&mut self, n_units: usize) {
        self.groups.resize(n_units.div_ceil(WIDTH), Group::default());
    }

    /// Adds a unit if it stands, without a branch: whether it does is hard to predict.
    #[inline(always)]
    fn add_if(&mut self, stands: bool, id: u32, at: Vec2, radius: f32) {
        let (group, entry) = (&mut self.groups[self.len / WIDTH], self.len % WIDTH);
        (group.ids[entry], group.x[entry], group.y[entry], group.radii[entry]) = (id, at.x, at.y, radius);
        self.len += usize::from(stands);
    }

    /// Fills the last group with units that are near no other.
    fn pad(&mut self) {
        while !self.len.is_multiple_of(WIDTH) {
            self.add_if(true, u32::MAX, Vec2::INFINITY, 0.0);
        }
    }

    /// Finds the units near one at a point. Its target is not in its way.
    fn find_near(&self, at: Vec2, radius: f32, target: Option<u32>, near: &mut Vec<Near>) {
        near.clear();
        let four = four();
        let at = Vec2x4::splat(four, at);
        let [own, ahead, touch] = [radius, LOOK_AHEAD, TOUCH].map(|number| F32x4::splat(four, number));
        for group in &self.groups[..self.len / WIDTH] {
            let [x, y, radii] = [group.x, group.y, group.radii].map(|numbers| F32x4::new(four, numbers));
            let (way, reach) = (Vec2x4 { x, y } - at, own + radii);
            let mut bits = way.length_squared().lt((reach + ahead) * (reach + ahead)).bits();
            if bits == 0 {
                continue;
            }
            let [x, y, reach] = [way.x, way.y, reach * touch].map(F32x4::to_array);
            while bits != 0 {
                let entry = bits.trailing_zeros() as usize % WIDTH; // so that no index is checked
                if Some(group.ids[entry]) != target {
                    near.push(Near { way: Vec2::new(x[entry], y[entry]), reach: reach[entry] });
                }
                bits &= bits - 1;
            }
        }
    }
}

/// Sets the preferred velocity of every living unit.
#[inline(never)]
pub(super) fn prefer(world: &mut World) {
    let World { arena, units, alive_ids, scratch, .. } = world;
    let TickScratch { commands, preferred, standing, near, .. } = &mut **scratch;
    standing.iter_mut().for_each(|plane| plane.len = 0);
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
    let (preferred, avoidance) = (&mut preferred[..n], &arena.avoidance[..n]);
    for &id in &alive_ids.all {
        let i = id as usize;
        preferred[i] = walks.goal(id).map_or(Vec2::ZERO, |goal| walks.velocity(i, goal));
        let stands = preferred[i] == Vec2::ZERO;
        standing[walks.all_stats[i].plane as usize].add_if(stands, id, walks.pos[i], avoidance[i].radius);
    }
    standing.iter_mut().for_each(Standing::pad);
    for &id in &alive_ids.all {
        let i = id as usize;
        if preferred[i] == Vec2::ZERO {
            continue;
        }
        let standing = &standing[walks.all_stats[i].plane as usize];
        standing.find_near(walks.pos[i], avoidance[i].radius, walks.targets[i], near);
        if !near.is_empty() {
            preferred[i] = go_around(near, preferred[i], walks.vel[i]);
        }
    }
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
    /// Where a unit walks to; `None` if it stands.
    #[inline(always)]
    fn goal(&self, id: u32) -> Option<Vec2> {
        let i = id as usize;
        let phase = &self.phases[i];
        if phase.windup > 0.0 || phase.backswing > 0.0 {
            return None;
        }
        if let Some(target) = self.targets[i] {
            let (matchup, at) = (self.arena.matchup(id, target), self.pos[target as usize]);
            let is_near = matchup.reaches(self.pos[i], at, phase.hit_target == Some(target));
            return (!is_near || !matchup.can_attack).then_some(at);
        }
        match self.commands[i] {
            Command::MoveTo([x, y]) | Command::AttackMove([x, y]) => Some(Vec2::new(x as f32, y as f32)),
            Command::Stop | Command::Target(_) => None,
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

/// Turns a unit that walks into others that stand: it goes past them on the side to which it moves already.
fn go_around(near: &[Near], wanted: Vec2, vel: Vec2) -> Vec2 {
    let speed = wanted.length();
    let straight = wanted / speed;
    let blocks = |near: &Near| near.way.dot(straight) > 0.0 && near.way.perp_dot(straight).abs() < near.reach;
    if speed == 0.0 || !near.iter().any(blocks) {
        return wanted;
    }
    let side = if straight.perp_dot(vel) < 0.0 { -1.0 } else { 1.0 };
    let [cos, sin] = TURN;
    let turns = [Vec2::new(cos, sin * side), Vec2::new(cos, -sin * side)];
    let mut directions = [straight; 2 * MAX_TURNS];
    for at in 0..directions.len() {
        let before = if at < 2 { straight } else { directions[at - 2] };
        directions[at] = turns[at % 2].rotate(before);
    }
    first_free(near, &directions).map_or(wanted, |free| free * speed)
}

/// The first of some directions in which no unit is in the way. All are tried at once, since how many are
/// blocked is hard to predict.
fn first_free(near: &[Near], directions: &[Vec2; 2 * MAX_TURNS]) -> Option<Vec2> {
    let four = four();
    let zero = F32x4::splat(four, 0.0);
    let to: [Vec2x4; TURN_REGISTERS] = std::array::from_fn(|register| {
        let direction = |entry| directions.get(register * WIDTH + entry).copied().unwrap_or(Vec2::ZERO);
        Vec2x4::new(four, std::array::from_fn(direction))
    });
    let mut blocked = [0; TURN_REGISTERS];
    for &Near { way, reach } in near {
        let (way, reach) = (Vec2x4::splat(four, way), F32x4::splat(four, reach));
        for (blocked, to) in blocked.iter_mut().zip(to) {
            let (is_ahead, is_in_lane) = (way.dot(to).gt(zero), way.perp_dot(to).abs().lt(reach));
            *blocked |= (is_ahead & is_in_lane).bits();
        }
    }
    let all = blocked.iter().rev().fold(0, |all, bits| all << WIDTH | bits);
    directions.get(all.trailing_ones() as usize).copied()
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
    let phases = &mut units.phases[..n];
    for &id in &alive_ids.all {
        let i = id as usize;
        let limits = &regenerations[i];
        vel[i] = planned_vel[i];
        if vel[i] != Vec2::ZERO {
            phases[i].turn_to(vel[i], all_stats[i].turn);
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
