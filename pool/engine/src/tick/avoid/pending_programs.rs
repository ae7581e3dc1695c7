//! The linear programs of several units: collected unit by unit, solved together, one per entry of a
//! register.
//!
//! Row i has the i-th half-plane of every program, one per entry. The rows of obstacles, nearest first, come
//! before those of neighbours, nearest first: the order decides the rounding. Programs have different numbers
//! of both, so some entries of a row are empty.

use glam::Vec2;

use super::linear_program::{HalfPlaneColumns, Programs};
use super::near_list::Near;
use super::nearest_list::NearestList;
use super::neighbours::{Movers, NeighbourColumns};
use super::obstacles::{self, EdgeColumns};
use super::plane_units::{Member, PlaneUnits};
use crate::arena::Edge;
use crate::simd::{Column, F32s, InstructionSet, MAX_WIDTH, Vec2s};

/// The programs that are not solved yet: at most one per entry.
#[derive(Debug, Default)]
pub(super) struct PendingPrograms {
    n_programs: usize,
    units: [UnitOfEntry; MAX_WIDTH],
    position: [Column; 2],
    velocity: [Column; 2],
    radius: Column,
    preferred: [Column; 2],
    unconstrained: [Column; 2],
    max_speed: Column,
    /// How many edges of obstacles each entry sees, and the greatest of these numbers.
    n_edges: Column,
    max_edges: usize,
    /// By row, nearest first.
    edges: Vec<EdgeColumns>,
    /// The same of neighbours.
    n_neighbours: Column,
    max_neighbours: usize,
    /// By row; first in any order, then nearest first.
    neighbours: Vec<NeighbourColumns>,
    ranks: Vec<Rank>,
    /// By row: those of obstacles, then those of neighbours.
    half_planes: Vec<HalfPlaneColumns>,
    /// How many rows of obstacles there are: at most `max_edges`, since many edges need no half-plane.
    n_obstacles: usize,
    projected: Vec<HalfPlaneColumns>,
    /// Neighbours of one unit in the order of the tree.
    in_tree_order: NearestList,
}

#[derive(Clone, Copy, Debug, Default)]
struct UnitOfEntry {
    id: u32,
    plane: usize,
    /// Its index in the plane.
    index: usize,
    neighbour_range_squared: f32,
}

/// By what neighbours are sorted.
#[derive(Clone, Copy, Debug, Default)]
struct Rank {
    /// Infinite where there is no neighbour.
    distance_squared: Column,
    /// The neighbour's index in its plane, as the bits of a float: it is exchanged along with the other
    /// columns and never computed with, so one type of column is enough.
    index: Column,
}

/// A unit and what it would do without neighbours and obstacles.
pub(super) struct Mover<'a> {
    pub plane: usize,
    pub index: usize,
    pub member: &'a Member,
    pub preferred: Vec2,
    /// The preferred velocity within the speed limit.
    pub unconstrained: Vec2,
    pub max_speed: f32,
    pub neighbour_range_squared: f32,
}

impl PendingPrograms {
    /// Reserves memory for units with at most this many half-planes each.
    pub fn reserve(&mut self, max_edges: usize, max_neighbours: usize) {
        self.edges.resize(max_edges, EdgeColumns::default());
        self.neighbours.resize(max_neighbours, NeighbourColumns::default());
        self.ranks.resize(max_neighbours, Rank::default());
        self.half_planes.resize(max_edges + max_neighbours, HalfPlaneColumns::default());
        self.projected.resize(max_edges + max_neighbours, HalfPlaneColumns::default());
        self.in_tree_order.reserve(max_neighbours);
    }

    /// Adds the program of a unit, with the edges that it sees, nearest first, and its neighbours among the
    /// members of its plane, in any order. There must be a free entry.
    #[inline(always)]
    pub fn push<'a>(
        &mut self,
        mover: &Mover,
        edges: impl Iterator<Item = &'a Edge>,
        near: &[Near],
        members: &[Member],
    ) {
        let entry = self.n_programs;
        assert!(entry < MAX_WIDTH);
        self.n_programs += 1;
        let &Mover { plane, index, neighbour_range_squared, .. } = mover;
        self.units[entry] = UnitOfEntry { id: mover.member.id, plane, index, neighbour_range_squared };
        set(&mut self.position, entry, mover.member.position);
        set(&mut self.velocity, entry, mover.member.velocity);
        self.radius[entry] = mover.member.radius;
        set(&mut self.preferred, entry, mover.preferred);
        set(&mut self.unconstrained, entry, mover.unconstrained);
        self.max_speed[entry] = mover.max_speed;
        self.set_edges(entry, edges);
        self.set_neighbours(entry, near, members);
    }

    #[inline(always)]
    fn set_edges<'a>(&mut self, entry: usize, edges: impl Iterator<Item = &'a Edge>) {
        let mut n_edges = 0;
        for (row, edge) in self.edges.iter_mut().zip(edges) {
            row.set(entry, edge);
            n_edges += 1;
        }
        self.n_edges[entry] = n_edges as f32;
        self.max_edges = self.max_edges.max(n_edges);
    }

    #[inline(always)]
    fn set_neighbours(&mut self, entry: usize, near: &[Near], members: &[Member]) {
        let mut n_neighbours = 0;
        for near in near {
            near.for_each(
                #[inline(always)]
                |index| {
                    let (row, neighbour) = (&mut self.neighbours[n_neighbours], &members[index]);
                    set(&mut row.position, entry, neighbour.position);
                    set(&mut row.velocity, entry, neighbour.velocity);
                    row.radius[entry] = neighbour.radius;
                    row.share[entry] = neighbour.share;
                    self.ranks[n_neighbours].index[entry] = f32::from_bits(index as u32);
                    n_neighbours += 1;
                },
            );
        }
        self.n_neighbours[entry] = n_neighbours as f32;
        self.max_neighbours = self.max_neighbours.max(n_neighbours);
    }

    /// Number of programs, at most one per entry.
    pub fn len(&self) -> usize {
        self.n_programs
    }

    /// Solves the programs and removes them; sets the velocities, by battle-wide id.
    #[inline(always)]
    pub fn solve<S: InstructionSet>(&mut self, simd: S, planes: &mut [PlaneUnits], velocities: &mut [Vec2]) {
        if self.n_programs == 0 {
            return;
        }
        self.make_half_planes(simd);
        self.sort(simd, planes);
        let programs = Programs {
            preferred: Vec2s::load(simd, &self.preferred),
            unconstrained: Vec2s::load(simd, &self.unconstrained),
            max_speed: F32s::load(simd, &self.max_speed),
            n_hard: self.n_obstacles,
        };
        let half_planes = &self.half_planes[..self.n_obstacles + self.max_neighbours];
        // Two units at one point have no direction in which to separate, which gives NaN or infinity; such a
        // unit stays.
        let solutions = programs.solve(half_planes, &mut self.projected).finite_or_zero();
        let mut solved = [Column::default(); 2];
        solutions.store(&mut solved);
        let [x, y] = &solved;
        for ((unit, &x), &y) in self.units[..self.n_programs].iter().zip(&**x).zip(&**y) {
            velocities[unit.id as usize] = Vec2::new(x, y);
        }
        (self.n_programs, self.max_edges, self.max_neighbours) = (0, 0, 0);
    }

    /// Makes the half-planes of obstacles and neighbours, and marks which rows of an entry have one.
    #[inline(always)]
    fn make_half_planes<S: InstructionSet>(&mut self, simd: S) {
        // Entries without a program have the half-planes of earlier ones, which must not count.
        let has_program = F32s::load(simd, &Column::NUMBERS).lt(F32s::splat(simd, self.n_programs as f32));
        let movers = Movers {
            position: Vec2s::load(simd, &self.position),
            velocity: Vec2s::load(simd, &self.velocity),
            radius: F32s::load(simd, &self.radius),
        };
        let n_edges = F32s::load(simd, &self.n_edges);
        self.n_obstacles = 0;
        for (row, edges) in self.edges[..self.max_edges].iter().enumerate() {
            let (nearer, rest) = self.half_planes.split_at_mut(self.n_obstacles);
            let exist = has_program & F32s::splat(simd, row as f32).lt(n_edges);
            let are_needed = exist & !obstacles::are_covered(&movers, edges, nearer);
            // In front of a wall, its nearest edge covers the others.
            if !are_needed.any() {
                continue;
            }
            let (here, exist) = obstacles::keep_off(&movers, edges);
            let exist = exist & are_needed;
            rest[0].store(here, exist);
            self.n_obstacles += usize::from(exist.any());
        }
        let half_planes = &mut self.half_planes[self.n_obstacles..];
        let n_neighbours = F32s::load(simd, &self.n_neighbours);
        let neighbours = self.neighbours[..self.max_neighbours].iter().zip(&mut self.ranks).zip(half_planes);
        for (row, ((neighbours, rank), half_planes)) in neighbours.enumerate() {
            let exist = has_program & F32s::splat(simd, row as f32).lt(n_neighbours);
            half_planes.store(movers.keep_off(neighbours), exist);
            let distance_squared = movers.offset_of(neighbours).length_squared();
            let infinite = F32s::splat(simd, f32::INFINITY);
            exist.select(distance_squared, infinite).store(&mut rank.distance_squared);
        }
    }

    /// Sorts the half-planes of neighbours, nearest first.
    #[inline(always)]
    fn sort<S: InstructionSet>(&mut self, simd: S, planes: &mut [PlaneUnits]) {
        let n = self.max_neighbours;
        let half_planes = &mut self.half_planes[self.n_obstacles..][..n];
        let ranks = &mut self.ranks[..n];
        // Odd-even transposition sort: it compares the same rows whatever their order, so all entries can be
        // sorted at once; the comparisons of a pass do not wait for each other; and it exchanges adjacent
        // rows only, so equally near neighbours keep their order.
        for pass in 0..n {
            let pairs =
                ranks[pass % 2..].chunks_exact_mut(2).zip(half_planes[pass % 2..].chunks_exact_mut(2));
            for (ranks, half_planes) in pairs {
                let ([near_rank, far_rank], [near, far]) = (ranks, half_planes) else { continue };
                let is_wrong = F32s::load(simd, &far_rank.distance_squared)
                    .lt(F32s::load(simd, &near_rank.distance_squared));
                if !is_wrong.any() {
                    continue;
                }
                is_wrong.swap(&mut near_rank.distance_squared, &mut far_rank.distance_squared);
                is_wrong.swap(&mut near_rank.index, &mut far_rank.index);
                for i in 0..2 {
                    is_wrong.swap(&mut near.point[i], &mut far.point[i]);
                    is_wrong.swap(&mut near.direction[i], &mut far.direction[i]);
                }
            }
        }
        let mut tied = 0;
        for pair in ranks.windows(2) {
            let near = F32s::load(simd, &pair[0].distance_squared);
            let far = F32s::load(simd, &pair[1].distance_squared);
            tied |= (near.eq(far) & near.lt(F32s::splat(simd, f32::INFINITY))).bits();
        }
        while tied != 0 {
            self.sort_entry_by_tree(tied.trailing_zeros() as usize, planes);
            tied &= tied - 1;
        }
    }

    /// Puts the half-planes of an entry with equally near neighbours into the order of the tree.
    #[cold]
    fn sort_entry_by_tree(&mut self, entry: usize, planes: &mut [PlaneUnits]) {
        let unit = self.units[entry];
        if !planes[unit.plane].find_by_tree(unit.index, unit.neighbour_range_squared, &mut self.in_tree_order)
        {
            return;
        }
        let half_planes = &mut self.half_planes[self.n_obstacles..];
        for (row, index) in self.in_tree_order.indices().enumerate() {
            let is_here = |rank: &Rank| rank.index[entry].to_bits() as usize == index;
            let Some(from) = self.ranks[row..].iter().position(is_here) else { continue };
            let swap = |columns: [&mut Column; 2]| {
                let [a, b] = columns;
                std::mem::swap(&mut a[entry], &mut b[entry]);
            };
            if let Ok([a, b]) = self.ranks.get_disjoint_mut([row, row + from]) {
                swap([&mut a.distance_squared, &mut b.distance_squared]);
                swap([&mut a.index, &mut b.index]);
            }
            if let Ok([a, b]) = half_planes.get_disjoint_mut([row, row + from]) {
                for i in 0..2 {
                    swap([&mut a.point[i], &mut b.point[i]]);
                    swap([&mut a.direction[i], &mut b.direction[i]]);
                }
            }
        }
    }
}

/// Sets the vector of an entry.
#[inline(always)]
fn set([x, y]: &mut [Column; 2], entry: usize, vector: Vec2) {
    (x[entry], y[entry]) = vector.into();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arena::AvoidanceParams;
    use crate::simd::{Kernel, Level};
    use crate::tick::avoid::plane_units::BattleUnits;

    /// Two units on a line of twelve, more than fit in a leaf of the tree, each with its two neighbours.
    struct OnALine<'a> {
        /// The neighbours of each unit, in order, and the directions of their half-planes.
        sorted: &'a mut [Vec<(usize, Vec2)>; 2],
    }

    impl Kernel for OnALine<'_> {
        #[inline(always)]
        fn run<S: InstructionSet>(self, simd: S) {
            let positions: Vec<Vec2> = (0..12).map(|x| Vec2::new(x as f32, 0.0)).collect();
            let stats = AvoidanceParams { neighbour_range_squared: 2.0, ..Default::default() };
            let mut plane = PlaneUnits::default();
            plane.reserve(12);
            let mut ids: Vec<u32> = (0..12).collect();
            let battle = BattleUnits {
                positions: &positions,
                velocities: &[Vec2::ZERO; 12],
                preferred: &[Vec2::ONE; 12],
                stats: &[stats; 12],
            };
            plane.pack(simd, &mut ids, &battle);
            let mut pending = PendingPrograms::default();
            pending.reserve(0, 12);
            for index in [5, 6] {
                let mover = Mover {
                    plane: 0,
                    index,
                    member: &plane.members()[index],
                    preferred: Vec2::ONE,
                    unconstrained: Vec2::ONE,
                    max_speed: 2.0,
                    neighbour_range_squared: stats.neighbour_range_squared,
                };
                let near = Near::of(&[index - 1, index + 1]);
                pending.push(&mover, [].into_iter(), &[near], plane.members());
            }
            pending.make_half_planes(simd);
            pending.sort(simd, std::slice::from_mut(&mut plane));
            for (entry, sorted) in self.sorted.iter_mut().enumerate() {
                let rows = pending.ranks.iter().zip(&pending.half_planes).take(2);
                *sorted = rows
                    .map(|(rank, half_plane)| {
                        let [x, y] = &half_plane.direction;
                        (rank.index[entry].to_bits() as usize, Vec2::new(x[entry], y[entry]))
                    })
                    .collect();
            }
        }
    }

    /// The tree visits the half of the units first whose box is nearer, and of equally near boxes the upper
    /// one: for unit 6 that with unit 7. The order of the half-planes decides the rounding.
    #[test]
    fn of_equally_near_neighbours_the_tree_decides() {
        for level in Level::available() {
            let mut sorted = [Vec::new(), Vec::new()];
            level.run(OnALine { sorted: &mut sorted });
            let [of_5, of_6] = sorted;
            let indices = |of: &[(usize, Vec2)]| of.iter().map(|(index, _)| *index).collect::<Vec<_>>();
            assert_eq!((indices(&of_5), indices(&of_6)), (vec![4, 6], vec![7, 5]), "{level:?}");
            // Half-planes move with their neighbours: the one above is the same for both units.
            assert_eq!((of_5[0].1, of_5[1].1), (of_6[1].1, of_6[0].1), "{level:?}");
            assert_ne!(of_5[0].1, of_5[1].1);
        }
    }
}
