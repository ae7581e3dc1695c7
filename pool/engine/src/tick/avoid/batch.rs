//! The linear programs of several units: collected unit by unit, solved together, one per lane.
//!
//! A unit's half-planes have *slots*: first those of obstacles, nearest first, then those of neighbours,
//! nearest first. The order decides the rounding.

use glam::Vec2;

use super::linear_program::{HalfPlane, HalfPlaneColumns, Programs};
use super::neighbours::{Movers, NeighbourColumns};
use super::plane_units::Member;
use crate::lanes::{Column, Floats, Lanes, MAX_LANES, Vectors};

/// The programs that are not solved yet.
#[derive(Debug, Default)]
pub(super) struct Batch {
    n_programs: usize,
    ids: [u32; MAX_LANES],
    position: [Column; 2],
    velocity: [Column; 2],
    radius: Column,
    preferred: [Column; 2],
    unconstrained: [Column; 2],
    max_speed: Column,
    /// The number of half-planes of obstacles, and of all half-planes.
    n_hard: Column,
    n: Column,
    max_n_hard: usize,
    max_n: usize,
    /// By slot. A lane has an entry in one of the two: obstacles in `half_planes` from the start, neighbours
    /// here.
    neighbours: Vec<NeighbourColumns>,
    half_planes: Vec<HalfPlaneColumns>,
    projected: Vec<HalfPlaneColumns>,
}

/// What a unit would do without neighbours and obstacles.
pub(super) struct Goal {
    pub preferred: Vec2,
    /// The preferred velocity within the speed limit.
    pub unconstrained: Vec2,
    pub max_speed: f32,
}

impl Batch {
    /// Reserves memory for units with at most `n_half_planes` each.
    pub fn reserve(&mut self, n_half_planes: usize) {
        self.neighbours.resize(n_half_planes, NeighbourColumns::default());
        self.half_planes.resize(n_half_planes, HalfPlaneColumns::default());
        self.projected.resize(n_half_planes, HalfPlaneColumns::default());
    }

    /// Adds the program of a unit. There must be a free lane.
    #[inline(always)]
    pub fn push<'a>(
        &mut self,
        unit: &Member,
        goal: &Goal,
        obstacles: &[HalfPlane],
        neighbours: impl Iterator<Item = &'a Member>,
    ) {
        let lane = self.n_programs;
        assert!(lane < MAX_LANES);
        self.n_programs += 1;
        self.ids[lane] = unit.id;
        set(&mut self.position, lane, unit.position);
        set(&mut self.velocity, lane, unit.velocity);
        self.radius[lane] = unit.radius;
        set(&mut self.preferred, lane, goal.preferred);
        set(&mut self.unconstrained, lane, goal.unconstrained);
        self.max_speed[lane] = goal.max_speed;
        for (slot, half_plane) in self.half_planes.iter_mut().zip(obstacles) {
            set(&mut slot.point, lane, half_plane.point);
            set(&mut slot.direction, lane, half_plane.direction);
        }
        let n_hard = obstacles.len();
        let mut n = n_hard;
        for (slot, neighbour) in self.neighbours[n_hard..].iter_mut().zip(neighbours) {
            set(&mut slot.position, lane, neighbour.position);
            set(&mut slot.velocity, lane, neighbour.velocity);
            slot.radius[lane] = neighbour.radius;
            slot.share[lane] = neighbour.share;
            n += 1;
        }
        self.n_hard[lane] = n_hard as f32;
        self.n[lane] = n as f32;
        self.max_n_hard = self.max_n_hard.max(n_hard);
        self.max_n = self.max_n.max(n);
    }

    /// Whether every lane has a program.
    #[inline(always)]
    pub fn is_full<S: Lanes>(&self, _: S) -> bool {
        self.n_programs == S::F32_LANES
    }

    /// Solves the programs and removes them; sets the velocities, by battle-wide id.
    #[inline(always)]
    pub fn solve<S: Lanes>(&mut self, simd: S, velocities: &mut [Vec2]) {
        if self.n_programs == 0 {
            return;
        }
        // Lanes without a program have the half-planes of earlier ones, which must not count.
        self.n[self.n_programs..].fill(0.0);
        let (n, n_hard) = (Floats::load(simd, &self.n), Floats::load(simd, &self.n_hard));
        let movers = Movers {
            position: Vectors::load(simd, &self.position),
            velocity: Vectors::load(simd, &self.velocity),
            radius: Floats::load(simd, &self.radius),
        };
        let (neighbours, half_planes) = (&self.neighbours[..self.max_n], &mut self.half_planes[..self.max_n]);
        for (slot, (neighbours, half_planes)) in neighbours.iter().zip(&mut *half_planes).enumerate() {
            let mut here = movers.keep_off(neighbours);
            let slot_number = Floats::splat(simd, slot as f32);
            if slot < self.max_n_hard {
                let (obstacles, _) = half_planes.load(simd);
                let is_hard = slot_number.lt(n_hard);
                here.point = is_hard.either(obstacles.point, here.point);
                here.direction = is_hard.either(obstacles.direction, here.direction);
            }
            half_planes.store(here, slot_number.lt(n));
        }
        let programs = Programs {
            preferred: Vectors::load(simd, &self.preferred),
            unconstrained: Vectors::load(simd, &self.unconstrained),
            max_speed: Floats::load(simd, &self.max_speed),
            n_hard,
            max_n_hard: self.max_n_hard,
        };
        // Two units at one point have no direction in which to separate, which gives NaN or infinity; such a
        // unit stays.
        let solutions = programs.solve(half_planes, &mut self.projected).finite_or_zero();
        let mut solved = [Column::default(); 2];
        solutions.store(&mut solved);
        let [x, y] = &solved;
        for ((&id, &x), &y) in self.ids[..self.n_programs].iter().zip(x).zip(y) {
            velocities[id as usize] = Vec2::new(x, y);
        }
        (self.n_programs, self.max_n_hard, self.max_n) = (0, 0, 0);
    }
}

/// Sets the vector of a lane.
#[inline(always)]
fn set([x, y]: &mut [Column; 2], lane: usize, vector: Vec2) {
    (x[lane], y[lane]) = vector.into();
}
