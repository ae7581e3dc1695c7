//! Bodies: all units step as they prefer, at once, and those that overlap then are pushed apart.
//!
//! Two units are pushed along the line of their centres until they touch, and each gives a *share* of that
//! way:
//!
//! - of two that walk, the larger gives more, by the fourth power of its radius;
//! - one that is idle gives nearly all to a unit of its side that walks, half to an idle one, and nothing to
//!   units of the other side;
//! - one that attacks gives nothing, but half to another that attacks.
//!
//! The pushes of all pairs are added up, from the positions after the steps. No unit comes farther than its
//! speed allows, and none into a wall. docs/concepts/starcraft.md says what this rests on.

use glam::Vec2;
use smaclite_units::Plane;

use super::super::{TickScratch, World};
use super::crowd::{Crowd, Member};
use crate::arena::{Arena, EdgeBlock, EdgeSearch, StarcraftStats};
use crate::simd::{F32s, InstructionSet, Kernel, Vec2s};
use crate::{TICK, TICKS_PER_SECOND};

/// The share that a unit gives which walks into an idle one of its side.
const SHARE_BESIDE_IDLE: f32 = 0.15;

/// The side of a unit that holds its place: no other unit is of it.
pub(super) const NO_SIDE: f32 = 2.0;

/// What a unit does in a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::tick) enum Posture {
    Walks,
    /// Stands, and units of its side push it.
    IsIdle,
    /// Stands, and only units push it that do so, too.
    #[default]
    Holds,
}

/// The side of a unit, as crowds have it.
#[inline(always)]
pub(super) fn side_of(arena: &Arena, id: u32) -> f32 {
    if arena.is_enemy(id) { 1.0 } else { 0.0 }
}

/// Plans the velocity of every living unit.
#[inline(never)]
pub(super) fn push_apart(world: &mut World) {
    world.scratch.level.run(Pushing { world });
}

struct Pushing<'a, 'w> {
    world: &'a mut World<'w>,
}

impl Kernel for Pushing<'_, '_> {
    #[inline(always)]
    fn run<S: InstructionSet>(self, simd: S) {
        let World { arena, units, alive_ids, scratch, .. } = self.world;
        let TickScratch { preferred, postures, standing, walking, avoid, .. } = &mut **scratch;
        let (standing, walking) = (&*standing, &*walking);
        // Slices of one length: one check of an id serves all columns.
        let n = units.pos.len();
        let (pos, planned_vel) = (&units.pos[..n], &mut units.planned_vel[..n]);
        let (preferred, postures) = (&preferred[..n], &postures[..n]);
        let all_stats = &arena.starcraft_stats[..n];
        for &id in &alive_ids.all {
            let (i, side) = (id as usize, side_of(arena, id));
            let stats = &all_stats[i];
            let at = pos[i] + preferred[i] * TICK as f32;
            let unit = Member { id: id as f32, side, at, body: stats.body };
            let (standing, walking) = (&standing[stats.plane as usize], &walking[stats.plane as usize]);
            let is_own = |other: &Member| other.side == unit.side;
            let pushed = match postures[i] {
                Posture::Walks => {
                    let weight = unit.body.weight;
                    pushes(simd, standing, &unit, |other| if is_own(other) { SHARE_BESIDE_IDLE } else { 1.0 })
                        + pushes(simd, walking, &unit, |other| weight / (weight + other.body.weight))
                }
                Posture::IsIdle => {
                    let share = |other: &Member| if is_own(other) { 1.0 - SHARE_BESIDE_IDLE } else { 0.0 };
                    pushes(simd, standing, &unit, |other| if is_own(other) { 0.5 } else { 1.0 })
                        + pushes(simd, walking, &unit, share)
                }
                Posture::Holds => {
                    pushes(simd, standing, &unit, |other| if other.side == NO_SIDE { 0.5 } else { 0.0 })
                }
            };
            let mut step = stats.shortened(unit.at + pushed - pos[i]);
            if stats.plane == Plane::Ground {
                step = off_walls(arena, pos[i], step, stats, &mut avoid.edge_search);
            }
            planned_vel[i] = step * TICKS_PER_SECOND as f32;
        }
    }
}

impl StarcraftStats {
    /// A step of a tick, or the part of it for which the unit is fast enough.
    #[inline(always)]
    fn shortened(&self, step: Vec2) -> Vec2 {
        let (longest, length_squared) = (self.speed * TICK as f32, step.length_squared());
        if length_squared > longest * longest { step * (longest / length_squared.sqrt()) } else { step }
    }
}

/// How far the units of a crowd push one: the sum by ascending ids.
#[inline(always)]
fn pushes<S: InstructionSet>(simd: S, crowd: &Crowd, unit: &Member, share: impl Fn(&Member) -> f32) -> Vec2 {
    let (at, radius) = (Vec2s::splat(simd, unit.at), F32s::splat(simd, unit.body.radius));
    let id = F32s::splat(simd, unit.id);
    let mut sum = Vec2::ZERO;
    for (len, group) in crowd.groups() {
        let mut touching = group.which(simd, len, |them| {
            let reach = radius + them.radii;
            (at - them.at).length_squared().lt(reach * reach) & !them.ids.eq(id)
        });
        while touching != 0 {
            let other = group.member(touching.trailing_zeros() as usize);
            touching &= touching - 1;
            let way = unit.at - other.at;
            let length = way.length();
            // Of two units at one point, that with the lower id goes west.
            let aside = if unit.id < other.id { Vec2::NEG_X } else { Vec2::X };
            let direction = if length > 0.0 { way * (1.0 / length) } else { aside };
            sum += direction * ((unit.body.radius + other.body.radius - length) * share(&other));
        }
    }
    sum
}

/// A step that ends away from the walls around its start.
#[inline(always)]
fn off_walls(
    arena: &Arena,
    from: Vec2,
    step: Vec2,
    stats: &StarcraftStats,
    edge_search: &mut EdgeSearch,
) -> Vec2 {
    let cell = arena.edges.cell(from);
    if !arena.edges.may_see(cell) {
        return step;
    }
    let (mut to, distance) = (from + step, stats.wall_distance);
    for block in arena.edges.near(cell, edge_search) {
        for &number in block.numbers.iter().take_while(|number| **number != EdgeBlock::NO_EDGE) {
            let edge = arena.edges.edge(number);
            // The outside of a wall is on the right. A unit that begins within one may leave it.
            let outward = Vec2::new(edge.along.y, -edge.along.x);
            if outward.dot(from - edge.start) < 0.0 {
                continue;
            }
            let length = (edge.end - edge.start).dot(edge.along);
            let way = to - edge.start;
            let (along, across) = (way.dot(edge.along), way.dot(outward));
            let past_end = along - along.clamp(0.0, length);
            // Beside the edge the distance has a sign: the step may have led through it.
            let apart = if past_end == 0.0 { across } else { Vec2::new(past_end, across).length() };
            if apart < distance {
                let direction = match past_end {
                    0.0 => outward,
                    _ => (edge.along * past_end + outward * across) * (1.0 / apart),
                };
                to += direction * (distance - apart);
            }
        }
    }
    let step = stats.shortened(to - from);
    // A unit that is too large for a gap stays.
    if arena.is_wall(from + step) && !arena.is_wall(from) { Vec2::ZERO } else { step }
}
