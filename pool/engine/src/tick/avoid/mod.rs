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

mod found;
mod neighbours;
mod obstacles;
mod program;
mod tree;

use glam::Vec2;

use super::World;
use crate::arena::AvoidKind;
use found::Found;
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
    /// What others know of each unit, by battle-wide id; stale for the dead.
    neighbours: Vec<Neighbour>,
    /// Edges or units in sight.
    found: Found,
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
    memory.take_down(world);
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

impl Memory {
    /// Takes down where all living units are and what they do.
    fn take_down(&mut self, world: &World) {
        self.planes.iter_mut().for_each(Tree::clear);
        self.neighbours.resize(world.units.pos.len(), Neighbour::default());
        for &id in &world.living.all {
            let neighbour = Neighbour::of(world, id);
            self.planes[world.arena.kind(id).plane as usize].push(neighbour.position, id);
            self.neighbours[id as usize] = neighbour;
        }
        self.planes.iter_mut().for_each(Tree::grow);
    }
}

fn permitted_velocity(world: &World, id: u32, memory: &mut Memory) -> Vec2 {
    let Memory { planes, neighbours, found, lines, projected } = memory;
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
    for number in found.nearest_first() {
        if let Some(line) = obstacles::line(&mover, world.arena.edges.edge(number), lines) {
            lines.push(line);
        }
    }
    let n_hard = lines.len();
    planes[kind.plane as usize].find(mover.position, mover.kind.neighbour_range_squared, id, found);
    lines.extend(found.nearest_first().map(|other| neighbours::line(&mover, &neighbours[other as usize])));

    let velocity = program::solve(lines, n_hard, mover.kind.max_speed, mover.preferred, projected);
    // Two units in one spot have no direction to part in; whatever comes of that, nobody leaves the plane.
    if velocity.is_finite() { velocity } else { Vec2::ZERO }
}
