//! The ORCA half-planes that neighbouring units impose, one per entry. `plane_units` finds the neighbours.
//!
//! Derivation (the paper's sections on velocity obstacles and on ORCA). Let p be the position of the
//! neighbour seen from the unit, r the sum of both radii (`reach`), and v the unit's velocity minus that of
//! the neighbour. The two collide within the horizon of 1 s if v lies in the *velocity obstacle*: all v with
//! |t v - p| < r for a t in (0, 1]. That is the cone from the origin that touches the disc of radius r around
//! p, truncated by that disc. With u the least change of v that leads to its boundary, and n the direction
//! out of it there, both units avoid each other if each takes a share of u: the permitted velocities are the
//! half-plane { w : (w - (velocity + share u)) . n >= 0 }. The share is one half, or all of u beside a
//! neighbour that stays where it is.
//!
//! Which part of the boundary is nearest (`least_change`): with w = v - p, the velocity seen from the disc's
//! centre, it is the disc if w points back to the origin (w . p < 0) within the angle of the two touching
//! points ((w . p)^2 > r^2 |w|^2), else one of the two legs of the cone. If the units overlap already, the
//! disc of one tick replaces the cone, so that they separate within that tick.
//!
//! An entry cannot branch on its own. So every case is computed for all entries and one is selected; the
//! result of a case that does not apply, NaN included, is dropped.

use super::linear_program::HalfPlanes;
use crate::TICKS_PER_SECOND;
use crate::simd::{Column, F32s, InstructionSet, Mask, Vec2s};

/// The unit of each entry.
#[derive(Clone, Copy)]
pub(super) struct Movers<S: InstructionSet> {
    pub position: Vec2s<S>,
    pub velocity: Vec2s<S>,
    pub radius: F32s<S>,
}

/// A neighbour of the unit of each entry, in memory.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct NeighbourColumns {
    pub position: [Column; 2],
    pub velocity: [Column; 2],
    pub radius: Column,
    pub share: Column,
}

/// A change of velocity, and the direction of the boundary that it leads to.
#[derive(Clone, Copy)]
struct Escape<S: InstructionSet> {
    direction: Vec2s<S>,
    change: Vec2s<S>,
}

impl<S: InstructionSet> Movers<S> {
    /// The positions of neighbours seen from each unit.
    #[inline(always)]
    pub fn offset_of(&self, neighbours: &NeighbourColumns) -> Vec2s<S> {
        Vec2s::load(self.radius.simd(), &neighbours.position) - self.position
    }

    /// The velocities that keep each unit off its neighbour for the time horizon.
    #[inline(always)]
    pub fn keep_off(&self, neighbours: &NeighbourColumns) -> HalfPlanes<S> {
        let simd = self.radius.simd();
        let offset = self.offset_of(neighbours);
        let relative = self.velocity - Vec2s::load(simd, &neighbours.velocity);
        let reach = self.radius + F32s::load(simd, &neighbours.radius);
        let apart = offset.length_squared().gt(reach * reach);
        let Escape { direction, change } = least_change(offset, relative, reach, apart);
        HalfPlanes { point: self.velocity + change * F32s::load(simd, &neighbours.share), direction }
    }
}

/// The least change of the relative velocity that leads to the boundary of the velocity obstacle.
#[inline(always)]
fn least_change<S: InstructionSet>(
    offset: Vec2s<S>,
    relative: Vec2s<S>,
    reach: F32s<S>,
    apart: Mask<S>,
) -> Escape<S> {
    let zero = F32s::splat(reach.simd(), 0.0);
    let from_tip = relative - offset;
    let towards = from_tip.dot(offset);
    // (w . p)^2 > r^2 |w|^2 compares squares, which saves a root: w is within the angle of the touching
    // points.
    let faces_disc = towards.lt(zero) & (towards * towards).gt(reach * reach * from_tip.length_squared());
    // Units that overlap must be apart after this tick: the disc of that time is the whole obstacle.
    let per_tick = F32s::splat(reach.simd(), TICKS_PER_SECOND as f32);
    let from_centre = apart.either(from_tip, relative - offset * per_tick);
    let disc = disc_escape(from_centre, apart.select(reach, reach * per_tick));
    if !apart.any() {
        // Always so where all units have one size: neighbours are those that touch.
        return disc;
    }
    let leg = leg_escape(offset, relative, from_tip, reach);
    let chosen = !apart | faces_disc;
    Escape {
        direction: chosen.either(disc.direction, leg.direction),
        change: chosen.either(disc.change, leg.change),
    }
}

/// To the nearer leg of the cone. A leg is p turned by the angle whose sine is r / |p|, scaled to length 1:
/// with the length l = sqrt(|p|^2 - r^2) of the leg up to the disc that is (p l + perp(p) r) / |p|^2.
#[inline(always)]
fn leg_escape<S: InstructionSet>(
    offset: Vec2s<S>,
    relative: Vec2s<S>,
    from_tip: Vec2s<S>,
    reach: F32s<S>,
) -> Escape<S> {
    let distance_squared = offset.length_squared();
    let length = (distance_squared - reach * reach).sqrt();
    let is_left = offset.perp_dot(from_tip).gt(F32s::splat(reach.simd(), 0.0));
    // The right leg is the left one with the reach to the other side, and its boundary runs the other way.
    let reach = is_left.select(reach, -reach);
    let per_square = distance_squared.recip();
    let direction =
        Vec2s { x: offset.x * length - offset.y * reach, y: offset.x * reach + offset.y * length }
            * is_left.select(per_square, -per_square);
    // The nearest point of the leg is the projection of v on it.
    Escape { direction, change: direction * relative.dot(direction) - relative }
}

/// To the edge of the disc; `from_centre` is the velocity seen from its centre.
#[inline(always)]
fn disc_escape<S: InstructionSet>(from_centre: Vec2s<S>, radius: F32s<S>) -> Escape<S> {
    // The nearest point of the disc's edge is straight outward; the boundary there is the tangent, with the
    // permitted side, which is outside, on its left.
    let length = from_centre.length_squared().sqrt();
    let outward = from_centre * length.recip();
    Escape { direction: Vec2s { x: outward.y, y: -outward.x }, change: outward * (radius - length) }
}
