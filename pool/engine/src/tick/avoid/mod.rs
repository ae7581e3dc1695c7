//! Phase 3, collision avoidance: turns preferred velocities into actual ones by ORCA (van den Berg et al.,
//! "Reciprocal n-body collision avoidance").
//!
//! Every moving unit collects half-planes of permitted velocities, first from obstacle edges (`obstacles`),
//! then from neighbouring units (`neighbours`), and takes the permitted velocity nearest to its preferred
//! velocity (`linear_program`). All units plan against the same frozen positions and velocities; then all
//! velocities change at once.
//!
//! Most units have up to four neighbours and no obstacle in sight. Their linear programs are solved four at a
//! time (`linear_program::x4`), to the same bits. [`Planner`] finds those units in three stages: neighbours,
//! half-planes, solutions.
//!
//! All arithmetic is in f32, and a vector is divided by a scalar by multiplying it with the rounded
//! reciprocal: the recorded battles depend on it to the last bit. The time horizon of the paper, tau, is 1 s
//! for units and for obstacles, so divisions by it do not appear.

mod linear_program;
mod nearest_list;
mod neighbours;
mod obstacles;
mod plane_units;
mod tree;

use glam::Vec2;

use super::World;
use crate::arena::{Arena, AvoidanceParams};
use crate::neighbour_order::PlaneOrder;
use crate::simd::{F32x4, Vec2x4, WIDTH};
use crate::units::clear_and_reserve;
use linear_program::HalfPlane;
use linear_program::x4::LinearProgramX4;
use nearest_list::NearestList;
use neighbours::HalfPlaneX4;
use plane_units::{Neighbour, NeighbourMask, PlaneUnits, keep_last_if};

/// Two directions whose cross product is this small count as parallel; also the tolerance for covered edges.
const EPSILON: f32 = 1e-5;

/// Working memory of collision avoidance.
#[derive(Debug, Default)]
pub(crate) struct AvoidScratch {
    /// The living units of each plane.
    planes: [PlaneUnits; 3],
    with_neighbours: Vec<WithNeighbours>,
    constrained: Vec<Constrained>,
    unit: UnitScratch,
}

impl AvoidScratch {
    /// Reserves memory for `n_units` units, each of which sees at most `n_edges` edges.
    pub fn reserve(&mut self, n_units: usize, n_edges: usize) {
        self.planes.iter_mut().for_each(|plane| plane.reserve(n_units));
        clear_and_reserve(&mut self.with_neighbours, n_units);
        clear_and_reserve(&mut self.constrained, n_units);
        clear_and_reserve(&mut self.unit.near_edges, n_edges);
        self.unit.found.reserve(n_units.max(n_edges));
        for half_planes in [&mut self.unit.half_planes, &mut self.unit.projected] {
            // Half-planes of units are added four at a time, and the surplus is cut off.
            clear_and_reserve(half_planes, n_edges + n_units.next_multiple_of(WIDTH));
        }
    }
}

/// Working memory for the velocity of one unit.
#[derive(Debug, Default)]
struct UnitScratch {
    /// Indices of edges that may be in sight.
    near_edges: Vec<u32>,
    /// Edges or units in sight.
    found: NearestList,
    half_planes: Vec<HalfPlane>,
    projected: Vec<HalfPlane>,
}

/// A unit whose velocity is planned.
struct Mover {
    position: Vec2,
    velocity: Vec2,
    preferred: Vec2,
    stats: AvoidanceParams,
}

/// A unit with neighbours, and no obstacle in sight.
#[derive(Clone, Copy, Debug)]
struct WithNeighbours {
    index: u32,
    neighbours: NeighbourMask,
}

/// A unit whose neighbours do not permit its preferred velocity.
#[derive(Clone, Copy, Debug)]
struct Constrained {
    index: u32,
    id: u32,
    /// The half-planes that its neighbours impose.
    half_planes: HalfPlaneX4,
    /// The squared distances of those neighbours; infinite where there are fewer than four.
    distances_squared: F32x4,
    preferred: Vec2,
    /// The velocity without neighbours: the preferred one within the speed limit.
    unconstrained: Vec2,
    max_speed: f32,
}

/// Plans the velocity of every living unit.
///
/// Each stage filters the units for the next one: those that move, those of them that have neighbours, and
/// those of them whose neighbours do not permit the preferred velocity. The outcomes are unpredictable, so
/// processing one unit from begin to end would cost a branch misprediction at nearly every test; a stage over
/// all units has no such branches.
#[inline(never)]
pub(super) fn plan_velocities(world: &mut World) {
    gather(world);
    let World { arena, units, scratch, .. } = world;
    let AvoidScratch { planes, with_neighbours, constrained, unit } = &mut scratch.avoid;
    for plane in planes.iter_mut().filter(|plane| !plane.movers().is_empty()) {
        let mut planner = Planner {
            arena,
            plane,
            preferred: &scratch.preferred,
            velocities: &mut units.planned_vel,
            scratch: unit,
        };
        planner.find_neighbours(with_neighbours);
        planner.build_half_planes(with_neighbours, constrained);
        planner.solve(constrained);
    }
}

/// Packs the living units of each plane, in the order of the neighbour list.
fn gather(world: &mut World) {
    let World { arena, units, neighbour_order, scratch, .. } = world;
    for (plane, PlaneOrder { list, .. }) in scratch.avoid.planes.iter_mut().zip(&mut neighbour_order.planes) {
        plane.clear();
        // The list keeps its order for the next tick: see `NeighbourOrder`.
        plane.sort(list, &units.pos);
        for &id in &*list {
            let i = id as usize;
            let Vec2 { x, y } = scratch.preferred[i];
            let stays = (x == 0.0) & (y == 0.0);
            // Neighbours expect the unit to keep the velocity that it planned in the last tick.
            plane.push(
                Neighbour::new(id, units.pos[i], units.planned_vel[i], arena.stats(id).avoid.radius, stays),
                stays,
            );
            // A unit that prefers to stay does so and plans nothing: this lets units block and
            // surround others. Moving units get their velocity below.
            units.planned_vel[i] = scratch.preferred[i];
        }
        if !plane.movers().is_empty() {
            plane.pack();
        }
    }
}

/// Finds the velocities of the units of a plane.
struct Planner<'a> {
    arena: &'a Arena,
    plane: &'a mut PlaneUnits,
    /// By battle-wide id, like the velocities.
    preferred: &'a [Vec2],
    velocities: &'a mut [Vec2],
    scratch: &'a mut UnitScratch,
}

impl Planner<'_> {
    fn mover(&self, index: usize) -> (usize, Mover) {
        let member = self.plane.member(index);
        let (id, stats) = (member.id as usize, self.arena.stats(member.id).avoid);
        let (position, velocity) = (member.position(), member.velocity());
        (id, Mover { position, velocity, preferred: self.preferred[id], stats })
    }

    /// Stage 1: gives every moving unit its preferred velocity, and lists those that have neighbours. Units
    /// that see obstacles, or are on a plane with many units, are solved at once.
    fn find_neighbours(&mut self, with_neighbours: &mut Vec<WithNeighbours>) {
        with_neighbours.clear();
        for i in 0..self.plane.movers().len() {
            let index = self.plane.movers()[i] as usize;
            let (id, mover) = self.mover(index);
            let UnitScratch { near_edges, found, half_planes, .. } = &mut *self.scratch;
            // Half-planes of obstacles are hard constraints and come first in the list.
            half_planes.clear();
            obstacles::half_planes(self.arena, &mover, near_edges, found, half_planes);
            if !half_planes.is_empty() || !self.plane.is_small() {
                self.solve_one(index);
                continue;
            }
            self.velocities[id] = valid(linear_program::within(mover.stats.max_speed, mover.preferred));
            // Written before it is known whether there are neighbours, and removed if not: no branch.
            let neighbours = self.plane.near(index, mover.stats.neighbour_range_squared);
            with_neighbours.push(WithNeighbours { index: index as u32, neighbours });
            keep_last_if(neighbours.is_any(), with_neighbours);
        }
    }

    /// Stage 2: builds the half-planes of units with up to four neighbours, and lists the units whose
    /// velocity violates one of them. Units with more neighbours are solved at once.
    fn build_half_planes(&mut self, with_neighbours: &[WithNeighbours], constrained: &mut Vec<Constrained>) {
        constrained.clear();
        for &WithNeighbours { index, neighbours } in with_neighbours {
            let Some(four) = self.plane.four(neighbours) else {
                self.scratch.half_planes.clear();
                self.solve_one(index as usize);
                continue;
            };
            let (id, mover) = self.mover(index as usize);
            let half_planes = HalfPlaneX4::orca(&mover, &four);
            // Padding is at infinity. Its half-planes are NaN, and `is_there` drops them.
            let distances_squared = (Vec2x4::splat(mover.position) - four.position).length_squared();
            let is_there = distances_squared.simd_lt(F32x4::splat(f32::INFINITY));
            let unconstrained = self.velocities[id];
            let is_violated =
                half_planes.violation(Vec2x4::splat(unconstrained)).simd_gt(F32x4::ZERO) & is_there;
            constrained.push(Constrained {
                index,
                id: id as u32,
                half_planes,
                distances_squared,
                preferred: mover.preferred,
                unconstrained,
                max_speed: mover.stats.max_speed,
            });
            keep_last_if(is_violated.any(), constrained);
        }
    }

    /// Stage 3: solves the linear programs, four at a time.
    fn solve(&mut self, constrained: &[Constrained]) {
        for units in constrained.chunks(WIDTH) {
            // Fewer than four may be left: then the first is repeated, and its copies are not used.
            let unit = |i: usize| units.get(i).unwrap_or(&units[0]);
            let programs = LinearProgramX4::of([unit(0), unit(1), unit(2), unit(3)]);
            let velocities = programs.solve();
            // The tree decides which of two equally near neighbours comes first, and the four-wide program
            // does not use it. Such units are rare, and are solved again one by one.
            let tied = if self.plane.equals_keep_order() { 0 } else { programs.have_equals().to_bitmask() };
            for (i, unit) in units.iter().enumerate() {
                if tied >> i & 1 == 1 {
                    self.scratch.half_planes.clear();
                    self.solve_one(unit.index as usize);
                    continue;
                }
                self.velocities[unit.id as usize] = valid(velocities.extract(i));
            }
        }
    }

    /// Finds the velocity of a unit in any situation. The scratch already contains the half-planes of
    /// obstacles.
    fn solve_one(&mut self, index: usize) {
        let (id, mover) = self.mover(index);
        let UnitScratch { found, half_planes, projected, .. } = &mut *self.scratch;
        let n_hard = half_planes.len();
        self.plane.find(index, mover.stats.neighbour_range_squared, found);
        neighbours::half_planes(&mover, self.plane.members(), found.indices(), half_planes);
        let velocity =
            linear_program::solve(half_planes, n_hard, mover.stats.max_speed, mover.preferred, projected);
        self.velocities[id] = valid(velocity);
    }
}

/// Two units at one point have no direction in which to separate, which gives NaN or infinity; such a unit
/// stays.
fn valid(velocity: Vec2) -> Vec2 {
    if velocity.is_finite() { velocity } else { Vec2::ZERO }
}
