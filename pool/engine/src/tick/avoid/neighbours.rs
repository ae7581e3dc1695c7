//! The half-planes that neighbouring units impose. Who is a neighbour is found in `tree`.

use glam::Vec2;

use super::program::Line;
use super::{Mover, World};
use crate::TICKS_PER_SECOND;

/// What a unit knows of one that it avoids.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Neighbour {
    pub position: Vec2,
    pub velocity: Vec2,
    pub radius: f32,
    /// Whether its preferred velocity is zero.
    pub stays: bool,
}

impl Neighbour {
    pub fn of(world: &World, id: u32) -> Neighbour {
        let i = id as usize;
        Neighbour {
            position: world.units.pos[i],
            velocity: world.units.vel[i],
            radius: world.arena.kind(id).avoid.radius,
            stays: world.plan.preferred[i] == Vec2::ZERO,
        }
    }
}

/// The velocities that keep `mover` off `neighbour` for the time horizon.
pub(super) fn line(mover: &Mover, neighbour: &Neighbour) -> Line {
    let offset = neighbour.position - mover.position;
    let relative = mover.velocity - neighbour.velocity;
    let reach = mover.kind.radius + neighbour.radius;
    let (direction, change) = if offset.length_squared() > reach * reach {
        least_change(offset, relative, reach)
    } else {
        // They overlap: be apart after this tick.
        let per_tick = TICKS_PER_SECOND as f32;
        off_the_disc(relative - per_tick * offset, reach * per_tick)
    };
    // A neighbour that stays where it is will not do its half.
    let share = if neighbour.stays { change } else { 0.5 * change };
    Line { point: mover.velocity + share, direction }
}

/// The least change of the relative velocity that leaves the velocity obstacle, a truncated cone, and the
/// direction of the cone's boundary there.
fn least_change(offset: Vec2, relative: Vec2, reach: f32) -> (Vec2, Vec2) {
    let from_tip = relative - offset;
    let towards = from_tip.dot(offset);
    if towards < 0.0 && towards * towards > reach * reach * from_tip.length_squared() {
        return off_the_disc(from_tip, reach);
    }
    let distance_squared = offset.length_squared();
    let leg = (distance_squared - reach * reach).sqrt();
    let direction = if offset.perp_dot(from_tip) > 0.0 {
        left_leg(offset, leg, reach, distance_squared)
    } else {
        -right_leg(offset, leg, reach, distance_squared)
    };
    (direction, relative.dot(direction) * direction - relative)
}

/// The same where the disc that truncates the cone is nearest; `from_centre` is the velocity seen from its centre.
fn off_the_disc(from_centre: Vec2, radius: f32) -> (Vec2, Vec2) {
    let length = from_centre.length();
    let outward = from_centre * (1.0 / length);
    (Vec2::new(outward.y, -outward.x), (radius - length) * outward)
}

/// The direction of the left tangent from a unit to a disc of radius `reach` at `offset`; `leg` is its length.
pub(super) fn left_leg(offset: Vec2, leg: f32, reach: f32, distance_squared: f32) -> Vec2 {
    Vec2::new(offset.x * leg - offset.y * reach, offset.x * reach + offset.y * leg) * (1.0 / distance_squared)
}

/// The direction of the right tangent.
pub(super) fn right_leg(offset: Vec2, leg: f32, reach: f32, distance_squared: f32) -> Vec2 {
    Vec2::new(offset.x * leg + offset.y * reach, -offset.x * reach + offset.y * leg)
        * (1.0 / distance_squared)
}
