//! The half-planes that obstacle edges impose on ground units, one per entry. `search` finds the edges.
//!
//! Derivation (the paper's section on static obstacles). An obstacle does not move and takes no share of the
//! avoidance, so the unit must avoid it alone. Seen from the unit, the velocity obstacle of an edge is the
//! set of velocities that lead to a collision within the horizon of 1 s: everything behind the edge as seen
//! from the unit, widened by the radius. Its boundary has three parts: a *leg* from the left corner, a leg
//! from the right corner, and the *cut-off line* between them, which is the edge itself. Both legs are
//! tangents of the discs of the unit's radius around the corners, and at the corners the boundary is an arc
//! of these discs.
//!
//! The permitted velocities are the half-plane outside the boundary at the point nearest to the current
//! velocity. This is done for every edge in sight, nearest first; edges that earlier half-planes cover
//! already are skipped.
//!
//! The outline of an obstacle is closed, and adjacent edges share a corner. Where a leg would point into the
//! adjacent edge, that edge is the boundary instead: it *replaces* the leg, which gives no half-plane, since
//! the adjacent edge gives one.
//!
//! An entry cannot branch on its own: a case that applies to any entry is computed for all, and selected
//! where it applies. Begin reading in `reference.rs`, which has the same for one unit at a time; the tests
//! compare the bits.

#[cfg(test)]
mod reference;
mod search;
#[cfg(test)]
mod tests;

pub(super) use search::find;

use super::EPSILON;
use super::linear_program::{HalfPlaneColumns, HalfPlanes};
use super::neighbours::Movers;
use crate::arena::Edge;
use crate::simd::{Column, F32s, InstructionSet, Mask, Vec2s};

/// An edge that the unit of each entry sees, in memory.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct EdgeColumns {
    start: [Column; 2],
    end: [Column; 2],
    before: [Column; 2],
    along: [Column; 2],
    after: [Column; 2],
}

impl EdgeColumns {
    /// Sets the edge of an entry.
    #[inline(always)]
    pub fn set(&mut self, entry: usize, edge: &Edge) {
        let columns = [&mut self.start, &mut self.end, &mut self.before, &mut self.along, &mut self.after];
        for ([x, y], vector) in
            columns.into_iter().zip([edge.start, edge.end, edge.before, edge.along, edge.after])
        {
            (x[entry], y[entry]) = vector.into();
        }
    }
}

impl EdgeColumns {
    /// The start and the end of each edge, for units at these positions.
    #[inline(always)]
    fn corners<S: InstructionSet>(&self, positions: Vec2s<S>) -> [Corner<S>; 2] {
        let simd = positions.x.simd();
        let [start, end, before, along, after] =
            [&self.start, &self.end, &self.before, &self.along, &self.after].map(
                #[inline(always)]
                |vectors| Vec2s::load(simd, vectors),
            );
        [
            Corner { offset: start - positions, incoming: before, outgoing: along },
            Corner { offset: end - positions, incoming: along, outgoing: after },
        ]
    }
}

/// A corner of an obstacle, and the directions of the outline before and after it.
#[derive(Clone, Copy)]
struct Corner<S: InstructionSet> {
    /// Position relative to the unit.
    offset: Vec2s<S>,
    incoming: Vec2s<S>,
    outgoing: Vec2s<S>,
}

impl<S: InstructionSet> Corner<S> {
    #[inline(always)]
    fn either(is_this: Mask<S>, this: &Corner<S>, that: &Corner<S>) -> Corner<S> {
        Corner {
            offset: is_this.either(this.offset, that.offset),
            incoming: is_this.either(this.incoming, that.incoming),
            outgoing: is_this.either(this.outgoing, that.outgoing),
        }
    }
}

/// Half-planes, and in which entries there are any.
type Optional<S> = (HalfPlanes<S>, Mask<S>);

/// The first where the condition holds, elsewhere the second.
#[inline(always)]
fn either<S: InstructionSet>(is_this: Mask<S>, this: Optional<S>, that: Optional<S>) -> Optional<S> {
    let half_planes = HalfPlanes {
        point: is_this.either(this.0.point, that.0.point),
        direction: is_this.either(this.0.direction, that.0.direction),
    };
    (half_planes, is_this & this.1 | !is_this & that.1)
}

/// Where half-planes of nearer edges keep each unit off its edge already.
#[inline(always)]
pub(super) fn are_covered<S: InstructionSet>(
    movers: &Movers<S>,
    edges: &EdgeColumns,
    nearer: &[HalfPlaneColumns],
) -> Mask<S> {
    let (simd, radius) = (movers.radius.simd(), movers.radius);
    let zero = F32s::splat(simd, 0.0);
    let [start, end] = [&edges.start, &edges.end].map(
        #[inline(always)]
        |end| Vec2s::load(simd, end) - movers.position,
    );
    let mut are_covered = zero.lt(zero);
    for half_planes in nearer {
        let (half_planes, exist) = half_planes.load(simd);
        let both = covers(&half_planes, start, radius) & covers(&half_planes, end, radius);
        are_covered = are_covered | exist & both;
    }
    are_covered
}

/// The velocities that keep each unit off its edge for the time horizon, and where there are any: not where
/// the half-plane of an adjacent edge ensures that.
#[inline(always)]
pub(super) fn keep_off<S: InstructionSet>(movers: &Movers<S>, edges: &EdgeColumns) -> Optional<S> {
    let (simd, radius) = (movers.radius.simd(), movers.radius);
    let (zero, one) = (F32s::splat(simd, 0.0), F32s::splat(simd, 1.0));
    let [start, end] = edges.corners(movers.position);
    // The position of the unit projected on the line of the edge, as a share of the edge.
    let radius_squared = radius * radius;
    let span = Vec2s::load(simd, &edges.end) - Vec2s::load(simd, &edges.start);
    let share = (-start.offset).dot(span).div(span.length_squared());
    let (is_before, is_behind) = (share.lt(zero), share.gt(one));
    let touches_line = (-start.offset - span * share).length_squared().le(radius_squared);

    // A unit beside the edge and close to its line sees the edge end-on: both legs begin at the nearer
    // corner.
    let (only_start, only_end) = (is_before & touches_line, is_behind & touches_line);
    let boundary = Boundary::new(
        &Corner::either(only_end, &end, &start),
        &Corner::either(only_start, &start, &end),
        only_start | only_end,
        radius,
    );
    let chosen = boundary.half_planes(movers.velocity, radius);

    // The unit touches the obstacle already, at a corner or along the edge. Then the velocity obstacle is a
    // half-plane, of which the boundary passes through velocity zero: do not come closer.
    let touches_edge = share.ge(zero) & share.lt(one) & touches_line;
    let (origin, everywhere) = (Vec2s { x: zero, y: zero }, zero.le(zero));
    let mut chosen =
        either(touches_edge, (HalfPlanes { point: origin, direction: -start.outgoing }, everywhere), chosen);
    // If the next edge is in view too, it is the one that keeps the unit off this corner.
    let touches_end = is_behind & end.offset.length_squared().le(radius_squared);
    if touches_end.any() {
        let keeps_off_end = end.offset.perp_dot(end.outgoing).ge(zero);
        chosen = either(touches_end, (away_from(end.offset), keeps_off_end), chosen);
    }
    let touches_start = is_before & start.offset.length_squared().le(radius_squared);
    if touches_start.any() {
        chosen = either(touches_start, (away_from(start.offset), everywhere), chosen);
    }
    chosen
}

/// Whether the half-planes already keep each unit off this point of an obstacle: whether all velocities that
/// reach the disc of the unit's radius around the point within 1 s are outside of it.
#[inline(always)]
fn covers<S: InstructionSet>(half_planes: &HalfPlanes<S>, offset: Vec2s<S>, radius: F32s<S>) -> Mask<S> {
    let distance = (offset - half_planes.point).perp_dot(half_planes.direction) - radius;
    distance.ge(F32s::splat(radius.simd(), -EPSILON))
}

/// The half-planes of units that touch a corner: velocities that do not come closer.
#[inline(always)]
fn away_from<S: InstructionSet>(corner: Vec2s<S>) -> HalfPlanes<S> {
    let zero = F32s::splat(corner.x.simd(), 0.0);
    HalfPlanes {
        point: Vec2s { x: zero, y: zero },
        direction: Vec2s { x: -corner.y, y: corner.x }.normalize(),
    }
}

/// The boundary of the velocity obstacle of an edge before it is widened by the radius: two legs, and the
/// cut-off line between them.
#[derive(Clone, Copy)]
struct Boundary<S: InstructionSet> {
    left: Leg<S>,
    right: Leg<S>,
    /// Direction of the outline at the left corner.
    along: Vec2s<S>,
    /// Whether both legs start at one corner; then there is no cut-off line.
    single: Mask<S>,
}

#[derive(Clone, Copy)]
struct Leg<S: InstructionSet> {
    corner: Vec2s<S>,
    direction: Vec2s<S>,
    /// Whether the adjacent edge replaces this leg.
    is_replaced: Mask<S>,
}

impl<S: InstructionSet> Boundary<S> {
    #[inline(always)]
    fn new(left: &Corner<S>, right: &Corner<S>, single: Mask<S>, radius: F32s<S>) -> Boundary<S> {
        Boundary {
            left: Leg::left(left, radius),
            right: Leg::right(right, radius),
            along: left.outgoing,
            single,
        }
    }

    /// The half-planes at the points of the boundaries nearest to the velocities.
    #[inline(always)]
    fn half_planes(&self, velocity: Vec2s<S>, radius: F32s<S>) -> Optional<S> {
        let simd = radius.simd();
        let [zero, half, one, infinite] = [0.0, 0.5, 1.0, f32::INFINITY].map(
            #[inline(always)]
            |x| F32s::splat(simd, x),
        );
        // Because the horizon is 1 s, a velocity is also the point that the unit reaches within the horizon,
        // and can be compared with the corners. Its projections decide which part of the boundary is nearest.
        let Boundary { left, right, along, single } = *self;
        let cutoff = right.corner - left.corner;
        let from_left = velocity - left.corner;
        let share = single.select(half, from_left.dot(cutoff).div(cutoff.length_squared()));
        let on_left = from_left.dot(left.direction);
        let on_right = (velocity - right.corner).dot(right.direction);
        // Behind the start of a leg and beside the cut-off: the nearest point is on the arc around the
        // corner.
        let rounds_left = on_left.lt(zero) & (share.lt(zero) | single & on_right.lt(zero));
        let rounds_right = share.gt(one) & on_right.lt(zero);

        // Otherwise it is on the nearest of the three lines, of those that the velocity projects onto. Of
        // equal distances the cut-off comes first, then the left leg.
        let is_beside = !single & share.ge(zero) & share.le(one);
        let to_cutoff =
            is_beside.select((velocity - (left.corner + cutoff * share)).length_squared(), infinite);
        let to_left = left.distance_squared(velocity, on_left);
        let to_right = right.distance_squared(velocity, on_right);
        let everywhere = zero.le(zero);
        // A replaced leg gives no half-plane: the adjacent edge gives one.
        let chosen = either(
            to_left.le(to_right),
            (widened(left.corner, left.direction, radius), !left.is_replaced),
            (widened(right.corner, -right.direction, radius), !right.is_replaced),
        );
        let is_cutoff = to_cutoff.le(to_left) & to_cutoff.le(to_right);
        let mut chosen = either(is_cutoff, (widened(left.corner, -along, radius), everywhere), chosen);
        if rounds_right.any() {
            chosen = either(rounds_right, (round_corner(right.corner, velocity, radius), everywhere), chosen);
        }
        if rounds_left.any() {
            chosen = either(rounds_left, (round_corner(left.corner, velocity, radius), everywhere), chosen);
        }
        chosen
    }
}

impl<S: InstructionSet> Leg<S> {
    /// The left tangent from each unit to the disc around a corner; see `neighbours::leg_escape` for the
    /// derivation. A leg that would point into the adjacent edge is replaced by the direction of that edge.
    #[inline(always)]
    fn left(corner: &Corner<S>, radius: F32s<S>) -> Leg<S> {
        let (offset, distance_squared) = (corner.offset, corner.offset.length_squared());
        let length = (distance_squared - radius * radius).sqrt();
        let direction =
            Vec2s { x: offset.x * length - offset.y * radius, y: offset.x * radius + offset.y * length }
                * distance_squared.recip();
        let adjacent = -corner.incoming;
        let is_replaced = direction.perp_dot(adjacent).ge(F32s::splat(radius.simd(), 0.0));
        Leg { corner: offset, direction: is_replaced.either(adjacent, direction), is_replaced }
    }

    /// The right tangent.
    #[inline(always)]
    fn right(corner: &Corner<S>, radius: F32s<S>) -> Leg<S> {
        let (offset, distance_squared) = (corner.offset, corner.offset.length_squared());
        let length = (distance_squared - radius * radius).sqrt();
        let direction =
            Vec2s { x: offset.x * length + offset.y * radius, y: -offset.x * radius + offset.y * length }
                * distance_squared.recip();
        let adjacent = corner.outgoing;
        let is_replaced = direction.perp_dot(adjacent).le(F32s::splat(radius.simd(), 0.0));
        Leg { corner: offset, direction: is_replaced.either(adjacent, direction), is_replaced }
    }

    /// The squared distances of velocities whose projections on the leg are `at`; infinite before the leg
    /// starts.
    #[inline(always)]
    fn distance_squared(&self, velocity: Vec2s<S>, at: F32s<S>) -> F32s<S> {
        let simd = at.simd();
        let distance_squared = (velocity - (self.corner + self.direction * at)).length_squared();
        at.lt(F32s::splat(simd, 0.0)).select(F32s::splat(simd, f32::INFINITY), distance_squared)
    }
}

/// The half-planes at the arc around a corner: the tangent of the disc at the point nearest to the velocity.
#[inline(always)]
fn round_corner<S: InstructionSet>(corner: Vec2s<S>, velocity: Vec2s<S>, radius: F32s<S>) -> HalfPlanes<S> {
    let outward = (velocity - corner).normalize();
    HalfPlanes { point: corner + outward * radius, direction: Vec2s { x: outward.y, y: -outward.x } }
}

/// The half-planes through `corner` along `direction`, moved out by the radius.
#[inline(always)]
fn widened<S: InstructionSet>(corner: Vec2s<S>, direction: Vec2s<S>, radius: F32s<S>) -> HalfPlanes<S> {
    let outward = Vec2s { x: -direction.y, y: direction.x };
    HalfPlanes { point: corner + outward * radius, direction }
}
