//! Phase 3, collision avoidance: turns preferred velocities into actual ones by ORCA (van den Berg et al.,
//! "Reciprocal n-body collision avoidance").
//!
//! Every moving unit collects half-planes of permitted velocities, first from obstacle edges (`obstacles`), then
//! from neighbouring units (`neighbours`), and takes the permitted velocity nearest to the preferred one
//! (`program`). All plan against the same frozen positions and velocities; then all velocities change at once.
//!
//! All arithmetic is in f32 and a vector is divided by multiplying with the rounded reciprocal: the recorded
//! battles depend on it to the last bit. The time horizon is 1 s, for units and for obstacles, and so appears
//! nowhere.

mod neighbours;
mod obstacles;
mod program;
mod tree;

use glam::Vec2;

use super::World;
use crate::arena::AvoidKind;
use neighbours::Neighbour;
use program::Line;
use tree::Tree;

/// Two directions whose cross product is this small count as parallel; also the tolerance for covered edges.
const EPSILON: f32 = 1e-5;

/// Working memory of collision avoidance.
#[derive(Debug, Default)]
pub(crate) struct Memory {
    /// The living units of each plane.
    planes: [Tree; 3],
    /// Squared distance and number of edges or units in sight, nearest first.
    found: Vec<(f32, u32)>,
    lines: Vec<Line>,
    projected: Vec<Line>,
}

/// A unit that looks for a velocity.
struct Mover {
    position: Vec2,
    velocity: Vec2,
    preferred: Vec2,
    kind: AvoidKind,
}

/// Sets the velocity of every living unit.
pub(super) fn plan_velocities(world: &mut World) {
    let mut memory = std::mem::take(&mut world.plan.avoid);
    grow_trees(world, &mut memory.planes);
    for &id in &world.living.all {
        let i = id as usize;
        // A unit that wants to stay, stays, and computes nothing: so others can be blocked and surrounded.
        world.plan.velocity[i] = if world.plan.preferred[i] == Vec2::ZERO {
            Vec2::ZERO
        } else {
            permitted_velocity(world, id, &mut memory)
        };
    }
    for &id in &world.living.all {
        world.units.vel[id as usize] = world.plan.velocity[id as usize];
    }
    world.plan.avoid = memory;
}

fn grow_trees(world: &World, planes: &mut [Tree; 3]) {
    planes.iter_mut().for_each(Tree::clear);
    for &id in &world.living.all {
        planes[world.arena.kind(id).plane as usize].push(world.units.pos[id as usize], id);
    }
    planes.iter_mut().for_each(Tree::grow);
}

fn permitted_velocity(world: &World, id: u32, memory: &mut Memory) -> Vec2 {
    let Memory { planes, found, lines, projected } = memory;
    let i = id as usize;
    let kind = world.arena.kind(id);
    let mover = Mover {
        position: world.units.pos[i],
        velocity: world.units.vel[i],
        preferred: world.plan.preferred[i],
        kind: kind.avoid,
    };
    lines.clear();
    obstacles::find(world.arena, &mover, found);
    for &(_, number) in found.iter() {
        if let Some(line) = obstacles::line(&mover, world.arena.edges.edge(number), lines) {
            lines.push(line);
        }
    }
    let n_hard = lines.len();
    planes[kind.plane as usize].find(mover.position, mover.kind.neighbour_range_squared, id, found);
    lines.extend(found.iter().map(|&(_, other)| neighbours::line(&mover, &Neighbour::of(world, other))));

    let velocity = program::solve(lines, n_hard, mover.kind.max_speed, mover.preferred, projected);
    // Two units in one spot have no direction to part in; whatever comes of that, nobody leaves the plane.
    if velocity.is_finite() { velocity } else { Vec2::ZERO }
}

/// Inserts what was found at a distance, behind all that is as near.
fn insert_sorted(found: &mut Vec<(f32, u32)>, distance_squared: f32, what: u32) {
    let nearer = found.iter().rev().take_while(|(other, _)| distance_squared < *other).count();
    found.insert(found.len() - nearer, (distance_squared, what));
}
