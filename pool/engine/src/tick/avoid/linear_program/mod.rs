//! The linear program of collision avoidance: the permitted velocity nearest to the preferred one.
//!
//! The permitted velocities are a disc (the speed limit) cut by half-planes, a convex set. The algorithm is
//! the incremental one of the paper (de Berg et al., "Computational Geometry", chapter 4): half-planes are
//! added in the given order, and the best velocity so far is kept. A half-plane that it violates moves it:
//! then the new best velocity lies on the boundary of that half-plane, where every earlier half-plane cuts
//! off a ray, so what remains is an interval (a one-dimensional program). An empty interval means that no
//! velocity satisfies all.
//!
//! In that case the half-planes of units are relaxed (the paper's "Densely Packed Conditions"): all their
//! boundaries move outwards at equal speed until a velocity exists. That is a program in three dimensions,
//! solved with the same method: while the worst violation is that of half-plane i, the solution lies where i
//! and some earlier j are violated equally, which is a boundary again; among those it is the velocity
//! farthest inside i. Half-planes of obstacles are never relaxed.
//!
//! `x4` solves four such programs at a time.

pub(super) mod x4;

use glam::Vec2;

use super::EPSILON;

/// A half-plane of permitted velocities, by its boundary: velocities to the left of it are permitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct HalfPlane {
    pub point: Vec2,
    /// Of length 1.
    pub direction: Vec2,
}

impl HalfPlane {
    /// How far a velocity is on the wrong side of the boundary; negative if it is permitted.
    fn violation(&self, velocity: Vec2) -> f32 {
        self.direction.perp_dot(self.point - velocity)
    }
}

/// The objective: which of the permitted velocities is best.
#[derive(Clone, Copy)]
enum Aim {
    Nearest(Vec2),
    /// The farthest in a direction of length 1.
    Farthest(Vec2),
}

/// The velocity within `max_speed` nearest to `preferred` that the half-planes permit; the first `n_hard` are
/// never relaxed.
///
/// `projected` is working memory.
pub(super) fn solve(
    half_planes: &[HalfPlane],
    n_hard: usize,
    max_speed: f32,
    preferred: Vec2,
    projected: &mut Vec<HalfPlane>,
) -> Vec2 {
    match best_velocity(half_planes, max_speed, Aim::Nearest(preferred)) {
        Ok(velocity) => velocity,
        Err(failed) => least_violation(half_planes, n_hard, failed, max_speed, projected),
    }
}

/// The velocity nearest to the preferred one that is not too fast.
pub(super) fn within(max_speed: f32, preferred: Vec2) -> Vec2 {
    if preferred.length_squared() > max_speed * max_speed {
        normalize(preferred) * max_speed
    } else {
        preferred
    }
}

/// The first half-plane that cannot be satisfied together with all before it, and the best velocity without
/// it.
struct Infeasible {
    half_plane: usize,
    velocity: Vec2,
}

fn best_velocity(half_planes: &[HalfPlane], max_speed: f32, aim: Aim) -> Result<Vec2, Infeasible> {
    // Without half-planes the disc of the speed limit decides alone.
    let mut velocity = match aim {
        Aim::Farthest(direction) => direction * max_speed,
        Aim::Nearest(preferred) => within(max_speed, preferred),
    };
    for (i, half_plane) in half_planes.iter().enumerate() {
        // A half-plane that the best velocity so far satisfies changes nothing. Otherwise the new best
        // velocity is on its boundary: on the way from any permitted velocity to the old best one the
        // objective improves, so it improves up to the boundary.
        if half_plane.violation(velocity) > 0.0 {
            match best_on_boundary(half_plane, &half_planes[..i], max_speed, aim) {
                Some(better) => velocity = better,
                None => return Err(Infeasible { half_plane: i, velocity }),
            }
        }
    }
    Ok(velocity)
}

/// The best velocity on the boundary of a half-plane that satisfies all `earlier` ones.
///
/// A point of the boundary is `point + t direction`. The speed limit leaves an interval of t, from the roots
/// of
/// |point + t direction|^2 = max_speed^2; each earlier half-plane raises its begin or lowers its end.
fn best_on_boundary(half_plane: &HalfPlane, earlier: &[HalfPlane], max_speed: f32, aim: Aim) -> Option<Vec2> {
    // With |direction| = 1 the quadratic equation is t^2 + 2 t along + |point|^2 - max_speed^2 = 0.
    let along = half_plane.point.dot(half_plane.direction);
    let discriminant = along * along + max_speed * max_speed - half_plane.point.length_squared();
    if discriminant < 0.0 {
        return None; // every point of the boundary is too fast
    }
    let root = discriminant.sqrt();
    let (mut from, mut to) = (-along - root, -along + root);
    for other in earlier {
        // The boundaries cross where other.direction x (point + t direction - other.point) = 0, x being the
        // cross product.
        let denominator = half_plane.direction.perp_dot(other.direction);
        let numerator = other.direction.perp_dot(half_plane.point - other.point);
        if denominator.abs() <= EPSILON {
            // Parallel boundaries: the other half-plane contains this boundary entirely or not at all.
            if numerator < 0.0 {
                return None;
            }
            continue;
        }
        // The sign of the denominator says whether the boundary leaves or enters the other half-plane there.
        let crossing = numerator / denominator;
        if denominator >= 0.0 {
            to = if crossing < to { crossing } else { to };
        } else {
            from = if from < crossing { crossing } else { from };
        }
        if from > to {
            return None;
        }
    }
    // On a line both objectives have a best point: one of the ends of the interval, or the projection of the
    // preferred velocity, clamped to the interval.
    let at = match aim {
        Aim::Farthest(direction) if direction.dot(half_plane.direction) > 0.0 => to,
        Aim::Farthest(_) => from,
        Aim::Nearest(preferred) => {
            let nearest = half_plane.direction.dot(preferred - half_plane.point);
            if nearest < from {
                from
            } else if nearest > to {
                to
            } else {
                nearest
            }
        }
    };
    Some(half_plane.point + at * half_plane.direction)
}

/// The velocity whose worst violation of the half-planes from `n_hard` on is least, from where
/// `best_velocity` failed.
fn least_violation(
    half_planes: &[HalfPlane],
    n_hard: usize,
    failed: Infeasible,
    max_speed: f32,
    projected: &mut Vec<HalfPlane>,
) -> Vec2 {
    let Infeasible { half_plane: first, mut velocity } = failed;
    // `worst` is the violation so far by the half-planes before i. One that is violated more must be among
    // the most violated of the solution; there it and some earlier one are violated equally.
    let mut worst = 0.0;
    for (i, half_plane) in half_planes.iter().enumerate().skip(first) {
        if half_plane.violation(velocity) > worst {
            projected.clear();
            projected.extend_from_slice(&half_planes[..n_hard]);
            // Half-planes of obstacles come first. If one of them failed, there are none of units before it.
            let before = half_planes.get(n_hard..i).unwrap_or_default();
            projected.extend(before.iter().filter_map(|other| equal_violation(half_plane, other)));
            let inward = Vec2::new(-half_plane.direction.y, half_plane.direction.x);
            // This is feasible up to rounding, because the velocity so far is a solution. If rounding makes
            // it fail, that velocity stays.
            if let Ok(better) = best_velocity(projected, max_speed, Aim::Farthest(inward)) {
                velocity = better;
            }
            worst = half_plane.violation(velocity);
        }
    }
    velocity
}

/// The half-plane whose boundary violates both half-planes equally; `None` if they face the same way.
fn equal_violation(half_plane: &HalfPlane, other: &HalfPlane) -> Option<HalfPlane> {
    // Two lines have equal distances along the bisector of their angle: it passes through their crossing, in
    // the direction of the difference of the two directions. If they are parallel it is the line in the
    // middle.
    let determinant = half_plane.direction.perp_dot(other.direction);
    let point = if determinant.abs() <= EPSILON {
        if half_plane.direction.dot(other.direction) > 0.0 {
            return None;
        }
        0.5 * (half_plane.point + other.point)
    } else {
        let at = other.direction.perp_dot(half_plane.point - other.point) / determinant;
        half_plane.point + at * half_plane.direction
    };
    Some(HalfPlane { point, direction: normalize(other.direction - half_plane.direction) })
}

/// A vector scaled to length 1, by the rounded reciprocal of its length.
pub(super) fn normalize(vector: Vec2) -> Vec2 {
    vector * (1.0 / vector.length())
}
