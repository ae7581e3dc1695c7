//! The ORCA half-planes that neighbouring units impose, four at a time. `plane_units` finds the neighbours.
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
//! An entry of a register cannot branch on its own. So every case is computed for all four neighbours and one
//! is selected; the result of a case that does not apply, NaN included, is dropped.

use glam::Vec2;

use super::Mover;
use super::linear_program::HalfPlane;
use super::plane_units::{Neighbour, NeighbourX4};
use crate::TICKS_PER_SECOND;
use crate::simd::{F32x4, Vec2x4, WIDTH};

/// A change of velocity, and the direction of the boundary that it leads to.
#[derive(Clone, Copy)]
struct Escape {
    direction: Vec2x4,
    change: Vec2x4,
}

/// Adds the half-planes that keep `mover` off its neighbours, whose indices among the `members` are given.
pub(super) fn half_planes(
    mover: &Mover,
    members: &[Neighbour],
    mut indices: impl ExactSizeIterator<Item = usize>,
    half_planes: &mut Vec<HalfPlane>,
) {
    let n_half_planes = half_planes.len() + indices.len();
    while let Some(index) = indices.next() {
        // Fewer than four may be left: then the first is repeated, and its copies are cut off below.
        let first = &members[index];
        let mut next = || indices.next().map_or(first, |index| &members[index]);
        let four = NeighbourX4::of([first, next(), next(), next()]);
        half_planes.extend_from_slice(&HalfPlaneX4::orca(mover, &four).each());
    }
    half_planes.truncate(n_half_planes);
}

/// Four half-planes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct HalfPlaneX4 {
    pub point: Vec2x4,
    pub direction: Vec2x4,
}

impl HalfPlaneX4 {
    /// The velocities that keep `mover` off each of four neighbours for the time horizon.
    #[inline]
    pub fn orca(mover: &Mover, neighbours: &NeighbourX4) -> HalfPlaneX4 {
        let velocity = Vec2x4::splat(mover.velocity);
        let offset = neighbours.position - Vec2x4::splat(mover.position);
        let relative = velocity - neighbours.velocity;
        let reach = F32x4::splat(mover.stats.radius) + neighbours.radius;
        let apart = offset.length_squared().simd_gt(reach * reach);
        let Escape { direction, change } = least_change(offset, relative, reach, apart);
        HalfPlaneX4 { point: velocity + change * neighbours.share, direction }
    }

    /// The half-planes one by one.
    pub fn each(&self) -> [HalfPlane; WIDTH] {
        let HalfPlaneX4 { point, direction } = self;
        let half_planes = F32x4::transpose([point.x, point.y, direction.x, direction.y]);
        half_planes.map(|half_plane| {
            let [x, y, along_x, along_y] = half_plane.to_array();
            HalfPlane { point: Vec2::new(x, y), direction: Vec2::new(along_x, along_y) }
        })
    }

    /// How far velocities are on the wrong side of the boundaries; negative if they are permitted.
    pub fn violation(&self, velocities: Vec2x4) -> F32x4 {
        self.direction.perp_dot(self.point - velocities)
    }
}

/// The least change of the relative velocity that leads to the boundary of the velocity obstacle.
fn least_change(offset: Vec2x4, relative: Vec2x4, reach: F32x4, apart: F32x4) -> Escape {
    let from_tip = relative - offset;
    let towards = from_tip.dot(offset);
    // (w . p)^2 > r^2 |w|^2 compares squares, which saves a root: w is within the angle of the touching
    // points.
    let faces_disc =
        towards.simd_lt(F32x4::ZERO) & (towards * towards).simd_gt(reach * reach * from_tip.length_squared());
    // Units that overlap must be apart after this tick: the disc of that time is the whole obstacle.
    let per_tick = F32x4::splat(TICKS_PER_SECOND as f32);
    let from_centre = Vec2x4::either(apart, from_tip, relative - offset * per_tick);
    let disc = disc_escape(from_centre, apart.select(reach, reach * per_tick));
    if !apart.any() {
        // Always so where all units have one size: neighbours are those that touch.
        return disc;
    }
    let leg = leg_escape(offset, relative, from_tip, reach);
    let chosen = !apart | faces_disc;
    Escape {
        direction: Vec2x4::either(chosen, disc.direction, leg.direction),
        change: Vec2x4::either(chosen, disc.change, leg.change),
    }
}

/// To the nearer leg of the cone. A leg is p turned by the angle whose sine is r / |p|, scaled to length 1:
/// with the length l = sqrt(|p|^2 - r^2) of the leg up to the disc that is (p l + perp(p) r) / |p|^2.
fn leg_escape(offset: Vec2x4, relative: Vec2x4, from_tip: Vec2x4, reach: F32x4) -> Escape {
    let distance_squared = offset.length_squared();
    let length = (distance_squared - reach * reach).sqrt();
    let is_left = offset.perp_dot(from_tip).simd_gt(F32x4::ZERO);
    // The right leg is the left one with the reach to the other side, and its boundary runs the other way.
    let reach = is_left.select(reach, -reach);
    let per_square = F32x4::ONE / distance_squared;
    let direction =
        Vec2x4 { x: offset.x * length - offset.y * reach, y: offset.x * reach + offset.y * length }
            * is_left.select(per_square, -per_square);
    // The nearest point of the leg is the projection of v on it.
    Escape { direction, change: direction * relative.dot(direction) - relative }
}

/// To the edge of the disc; `from_centre` is the velocity seen from its centre.
fn disc_escape(from_centre: Vec2x4, radius: F32x4) -> Escape {
    // The nearest point of the disc's edge is straight outward; the boundary there is the tangent, with the
    // permitted side, which is outside, on its left.
    let length = from_centre.length_squared().sqrt();
    let outward = from_centre * (F32x4::ONE / length);
    Escape { direction: Vec2x4 { x: outward.y, y: -outward.x }, change: outward * (radius - length) }
}
