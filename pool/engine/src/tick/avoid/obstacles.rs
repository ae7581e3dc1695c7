//! The half-planes that obstacle edges impose on ground units, and the search for edges.

use glam::Vec2;

use super::linear_program::{HalfPlane, normalize};
use super::nearest_list::NearestList;
use super::{EPSILON, Mover};
use crate::arena::{Arena, Edge, left_of};

/// The half-planes of the obstacles that `mover` sees; `searched` and `found` are working memory.
pub(super) fn half_planes(
    arena: &Arena,
    mover: &Mover,
    searched: &mut Vec<u32>,
    found: &mut NearestList,
    half_planes: &mut Vec<HalfPlane>,
) {
    let Some(range) = mover.stats.edge_range_squared else { return };
    let near = arena.edges.near(mover.position, searched);
    find(arena, mover, near, range, found);
    for index in found.indices() {
        if let Some(half_plane) = half_plane(mover, arena.edges.edge(near[index]), half_planes) {
            half_planes.push(half_plane);
        }
    }
}

/// Finds the edges of a list that `mover` sees, nearest first.
fn find(arena: &Arena, mover: &Mover, near: &[u32], range: f32, found: &mut NearestList) {
    found.clear();
    for (index, &number) in near.iter().enumerate() {
        let edge = arena.edges.edge(number);
        if left_of(edge.start, edge.end, mover.position) < 0.0 {
            let distance_squared = distance_squared(edge, mover.position);
            if distance_squared < range {
                found.insert(distance_squared, index);
            }
        }
    }
}

fn distance_squared(edge: &Edge, point: Vec2) -> f32 {
    let span = edge.end - edge.start;
    let share = (point - edge.start).dot(span) / span.length_squared();
    let nearest = if share < 0.0 {
        edge.start
    } else if share > 1.0 {
        edge.end
    } else {
        edge.start + share * span
    };
    (point - nearest).length_squared()
}

/// One end of what bounds the view of an obstacle: a corner, and the outline's directions into and out of it.
#[derive(Clone, Copy)]
struct Corner {
    /// Seen from the unit.
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

/// What of an edge bounds the velocity obstacle: both its corners, or one that hides the rest.
enum View {
    Whole { left: Corner, right: Corner },
    Only(Corner),
}

/// The velocities that keep `mover` off the edge for the time horizon; `None` if the edge asks for nothing
/// that other half-planes do not ask for already.
fn half_plane(mover: &Mover, edge: &Edge, earlier: &[HalfPlane]) -> Option<HalfPlane> {
    let radius = mover.stats.radius;
    let start = Corner::start_of(edge, mover.position);
    let end = Corner::end_of(edge, mover.position);
    if earlier
        .iter()
        .any(|half_plane| covers(half_plane, start.offset, radius) && covers(half_plane, end.offset, radius))
    {
        return None;
    }
    let radius_squared = radius * radius;
    let span = edge.end - edge.start;
    let share = (-start.offset).dot(span) / span.length_squared();
    let touches_line = (-start.offset - share * span).length_squared() <= radius_squared;

    if share < 0.0 && start.offset.length_squared() <= radius_squared {
        return Some(away_from(start.offset));
    } else if share > 1.0 && end.offset.length_squared() <= radius_squared {
        // Where the next edge is in view it takes care of this corner.
        return (end.offset.perp_dot(edge.after) >= 0.0).then(|| away_from(end.offset));
    } else if (0.0..1.0).contains(&share) && touches_line {
        return Some(HalfPlane { point: Vec2::ZERO, direction: -edge.along });
    }

    let view = if share < 0.0 && touches_line {
        View::Only(start)
    } else if share > 1.0 && touches_line {
        View::Only(end)
    } else {
        View::Whole { left: start, right: end }
    };
    Shadow::cast(&view, radius).half_plane(mover.velocity, radius)
}

/// Whether the half-plane already keeps the unit off this point of an obstacle.
fn covers(half_plane: &HalfPlane, offset: Vec2, radius: f32) -> bool {
    (offset - half_plane.point).perp_dot(half_plane.direction) - radius >= -EPSILON
}

/// The direction of the left tangent from a unit to a disc of radius `reach` at `offset`; `leg` is its
/// length.
fn left_leg(offset: Vec2, leg: f32, reach: f32, distance_squared: f32) -> Vec2 {
    Vec2::new(offset.x * leg - offset.y * reach, offset.x * reach + offset.y * leg) * (1.0 / distance_squared)
}

/// The direction of the right tangent.
fn right_leg(offset: Vec2, leg: f32, reach: f32, distance_squared: f32) -> Vec2 {
    Vec2::new(offset.x * leg + offset.y * reach, -offset.x * reach + offset.y * leg)
        * (1.0 / distance_squared)
}

/// The half-plane of a unit that touches a corner: not a step closer.
fn away_from(corner: Vec2) -> HalfPlane {
    HalfPlane { point: Vec2::ZERO, direction: normalize(Vec2::new(-corner.y, corner.x)) }
}

/// The velocity obstacle of an edge: two legs, and between them the edge itself, all widened by the radius.
struct Shadow {
    left: Leg,
    right: Leg,
    /// Direction of the outline at the left corner.
    along: Vec2,
    /// Whether both legs start at one corner.
    single: bool,
}

struct Leg {
    corner: Vec2,
    direction: Vec2,
    /// Whether the neighbouring edge bounds the shadow instead; then that edge brings the half-plane.
    foreign: bool,
}

impl Shadow {
    fn cast(view: &View, radius: f32) -> Shadow {
        let (left, right, single) = match view {
            View::Whole { left, right } => (left, right, false),
            View::Only(corner) => (corner, corner, true),
        };
        let tangent = |corner: &Corner| {
            let distance_squared = corner.offset.length_squared();
            ((distance_squared - radius * radius).sqrt(), distance_squared)
        };
        let (left_length, left_squared) = tangent(left);
        let (right_length, right_squared) = tangent(right);
        Shadow {
            left: Leg::left(left, left_leg(left.offset, left_length, radius, left_squared)),
            right: Leg::right(right, right_leg(right.offset, right_length, radius, right_squared)),
            along: left.outgoing,
            single,
        }
    }

    /// The half-plane at the point of the shadow's boundary nearest to the velocity.
    fn half_plane(&self, velocity: Vec2, radius: f32) -> Option<HalfPlane> {
        let Shadow { left, right, .. } = self;
        let cutoff = right.corner - left.corner;
        let share =
            if self.single { 0.5 } else { (velocity - left.corner).dot(cutoff) / cutoff.length_squared() };
        let on_left = (velocity - left.corner).dot(left.direction);
        let on_right = (velocity - right.corner).dot(right.direction);
        if share < 0.0 && on_left < 0.0 || self.single && on_left < 0.0 && on_right < 0.0 {
            return Some(round_corner(left.corner, velocity, radius));
        } else if share > 1.0 && on_right < 0.0 {
            return Some(round_corner(right.corner, velocity, radius));
        }

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
            (!left.foreign).then(|| widened(left.corner, left.direction, radius))
        } else {
            (!right.foreign).then(|| widened(right.corner, -right.direction, radius))
        }
    }
}

impl Leg {
    /// A leg never points into the edge next to it; that edge takes its place.
    fn left(corner: &Corner, direction: Vec2) -> Leg {
        let foreign = direction.perp_dot(-corner.incoming) >= 0.0;
        Leg { corner: corner.offset, direction: if foreign { -corner.incoming } else { direction }, foreign }
    }

    fn right(corner: &Corner, direction: Vec2) -> Leg {
        let foreign = direction.perp_dot(corner.outgoing) <= 0.0;
        Leg { corner: corner.offset, direction: if foreign { corner.outgoing } else { direction }, foreign }
    }

    /// From a velocity whose projection on the leg is `at`.
    fn distance_squared(&self, velocity: Vec2, at: f32) -> f32 {
        if at < 0.0 {
            f32::INFINITY
        } else {
            (velocity - (self.corner + at * self.direction)).length_squared()
        }
    }
}

/// The tangent of the disc around a corner at the side of the velocity.
fn round_corner(corner: Vec2, velocity: Vec2, radius: f32) -> HalfPlane {
    let outward = normalize(velocity - corner);
    HalfPlane { point: corner + radius * outward, direction: Vec2::new(outward.y, -outward.x) }
}

/// The half-plane through `corner` along `direction`, moved out by the radius.
fn widened(corner: Vec2, direction: Vec2, radius: f32) -> HalfPlane {
    HalfPlane { point: corner + radius * Vec2::new(-direction.y, direction.x), direction }
}
