//! Phase 3, collision avoidance: turns preferred velocities into actual ones by ORCA (van den Berg et al.,
//! "Reciprocal n-body collision avoidance").
//!
//! Every moving unit collects half-planes of permitted velocities, first from obstacle edges (`obstacles`),
//! then from neighbouring units (`neighbours`), and takes the permitted velocity nearest to its preferred
//! velocity (`linear_program`). All units plan against the same frozen positions and velocities; then all
//! velocities change at once.
//!
//! It takes three stages over all units of a plane: neighbours, half-planes, solutions. Each is computed for
//! as many units at a time as a register has entries ([`crate::simd`]), to the same bits.
//!
//! All arithmetic is in f32, and a vector is divided by a scalar by multiplying it with the rounded
//! reciprocal: the recorded battles depend on it to the last bit. The time horizon of the paper, tau, is 1 s
//! for units and for obstacles, so divisions by it do not appear.

mod columns;
mod linear_program;
mod near_list;
mod nearest_list;
mod neighbours;
mod obstacles;
mod pending_programs;
mod plane_units;
mod tree;

use glam::Vec2;

use super::World;
use crate::arena::{Arena, EdgeSearch};
use crate::neighbour_order::PlaneOrder;
use crate::simd::{InstructionSet, Kernel};
use near_list::{NearList, NearUnit};
use nearest_list::NearestList;
use pending_programs::{Mover, PendingPrograms};
use plane_units::{BattleUnits, PlaneUnits};

/// Two directions whose cross product is this small count as parallel; also the tolerance for covered edges.
const EPSILON: f32 = 1e-5;

/// Working memory of collision avoidance.
#[derive(Debug, Default)]
pub(crate) struct AvoidScratch {
    /// The living units of each plane.
    planes: [PlaneUnits; 3],
    /// The neighbours of all units of a plane.
    near: NearList,
    pub(super) edge_search: EdgeSearch,
    /// Edges in sight of a unit.
    seen: NearestList,
    pending: PendingPrograms,
}

impl AvoidScratch {
    /// Reserves memory for `n_units` units, each of which sees at most `n_edges` edges.
    pub fn reserve(&mut self, n_units: usize, n_edges: usize) {
        self.planes.iter_mut().for_each(|plane| plane.reserve(n_units));
        self.seen.reserve(n_edges);
        self.pending.reserve(n_edges, n_units);
        self.edge_search.reserve(n_edges);
        self.near.reserve(n_units);
    }
}

/// Plans the velocity of every living unit.
#[inline(never)]
pub(super) fn plan_velocities(world: &mut World) {
    let World { arena, units, neighbour_order, scratch, .. } = world;
    scratch.level.run(Planning {
        arena,
        positions: &units.pos,
        preferred: &scratch.preferred,
        velocities: &mut units.planned_vel,
        order: &mut neighbour_order.planes,
        scratch: &mut scratch.avoid,
    });
}

/// What the planning of all velocities reads and changes. Slices are by battle-wide id.
struct Planning<'a> {
    arena: &'a Arena,
    positions: &'a [Vec2],
    preferred: &'a [Vec2],
    /// The velocities that were planned in the last tick.
    velocities: &'a mut [Vec2],
    order: &'a mut [PlaneOrder],
    scratch: &'a mut AvoidScratch,
}

impl Kernel for Planning<'_> {
    /// Each stage filters the units for the next one: those that move, and those of them that have neighbours
    /// or obstacles near them. The outcomes are unpredictable, so processing one unit from begin to end would
    /// cost a branch misprediction at nearly every test; a stage over all units has no such branches.
    #[inline(always)]
    fn run<S: InstructionSet>(mut self, simd: S) {
        for plane in 0..self.order.len() {
            let AvoidScratch { planes, .. } = &mut *self.scratch;
            // The list keeps its order for the next tick: see `NeighbourOrder`.
            let list = &mut self.order[plane].list;
            if list.is_empty() {
                continue;
            }
            let battle = BattleUnits {
                positions: self.positions,
                velocities: self.velocities,
                preferred: self.preferred,
                stats: &self.arena.avoidance,
            };
            planes[plane].pack(simd, list, &battle);
            // A unit that prefers to stay does so and plans nothing: this lets units block and surround
            // others.
            if planes[plane].movers().is_empty() {
                list.iter().for_each(|&id| self.velocities[id as usize] = self.preferred[id as usize]);
                continue;
            }
            self.find_neighbours(simd, plane);
            self.collect_programs(simd, plane);
        }
        // The programs that are left, of all planes together: so fewer entries stay empty.
        let AvoidScratch { planes, pending, .. } = &mut *self.scratch;
        if pending.len() <= S::Narrower::WIDTH {
            pending.solve(simd.narrower(), planes, self.velocities);
        } else {
            pending.solve(simd, planes, self.velocities);
        }
    }
}

impl Planning<'_> {
    /// Gives every unit its velocity without neighbours and obstacles, and lists the neighbours.
    #[inline(always)]
    fn find_neighbours<S: InstructionSet>(&mut self, simd: S, plane: usize) {
        let AvoidScratch { planes, near, .. } = &mut *self.scratch;
        let plane = &mut planes[plane];
        plane.find_unconstrained(simd, &self.arena.edges);
        for (id, velocity) in plane.all_unconstrained() {
            self.velocities[id as usize] = velocity;
        }
        plane.find_neighbours(simd, &self.arena.avoidance, &self.arena.edges, near);
    }

    /// Collects the linear programs of the listed units, and solves them whenever every entry has one.
    #[inline(always)]
    fn collect_programs<S: InstructionSet>(&mut self, simd: S, plane: usize) {
        let AvoidScratch { planes, near, edge_search, seen, pending, .. } = &mut *self.scratch;
        let mut plane_units = &planes[plane];
        for NearUnit { index, may_see_edges, neighbours } in near.units() {
            let member = &plane_units.members()[index];
            let stats = &self.arena.avoidance[member.id as usize];
            seen.clear();
            if let Some(range) = stats.edge_range_squared.filter(|_| may_see_edges) {
                let edges = self.arena.edges.near(plane_units.cell(index), edge_search);
                obstacles::find(simd.narrower(), member.position, edges, range, seen);
                if seen.indices().len() == 0 && neighbours.is_empty() {
                    continue;
                }
            }
            let mover = Mover {
                plane,
                index,
                member,
                preferred: plane_units.preferred(index),
                unconstrained: plane_units.unconstrained(index),
                max_speed: stats.max_speed,
                neighbour_range_squared: stats.neighbour_range_squared,
            };
            let seen = seen.indices().map(
                #[inline(always)]
                |number| self.arena.edges.edge(number as u32),
            );
            pending.push(&mover, seen, neighbours, plane_units.members());
            if pending.len() == S::WIDTH {
                pending.solve(simd, planes, self.velocities);
                plane_units = &planes[plane];
            }
        }
    }
}
