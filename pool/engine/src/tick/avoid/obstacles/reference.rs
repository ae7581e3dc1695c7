//! Begin reading here: the half-planes that edges impose on one unit, as the module above derives them. That
//! module computes them for many units at a time, and its tests compare the bits with these.

use glam::Vec2;

use super::super::EPSILON;
use super::super::linear_program::{HalfPlane, normalize};
use crate::arena::Edge;

/// A unit whose velocity is planned.
pub(super) struct Mover {
    pub position: Vec2,
    pub velocity: Vec2,
    pub radius: f32,
}

/// The squared distance of an edge, if a unit sees it.
pub(super) fn sees(edge: &Edge, position: Vec2, range_squared: f32) -> Option<f32> {
    let span = edge.end - edge.start;
    let share = (position - edge.start).dot(span) / span.length_squared();
    let nearest = if share < 0.0 {
        edge.start
    } else if share > 1.0 {
        edge.end
    } else {
        edge.start + share * span
    };
    let distance_squared = (position - nearest).length_squared();
    let is_outside = (edge.start - position).perp_dot(span) < 0.0;
    (is_outside && distance_squared < range_squared).then_some(distance_squared)
}

/// A corner of an obstacle, and the directions of the outline before and after it.
#[derive(Clone, Copy)]
struct Corner {
    /// Position relative to the unit.
    offset: Vec2,
    incoming: Vec2,
    outgoing: Vec2,
}

impl Corner {
    fn start_of(edge: &Edge, position: Vec2) -> Corner {
        Corner { offset: edge.start - position, incoming: edge.before, outgoing: edge.along }
    }

    fn end_of(edge: &Edge, position: Vec2) -> Corner {
        Corner { offset: edge.end - position, incoming: edge.along, outgoing: edge.after }
    }
}

/// Where the legs begin: at both corners of an edge, or at one that hides the other.
enum LegCorners {
    Both { left: Corner, right: Corner },
    One(Corner),
}

/// The velocities that keep `mover` off the edge for the time horizon; `None` if other half-planes ensure
/// that.
pub(super) fn half_plane(mover: &Mover, edge: &Edge, earlier: &[HalfPlane]) -> Option<HalfPlane> {
    let radius = mover.radius;
    let start = Corner::start_of(edge, mover.position);
    let end = Corner::end_of(edge, mover.position);
    if earlier
        .iter()
        .any(|half_plane| covers(half_plane, start.offset, radius) && covers(half_plane, end.offset, radius))
    {
        return None;
    }
    // The position of the unit projected on the line of the edge, as a share of the edge.
    let radius_squared = radius * radius;
    let span = edge.end - edge.start;
    let share = (-start.offset).dot(span) / span.length_squared();
    let touches_line = (-start.offset - share * span).length_squared() <= radius_squared;

    // The unit touches the obstacle already, at a corner or along the edge. Then the velocity obstacle is a
    // half-plane, of which the boundary passes through velocity zero: do not come closer.
    if share < 0.0 && start.offset.length_squared() <= radius_squared {
        return Some(away_from(start.offset));
    } else if share > 1.0 && end.offset.length_squared() <= radius_squared {
        // If the next edge is in view too, it is the one that keeps the unit off this corner.
        return (end.offset.perp_dot(edge.after) >= 0.0).then(|| away_from(end.offset));
    } else if (0.0..1.0).contains(&share) && touches_line {
        return Some(HalfPlane { point: Vec2::ZERO, direction: -edge.along });
    }

    // A unit beside the edge and close to its line sees the edge end-on: both legs begin at the nearer
    // corner.
    let corners = if share < 0.0 && touches_line {
        LegCorners::One(start)
    } else if share > 1.0 && touches_line {
        LegCorners::One(end)
    } else {
        LegCorners::Both { left: start, right: end }
    };
    Boundary::new(&corners, radius).half_plane(mover.velocity, radius)
}

/// Whether the half-plane already keeps the unit off this point of an obstacle: whether all velocities that
/// reach the disc of the unit's radius around the point within 1 s are outside of it.
fn covers(half_plane: &HalfPlane, offset: Vec2, radius: f32) -> bool {
    (offset - half_plane.point).perp_dot(half_plane.direction) - radius >= -EPSILON
}

/// The direction of the left tangent from a unit to a disc of radius `reach` at `offset`; `leg` is its length
/// up to the disc. See `neighbours::leg_escape` for the derivation.
fn left_leg(offset: Vec2, leg: f32, reach: f32, distance_squared: f32) -> Vec2 {
    Vec2::new(offset.x * leg - offset.y * reach, offset.x * reach + offset.y * leg) * (1.0 / distance_squared)
}

/// The direction of the right tangent.
fn right_leg(offset: Vec2, leg: f32, reach: f32, distance_squared: f32) -> Vec2 {
    Vec2::new(offset.x * leg + offset.y * reach, -offset.x * reach + offset.y * leg)
        * (1.0 / distance_squared)
}

/// The half-plane of a unit that touches a corner: velocities that do not come closer.
fn away_from(corner: Vec2) -> HalfPlane {
    HalfPlane { point: Vec2::ZERO, direction: normalize(Vec2::new(-corner.y, corner.x)) }
}

/// The boundary of the velocity obstacle of an edge before it is widened by the radius: two legs, and the
/// cut-off line between them.
struct Boundary {
    left: Leg,
    right: Leg,
    /// Direction of the outline at the left corner.
    along: Vec2,
    /// Whether both legs start at one corner; then there is no cut-off line.
    single: bool,
}

struct Leg {
    corner: Vec2,
    direction: Vec2,
    /// Whether the adjacent edge replaces this leg.
    is_replaced: bool,
}

impl Boundary {
    fn new(corners: &LegCorners, radius: f32) -> Boundary {
        let (left, right, single) = match corners {
            LegCorners::Both { left, right } => (left, right, false),
            LegCorners::One(corner) => (corner, corner, true),
        };
        let tangent = |corner: &Corner| {
            let distance_squared = corner.offset.length_squared();
            ((distance_squared - radius * radius).sqrt(), distance_squared)
        };
        let (left_length, left_squared) = tangent(left);
        let (right_length, right_squared) = tangent(right);
        Boundary {
            left: Leg::left(left, left_leg(left.offset, left_length, radius, left_squared)),
            right: Leg::right(right, right_leg(right.offset, right_length, radius, right_squared)),
            along: left.outgoing,
            single,
        }
    }

    /// The half-plane at the point of the boundary nearest to the velocity.
    fn half_plane(&self, velocity: Vec2, radius: f32) -> Option<HalfPlane> {
        // Because the horizon is 1 s, a velocity is also the point that the unit reaches within the horizon,
        // and can be compared with the corners. Its projections decide which part of the boundary is nearest.
        let Boundary { left, right, .. } = self;
        let cutoff = right.corner - left.corner;
        let share =
            if self.single { 0.5 } else { (velocity - left.corner).dot(cutoff) / cutoff.length_squared() };
        let on_left = (velocity - left.corner).dot(left.direction);
        let on_right = (velocity - right.corner).dot(right.direction);
        // Behind the start of a leg and beside the cut-off: the nearest point is on the arc around the
        // corner.
        if share < 0.0 && on_left < 0.0 || self.single && on_left < 0.0 && on_right < 0.0 {
            return Some(round_corner(left.corner, velocity, radius));
        } else if share > 1.0 && on_right < 0.0 {
            return Some(round_corner(right.corner, velocity, radius));
        }

        // Otherwise it is on the nearest of the three lines, of those that the velocity projects onto. Of
        // equal distances the cut-off comes first, then the left leg.
        let to_cutoff = if self.single || !(0.0..=1.0).contains(&share) {
            f32::INFINITY
        } else {
            (velocity - (left.corner + share * cutoff)).length_squared()
        };
        let to_left = left.distance_squared(velocity, on_left);
        let to_right = right.distance_squared(velocity, on_right);
        if to_cutoff <= to_left && to_cutoff <= to_right {
            Some(widened(left.corner, -self.along, radius))
        } else if to_left <= to_right {
            // A replaced leg gives no half-plane: the adjacent edge gives one.
            (!left.is_replaced).then(|| widened(left.corner, left.direction, radius))
        } else {
            (!right.is_replaced).then(|| widened(right.corner, -right.direction, radius))
        }
    }
}

impl Leg {
    /// A leg that would point into the adjacent edge is replaced by the direction of that edge.
    fn left(corner: &Corner, direction: Vec2) -> Leg {
        let is_replaced = direction.perp_dot(-corner.incoming) >= 0.0;
        Leg {
            corner: corner.offset,
            direction: if is_replaced { -corner.incoming } else { direction },
            is_replaced,
        }
    }

    fn right(corner: &Corner, direction: Vec2) -> Leg {
        let is_replaced = direction.perp_dot(corner.outgoing) <= 0.0;
        Leg {
            corner: corner.offset,
            direction: if is_replaced { corner.outgoing } else { direction },
            is_replaced,
        }
    }

    /// The squared distance of a velocity whose projection on the leg is `at`; infinite before the leg
    /// starts.
    fn distance_squared(&self, velocity: Vec2, at: f32) -> f32 {
        if at < 0.0 {
            f32::INFINITY
        } else {
            (velocity - (self.corner + at * self.direction)).length_squared()
        }
    }
}

/// The half-plane at the arc around a corner: the tangent of the disc at the point nearest to the velocity.
fn round_corner(corner: Vec2, velocity: Vec2, radius: f32) -> HalfPlane {
    let outward = normalize(velocity - corner);
    HalfPlane { point: corner + radius * outward, direction: Vec2::new(outward.y, -outward.x) }
}

/// The half-plane through `corner` along `direction`, moved out by the radius.
fn widened(corner: Vec2, direction: Vec2, radius: f32) -> HalfPlane {
    HalfPlane { point: corner + radius * Vec2::new(-direction.y, direction.x), direction }
}
