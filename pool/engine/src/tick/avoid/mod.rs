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

mod crowd;
mod found;
mod neighbours;
mod obstacles;
mod program;
mod tree;

use glam::Vec2;

use super::World;
use crate::arena::{Arena, AvoidKind};
use crate::lanes::LANES;
use crate::units::make_room;
use crowd::{Crowd, Member};
use found::Found;
use program::Line;

/// Two directions whose cross product is this small count as parallel; also the tolerance for covered edges.
const EPSILON: f32 = 1e-5;

/// Working memory of collision avoidance.
#[derive(Debug, Default)]
pub(crate) struct Memory {
    /// The living units of each plane.
    planes: [Crowd; 3],
    search: Search,
}

impl Memory {
    /// Makes room for so many units, of which each sees so many edges at most.
    pub fn fit(&mut self, n_units: usize, n_edges: usize) {
        self.planes.iter_mut().for_each(|crowd| crowd.fit(n_units));
        self.search.found.fit(n_units.max(n_edges));
        for lines in [&mut self.search.lines, &mut self.search.projected] {
            // Lines of units are added four at a time.
            make_room(lines, n_edges + n_units.next_multiple_of(LANES));
        }
    }
}

/// Working memory for the velocity of one unit.
#[derive(Debug, Default)]
struct Search {
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
#[inline(never)] // so that profiles show it
pub(super) fn plan_velocities(world: &mut World) {
    take_down(world);
    let World { arena, units, plan, .. } = world;
    let Memory { planes, search } = &mut plan.avoid;
    for crowd in planes {
        for place in 0..crowd.members().len() {
            let id = crowd.members()[place].id;
            let preferred = plan.preferred[id as usize];
            // A unit that wants to stay, stays, and computes nothing: so others can be blocked and surrounded.
            units.vel[id as usize] = if preferred == Vec2::ZERO {
                Vec2::ZERO
            } else {
                permitted_velocity(arena, crowd, place, preferred, search)
            };
        }
    }
}

/// Takes down where all living units are and what they do.
fn take_down(world: &mut World) {
    let World { arena, units, living, plan } = world;
    let planes = &mut plan.avoid.planes;
    planes.iter_mut().for_each(Crowd::clear);
    for &id in &living.all {
        let (i, kind) = (id as usize, arena.kind(id));
        let stays = plan.preferred[i] == Vec2::ZERO;
        let member = Member::new(id, units.pos[i], units.vel[i], kind.avoid.radius, stays);
        planes[kind.plane as usize].push(member);
    }
    planes.iter_mut().for_each(Crowd::pack);
}

fn permitted_velocity(
    arena: &Arena,
    crowd: &mut Crowd,
    place: usize,
    preferred: Vec2,
    search: &mut Search,
) -> Vec2 {
    let Search { found, lines, projected } = search;
    let member = &crowd.members()[place];
    let kind = arena.kind(member.id).avoid;
    let mover = Mover { position: member.position(), velocity: member.velocity(), preferred, kind };

    lines.clear();
    obstacles::lines(arena, &mover, found, lines);
    let n_hard = lines.len();
    crowd.find(place, kind.neighbour_range_squared, found);
    neighbours::lines(&mover, crowd.members(), found.places(), lines);

    let velocity = program::solve(lines, n_hard, kind.max_speed, mover.preferred, projected);
    // Two units in one spot have no direction to part in; whatever comes of that, nobody leaves the plane.
    if velocity.is_finite() { velocity } else { Vec2::ZERO }
}
