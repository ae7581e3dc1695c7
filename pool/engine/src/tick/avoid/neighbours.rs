//! The half-planes that neighbouring units impose, four at a time. Who is a neighbour is found in `crowd`.
//!
//! A lane cannot take a branch of its own, so every case is worked out for all and then one is chosen; what comes
//! of a case that does not apply, be it no number at all, is dropped.

use glam::Vec2;

use super::Mover;
use super::crowd::{FourMembers, Member};
use super::program::Line;
use crate::TICKS_PER_SECOND;
use crate::lanes::{Floats, LANES, Vectors};

/// A change of velocity, and the direction of the boundary that it leads to.
#[derive(Clone, Copy)]
struct Escape {
    direction: Vectors,
    change: Vectors,
}

/// Adds the half-planes that keep `mover` off its neighbours, whose places among the `members` are given.
pub(super) fn lines(
    mover: &Mover,
    members: &[Member],
    mut places: impl ExactSizeIterator<Item = usize>,
    lines: &mut Vec<Line>,
) {
    let n_lines = lines.len() + places.len();
    while let Some(place) = places.next() {
        // There may be less than four left: then some lanes repeat the first, and are cut off below.
        let first = &members[place];
        let mut next = || places.next().map_or(first, |place| &members[place]);
        let four = FourMembers::of([first, next(), next(), next()]);
        lines.extend_from_slice(&FourLines::off(mover, &four).each());
    }
    lines.truncate(n_lines);
}

/// Four half-planes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FourLines {
    pub point: Vectors,
    pub direction: Vectors,
}

impl FourLines {
    /// The velocities that keep `mover` off each of four neighbours for the time horizon.
    #[inline]
    pub fn off(mover: &Mover, neighbours: &FourMembers) -> FourLines {
        let velocity = Vectors::splat(mover.velocity);
        let offset = neighbours.position - Vectors::splat(mover.position);
        let relative = velocity - neighbours.velocity;
        let reach = Floats::splat(mover.kind.radius) + neighbours.radius;
        let apart = offset.length_squared().simd_gt(reach * reach);
        let Escape { direction, change } = least_change(offset, relative, reach, apart);
        FourLines { point: velocity + change * neighbours.share, direction }
    }

    /// One by one.
    pub fn each(&self) -> [Line; LANES] {
        let FourLines { point, direction } = self;
        let lines = Floats::transpose([point.x, point.y, direction.x, direction.y]);
        lines.map(|line| {
            let [x, y, along_x, along_y] = line.to_array();
            Line { point: Vec2::new(x, y), direction: Vec2::new(along_x, along_y) }
        })
    }

    /// How far on the wrong side velocities are; negative if they are permitted.
    pub fn depth(&self, velocities: Vectors) -> Floats {
        self.direction.perp_dot(self.point - velocities)
    }
}

/// The least change of the relative velocity that leaves the velocity obstacle, a cone that a disc truncates.
fn least_change(offset: Vectors, relative: Vectors, reach: Floats, apart: Floats) -> Escape {
    let from_tip = relative - offset;
    let towards = from_tip.dot(offset);
    let faces_disc = towards.simd_lt(Floats::ZERO)
        & (towards * towards).simd_gt(reach * reach * from_tip.length_squared());
    // Units that overlap are to be apart after this tick: the disc of that time is all of the obstacle.
    let per_tick = Floats::splat(TICKS_PER_SECOND as f32);
    let from_centre = Vectors::either(apart, from_tip, relative - offset * per_tick);
    let disc = off_the_disc(from_centre, apart.select(reach, reach * per_tick));
    if !apart.any() {
        return disc; // as ever where all units are of one size: they do not look farther than they touch
    }
    let leg = off_the_leg(offset, relative, from_tip, reach);
    let chosen = !apart | faces_disc;
    Escape {
        direction: Vectors::either(chosen, disc.direction, leg.direction),
        change: Vectors::either(chosen, disc.change, leg.change),
    }
}

/// Off the nearer leg of the cone.
fn off_the_leg(offset: Vectors, relative: Vectors, from_tip: Vectors, reach: Floats) -> Escape {
    let distance_squared = offset.length_squared();
    let length = (distance_squared - reach * reach).sqrt();
    let is_left = offset.perp_dot(from_tip).simd_gt(Floats::ZERO);
    // The right leg is the left one with the reach to the other side, and its boundary runs the other way.
    let reach = is_left.select(reach, -reach);
    let per_square = Floats::ONE / distance_squared;
    let direction =
        Vectors { x: offset.x * length - offset.y * reach, y: offset.x * reach + offset.y * length }
            * is_left.select(per_square, -per_square);
    Escape { direction, change: direction * relative.dot(direction) - relative }
}

/// Off the disc; `from_centre` is the velocity seen from its centre.
fn off_the_disc(from_centre: Vectors, radius: Floats) -> Escape {
    let length = from_centre.length_squared().sqrt();
    let outward = from_centre * (Floats::ONE / length);
    Escape { direction: Vectors { x: outward.y, y: -outward.x }, change: outward * (radius - length) }
}
