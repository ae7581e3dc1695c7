//! Phase 3, collision avoidance: turns preferred velocities into actual ones by ORCA (van den Berg et al.,
//! "Reciprocal n-body collision avoidance").
//!
//! Every moving unit collects half-planes of permitted velocities, first from obstacle edges (`obstacles`), then
//! from neighbouring units (`neighbours`), and takes the permitted velocity nearest to the preferred one
//! (`program`). All plan against the same frozen positions and velocities; each unit takes its new velocity up in its
//! turn of phase 4.
//!
//! Most units meet a few others and no obstacle. Their velocities are found four at a time (`programs`), to the same
//! bits; [`Planner`] sorts out which those are.
//!
//! All arithmetic is in f32 and a vector is divided by multiplying with the rounded reciprocal: the recorded
//! battles depend on it to the last bit. The time horizon is 1 s, for units and for obstacles, and so appears
//! nowhere.

mod crowd;
mod found;
mod neighbours;
mod obstacles;
mod program;
mod programs;
mod tree;

use glam::Vec2;

use super::World;
use crate::arena::{Arena, AvoidKind};
use crate::lanes::{Floats, LANES, Vectors};
use crate::neighbour_order::PlaneOrder;
use crate::units::make_room;
use crowd::{Crowd, Few, Member, keep_last_if};
use found::Found;
use neighbours::FourLines;
use program::Line;
use programs::Programs;

/// Two directions whose cross product is this small count as parallel; also the tolerance for covered edges.
const EPSILON: f32 = 1e-5;

/// Working memory of collision avoidance.
#[derive(Debug, Default)]
pub(crate) struct Memory {
    /// The living units of each plane.
    planes: [Crowd; 3],
    accompanied: Vec<Accompanied>,
    impeded: Vec<Impeded>,
    search: Search,
}

impl Memory {
    /// Makes room for so many units, of which each sees so many edges at most.
    pub fn fit(&mut self, n_units: usize, n_edges: usize) {
        self.planes.iter_mut().for_each(|crowd| crowd.fit(n_units));
        make_room(&mut self.accompanied, n_units);
        make_room(&mut self.impeded, n_units);
        make_room(&mut self.search.near_edges, n_edges);
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
    /// Numbers of edges that may be in sight.
    near_edges: Vec<u32>,
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

/// A unit in sight of others.
#[derive(Clone, Copy, Debug)]
struct Accompanied {
    place: u32,
    neighbours: Few,
}

/// A unit that others keep from its preferred velocity.
#[derive(Clone, Copy, Debug)]
struct Impeded {
    place: u32,
    id: u32,
    /// The half-planes of its neighbours, and the squared distances they have; infinite where there are less than four.
    lines: FourLines,
    distances_squared: Floats,
    /// Preferred velocity, and that within the speed limit.
    wish: Floats,
    max_speed: f32,
}

/// Plans the velocity of every living unit.
///
/// One question after another is put to all units: who moves, who has neighbours, whom do they impede. Each makes a
/// shorter list for the next one. There is no foretelling the answers, so a processor that had to do with one unit
/// after another would spend its time with branches that it took in vain.
#[inline(never)] // so that profiles show it
pub(super) fn plan_velocities(world: &mut World) {
    take_down(world);
    let World { arena, units, plan, .. } = world;
    let Memory { planes, accompanied, impeded, search } = &mut plan.avoid;
    for crowd in planes.iter_mut().filter(|crowd| !crowd.movers().is_empty()) {
        let mut planner =
            Planner { arena, crowd, preferred: &plan.preferred, velocities: &mut units.planned_vel, search };
        planner.look_around(accompanied);
        planner.meet(accompanied, impeded);
        planner.give_way(impeded);
    }
}

/// Takes down where all living units are and what they do.
fn take_down(world: &mut World) {
    let World { arena, units, neighbour_order, plan, .. } = world;
    for (crowd, PlaneOrder { list, .. }) in plan.avoid.planes.iter_mut().zip(&mut neighbour_order.planes) {
        crowd.clear();
        crowd.sort(list, &units.pos);
        for &id in &*list {
            let i = id as usize;
            let Vec2 { x, y } = plan.preferred[i];
            let stays = (x == 0.0) & (y == 0.0);
            crowd.push(
                Member::new(id, units.pos[i], units.planned_vel[i], arena.kind(id).avoid.radius, stays),
                stays,
            );
            // A unit that wants to stay, stays, and computes nothing: so others can be blocked and surrounded.
            units.planned_vel[i] = plan.preferred[i];
        }
        if !crowd.movers().is_empty() {
            crowd.pack();
        }
    }
}

/// Finds the velocities of the units of a plane.
struct Planner<'a> {
    arena: &'a Arena,
    crowd: &'a mut Crowd,
    /// By battle-wide id, as the velocities.
    preferred: &'a [Vec2],
    velocities: &'a mut [Vec2],
    search: &'a mut Search,
}

impl Planner<'_> {
    fn mover(&self, place: usize) -> (usize, Mover) {
        let member = self.crowd.member(place);
        let (id, kind) = (member.id as usize, self.arena.kind(member.id).avoid);
        let (position, velocity) = (member.position(), member.velocity());
        (id, Mover { position, velocity, preferred: self.preferred[id], kind })
    }

    /// Gives every unit that moves its preferred velocity, and finds those that are in sight of others. Those in sight
    /// of obstacles, or in a large crowd, are done with at once.
    fn look_around(&mut self, accompanied: &mut Vec<Accompanied>) {
        accompanied.clear();
        for i in 0..self.crowd.movers().len() {
            let place = self.crowd.movers()[i] as usize;
            let (id, mover) = self.mover(place);
            let Search { near_edges, found, lines, .. } = &mut *self.search;
            lines.clear();
            obstacles::lines(self.arena, &mover, near_edges, found, lines);
            if !lines.is_empty() || !self.crowd.is_small() {
                self.avoid_all(place);
                continue;
            }
            self.velocities[id] = valid(program::within(mover.kind.max_speed, mover.preferred));
            let neighbours = self.crowd.near(place, mover.kind.neighbour_range_squared);
            accompanied.push(Accompanied { place: place as u32, neighbours });
            keep_last_if(neighbours.is_any(), accompanied);
        }
    }

    /// Works out the half-planes of those with up to four neighbours, and finds those whose velocity they do not permit.
    fn meet(&mut self, accompanied: &[Accompanied], impeded: &mut Vec<Impeded>) {
        impeded.clear();
        for &Accompanied { place, neighbours } in accompanied {
            let Some(four) = self.crowd.four(neighbours) else {
                self.search.lines.clear();
                self.avoid_all(place as usize);
                continue;
            };
            let (id, mover) = self.mover(place as usize);
            let lines = FourLines::off(&mover, &four);
            let distances_squared = (Vectors::splat(mover.position) - four.position).length_squared();
            let is_there = distances_squared.simd_lt(Floats::splat(f32::INFINITY));
            let unhindered = self.velocities[id];
            let is_violated = lines.depth(Vectors::splat(unhindered)).simd_gt(Floats::ZERO) & is_there;
            let wish = Floats::new([mover.preferred.x, mover.preferred.y, unhindered.x, unhindered.y]);
            let (id, max_speed) = (id as u32, mover.kind.max_speed);
            impeded.push(Impeded { place, id, lines, distances_squared, wish, max_speed });
            keep_last_if(is_violated.any(), impeded);
        }
    }

    /// Finds another velocity for those who cannot have the one they want.
    fn give_way(&mut self, impeded: &[Impeded]) {
        for units in impeded.chunks(LANES) {
            // There may be less than four left: then some lanes repeat the first.
            let unit = |lane: usize| units.get(lane).unwrap_or(&units[0]);
            let programs = Programs::of([unit(0), unit(1), unit(2), unit(3)]);
            let velocities = programs.solve();
            let tied = if self.crowd.equals_keep_order() { 0 } else { programs.have_equals().to_bitmask() };
            for (lane, unit) in units.iter().enumerate() {
                if tied >> lane & 1 == 1 {
                    self.search.lines.clear();
                    self.avoid_all(unit.place as usize);
                    continue;
                }
                self.velocities[unit.id as usize] = valid(velocities.lane(lane));
            }
        }
    }

    /// Finds the velocity of a unit in any situation; the lines of obstacles are there already.
    fn avoid_all(&mut self, place: usize) {
        let (id, mover) = self.mover(place);
        let Search { found, lines, projected, .. } = &mut *self.search;
        let n_hard = lines.len();
        self.crowd.find(place, mover.kind.neighbour_range_squared, found);
        neighbours::lines(&mover, self.crowd.members(), found.places(), lines);
        let velocity = program::solve(lines, n_hard, mover.kind.max_speed, mover.preferred, projected);
        self.velocities[id] = valid(velocity);
    }
}

/// Two units in one spot have no direction to part in; whatever comes of that, nobody leaves the plane.
fn valid(velocity: Vec2) -> Vec2 {
    if velocity.is_finite() { velocity } else { Vec2::ZERO }
}
