//! Begin reading here: the linear program of one unit, as the module above describes it. That module solves
//! the programs of many units at a time, and its tests compare the bits with these.

use glam::Vec2;

use super::super::EPSILON;
use super::{HalfPlane, normalize};

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
pub(in super::super) fn solve(
    half_planes: &[HalfPlane],
    n_hard: usize,
    max_speed: f32,
    preferred: Vec2,
) -> Vec2 {
    match best_velocity(half_planes, max_speed, Aim::Nearest(preferred)) {
        Ok(velocity) => velocity,
        Err(failed) => least_violation(half_planes, n_hard, failed, max_speed),
    }
}

/// The velocity nearest to the preferred one that is not too fast.
fn within(max_speed: f32, preferred: Vec2) -> Vec2 {
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

/// The best velocity on the boundary of a half-plane that satisfies all `earlier` ones: a point
/// `point + t direction`.
fn best_on_boundary(half_plane: &HalfPlane, earlier: &[HalfPlane], max_speed: f32, aim: Aim) -> Option<Vec2> {
    let (from, to) = permitted_interval(half_plane, earlier, max_speed)?;
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

/// The interval of t that is permitted on the boundary of a half-plane, if any. The speed limit leaves what
/// is between the roots of |point + t direction|^2 = max_speed^2; each earlier half-plane raises the begin of
/// the interval or lowers its end.
fn permitted_interval(half_plane: &HalfPlane, earlier: &[HalfPlane], max_speed: f32) -> Option<(f32, f32)> {
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
    Some((from, to))
}

/// The velocity whose worst violation of the half-planes from `n_hard` on is least, from where
/// `best_velocity` failed.
fn least_violation(half_planes: &[HalfPlane], n_hard: usize, failed: Infeasible, max_speed: f32) -> Vec2 {
    let Infeasible { half_plane: first, mut velocity } = failed;
    // `worst` is the violation so far by the half-planes before i. One that is violated more must be among
    // the most violated of the solution; there it and some earlier one are violated equally.
    let mut worst = 0.0;
    for (i, half_plane) in half_planes.iter().enumerate().skip(first) {
        if half_plane.violation(velocity) > worst {
            let mut projected = half_planes[..n_hard].to_vec();
            // Half-planes of obstacles come first. If one of them failed, there are none of units before it.
            let before = half_planes.get(n_hard..i).unwrap_or_default();
            projected.extend(before.iter().filter_map(|other| equal_violation(half_plane, other)));
            let inward = Vec2::new(-half_plane.direction.y, half_plane.direction.x);
            // This is feasible up to rounding, because the velocity so far is a solution. If rounding makes
            // it fail, that velocity stays.
            if let Ok(better) = best_velocity(&projected, max_speed, Aim::Farthest(inward)) {
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
