//! The linear program of collision avoidance: the permitted velocity nearest to the preferred one.
//!
//! Lines are taken one by one in the given order; a line that the best velocity so far violates moves it onto
//! that line. When no velocity satisfies all, the one that violates the lines of units least deeply is taken,
//! while those of obstacles stay hard.

use glam::Vec2;

use super::EPSILON;

/// The edge of a half-plane of permitted velocities: what lies to the left of it is permitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Line {
    pub point: Vec2,
    /// Of length 1.
    pub direction: Vec2,
}

impl Line {
    /// How far on the wrong side of the line a velocity is; negative if it is permitted.
    fn depth(&self, velocity: Vec2) -> f32 {
        self.direction.perp_dot(self.point - velocity)
    }
}

/// What is looked for among the permitted velocities.
#[derive(Clone, Copy)]
enum Aim {
    Nearest(Vec2),
    /// The farthest in a direction of length 1.
    Farthest(Vec2),
}

/// The velocity within `max_speed` nearest to `preferred` that the lines permit, the first `n_hard` at any price.
///
/// `projected` is working memory.
pub(super) fn solve(
    lines: &[Line],
    n_hard: usize,
    max_speed: f32,
    preferred: Vec2,
    projected: &mut Vec<Line>,
) -> Vec2 {
    match optimum(lines, max_speed, Aim::Nearest(preferred)) {
        Ok(velocity) => velocity,
        Err(failed) => least_deep(lines, n_hard, failed, max_speed, projected),
    }
}

/// The velocity nearest to the preferred one that is not too fast.
pub(super) fn within(max_speed: f32, preferred: Vec2) -> Vec2 {
    if preferred.length_squared() > max_speed * max_speed { unit(preferred) * max_speed } else { preferred }
}

/// A line on which no velocity satisfies it and all lines before it, and the best velocity without it.
struct Infeasible {
    line: usize,
    velocity: Vec2,
}

fn optimum(lines: &[Line], max_speed: f32, aim: Aim) -> Result<Vec2, Infeasible> {
    let mut velocity = match aim {
        Aim::Farthest(direction) => direction * max_speed,
        Aim::Nearest(preferred) => within(max_speed, preferred),
    };
    for (i, line) in lines.iter().enumerate() {
        if line.depth(velocity) > 0.0 {
            match optimum_on(line, &lines[..i], max_speed, aim) {
                Some(better) => velocity = better,
                None => return Err(Infeasible { line: i, velocity }),
            }
        }
    }
    Ok(velocity)
}

/// The best velocity on a line that satisfies all `earlier` ones.
fn optimum_on(line: &Line, earlier: &[Line], max_speed: f32, aim: Aim) -> Option<Vec2> {
    let along = line.point.dot(line.direction);
    let discriminant = along * along + max_speed * max_speed - line.point.length_squared();
    if discriminant < 0.0 {
        return None; // all of the line is too fast
    }
    let root = discriminant.sqrt();
    let (mut from, mut to) = (-along - root, -along + root);
    for other in earlier {
        let denominator = line.direction.perp_dot(other.direction);
        let numerator = other.direction.perp_dot(line.point - other.point);
        if denominator.abs() <= EPSILON {
            if numerator < 0.0 {
                return None;
            }
            continue;
        }
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
    let at = match aim {
        Aim::Farthest(direction) if direction.dot(line.direction) > 0.0 => to,
        Aim::Farthest(_) => from,
        Aim::Nearest(preferred) => {
            let nearest = line.direction.dot(preferred - line.point);
            if nearest < from {
                from
            } else if nearest > to {
                to
            } else {
                nearest
            }
        }
    };
    Some(line.point + at * line.direction)
}

/// The velocity whose deepest violation of the lines from `n_hard` on is least, begun where `optimum` failed.
fn least_deep(
    lines: &[Line],
    n_hard: usize,
    failed: Infeasible,
    max_speed: f32,
    projected: &mut Vec<Line>,
) -> Vec2 {
    let Infeasible { line: first, mut velocity } = failed;
    let mut deepest = 0.0;
    for (i, line) in lines.iter().enumerate().skip(first) {
        if line.depth(velocity) > deepest {
            projected.clear();
            projected.extend_from_slice(&lines[..n_hard]);
            // An obstacle's line may be the one that failed; then no unit's line comes before it.
            let before = lines.get(n_hard..i).unwrap_or_default();
            projected.extend(before.iter().filter_map(|other| equally_deep(line, other)));
            let inward = Vec2::new(-line.direction.y, line.direction.x);
            // Failing here is a matter of rounding: the velocity so far lies within.
            if let Ok(better) = optimum(projected, max_speed, Aim::Farthest(inward)) {
                velocity = better;
            }
            deepest = line.depth(velocity);
        }
    }
    velocity
}

/// The line of velocities that violate both lines equally deeply; `None` if they face the same way.
fn equally_deep(line: &Line, other: &Line) -> Option<Line> {
    let determinant = line.direction.perp_dot(other.direction);
    let point = if determinant.abs() <= EPSILON {
        if line.direction.dot(other.direction) > 0.0 {
            return None;
        }
        0.5 * (line.point + other.point)
    } else {
        let at = other.direction.perp_dot(line.point - other.point) / determinant;
        line.point + at * line.direction
    };
    Some(Line { point, direction: unit(other.direction - line.direction) })
}

/// A vector scaled to length 1, by the rounded reciprocal of its length.
pub(super) fn unit(vector: Vec2) -> Vec2 {
    vector * (1.0 / vector.length())
}
