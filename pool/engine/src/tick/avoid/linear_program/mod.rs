//! The linear program of collision avoidance: the permitted velocity nearest to the preferred one.
//!
//! The permitted velocities are a disc (the speed limit) cut by half-planes, a convex set. The algorithm is
//! the incremental one of the paper (de Berg et al., "Computational Geometry", chapter 4): half-planes are
//! added in the given order, and the best velocity so far is kept. A half-plane that it violates moves it:
//! then the new best velocity lies on the boundary of that half-plane, where every earlier half-plane cuts
//! off a ray, so what remains is an interval (a one-dimensional program). An empty interval means that no
//! velocity satisfies all.
//!
//! In that case the half-planes of units are relaxed (the paper's "Densely Packed Conditions"): all their
//! boundaries move outwards at equal speed until a velocity exists. That is a program in three dimensions,
//! solved with the same method: while the worst violation is that of half-plane i, the solution lies where i
//! and some earlier j are violated equally, which is a boundary again; among those it is the velocity
//! farthest inside i. Half-planes of obstacles are never relaxed.
//!
//! The programs of several units are solved at a time, one per entry. An entry cannot branch on its own:
//! every half-plane is processed for all programs, and masks select the results that apply; the result of a
//! case that does not apply, NaN included, is dropped. What no entry needs is skipped. Begin reading in
//! `reference.rs`, which has the same algorithm for one unit at a time; the tests compare the bits.

#[cfg(test)]
mod reference;
#[cfg(test)]
mod tests;

#[cfg(test)]
use glam::Vec2;

use super::EPSILON;
use crate::simd::{Column, F32s, InstructionSet, Mask, Vec2s};

/// A half-plane of permitted velocities, by its boundary: velocities to the left of it are permitted.
#[cfg(test)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct HalfPlane {
    pub point: Vec2,
    /// Of length 1.
    pub direction: Vec2,
}

/// A half-plane per entry, in memory. Entries need not have one.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct HalfPlaneColumns {
    pub point: [Column; 2],
    pub direction: [Column; 2],
    /// 1 where there is a half-plane, else 0: a mask has another form in memory on every instruction set.
    pub exists: Column,
}

/// A half-plane of permitted velocities per entry, by its boundary: velocities to the left of it are
/// permitted.
#[derive(Clone, Copy)]
pub(super) struct HalfPlanes<S: InstructionSet> {
    pub point: Vec2s<S>,
    /// Of length 1.
    pub direction: Vec2s<S>,
}

impl HalfPlaneColumns {
    /// The half-planes, and in which entries they exist.
    #[inline(always)]
    pub fn load<S: InstructionSet>(&self, simd: S) -> (HalfPlanes<S>, Mask<S>) {
        let half_planes = HalfPlanes {
            point: Vec2s::load(simd, &self.point),
            direction: Vec2s::load(simd, &self.direction),
        };
        (half_planes, F32s::load(simd, &self.exists).gt(F32s::splat(simd, 0.0)))
    }

    #[inline(always)]
    pub fn store<S: InstructionSet>(&mut self, half_planes: HalfPlanes<S>, exist: Mask<S>) {
        let simd = exist.simd();
        half_planes.point.store(&mut self.point);
        half_planes.direction.store(&mut self.direction);
        exist.select(F32s::splat(simd, 1.0), F32s::splat(simd, 0.0)).store(&mut self.exists);
    }
}

impl<S: InstructionSet> HalfPlanes<S> {
    /// How far velocities are on the wrong side of the boundaries; negative if they are permitted.
    #[inline(always)]
    fn violation(&self, velocities: Vec2s<S>) -> F32s<S> {
        self.direction.perp_dot(self.point - velocities)
    }
}

/// What is common to the half-planes of each program.
#[derive(Clone, Copy)]
pub(super) struct Programs<S: InstructionSet> {
    pub preferred: Vec2s<S>,
    /// The preferred velocities within the speed limit.
    pub unconstrained: Vec2s<S>,
    pub max_speed: F32s<S>,
    /// How many rows, the first ones, have half-planes that are never relaxed.
    pub n_hard: usize,
}

/// The objective: which of the permitted velocities is best.
#[derive(Clone, Copy)]
enum Aim<S: InstructionSet> {
    Nearest(Vec2s<S>),
    /// The farthest in directions of length 1.
    Farthest(Vec2s<S>),
}

impl<S: InstructionSet> Vec2s<S> {
    /// The velocities within `max_speed` that are nearest to these.
    #[inline(always)]
    pub fn within(self, max_speed: F32s<S>) -> Vec2s<S> {
        let is_too_fast = self.length_squared().gt(max_speed * max_speed);
        is_too_fast.either(self.normalize() * max_speed, self)
    }
}

impl<S: InstructionSet> Programs<S> {
    /// The velocities within the speed limit nearest to the preferred ones that the half-planes permit.
    ///
    /// `projected` is working memory, at least as long as `half_planes`.
    #[inline(always)]
    pub fn solve(&self, half_planes: &[HalfPlaneColumns], projected: &mut [HalfPlaneColumns]) -> Vec2s<S> {
        let zero = F32s::splat(self.max_speed.simd(), 0.0);
        let all = zero.le(zero);
        let nearest = self.best_velocity(half_planes, Aim::Nearest(self.preferred), self.unconstrained, all);
        if nearest.is_infeasible.any() {
            self.least_violation(half_planes, nearest, projected)
        } else {
            nearest.velocities
        }
    }

    /// The best velocities; `velocities` are the best without half-planes: the speed limit decides alone.
    /// Programs that do not `count` are left as if they were infeasible, so that no time is lost on what only
    /// they need.
    #[inline(always)]
    fn best_velocity(
        &self,
        half_planes: &[HalfPlaneColumns],
        aim: Aim<S>,
        velocities: Vec2s<S>,
        count: Mask<S>,
    ) -> Solutions<S> {
        let simd = self.max_speed.simd();
        let zero = F32s::splat(simd, 0.0);
        let mut solutions = Solutions { velocities, is_infeasible: !count, half_plane: zero };
        for (i, columns) in half_planes.iter().enumerate() {
            let (half_plane, exists) = columns.load(simd);
            // A half-plane that the best velocity so far satisfies changes nothing. Otherwise the new best
            // velocity is on its boundary: on the way from any permitted velocity to the old best one the
            // objective improves, so it improves up to the boundary.
            let is_violated = half_plane.violation(solutions.velocities).gt(zero);
            // A program that is infeasible already stays as it is: its velocity is that without the
            // half-plane.
            let concerned = is_violated & exists & !solutions.is_infeasible;
            if !concerned.any() {
                continue;
            }
            let (better, is_feasible) = self.best_on_boundary(&half_plane, &half_planes[..i], aim);
            solutions.velocities = (concerned & is_feasible).either(better, solutions.velocities);
            let fails = concerned & !is_feasible;
            solutions.is_infeasible = solutions.is_infeasible | fails;
            solutions.half_plane = fails.select(F32s::splat(simd, i as f32), solutions.half_plane);
        }
        solutions
    }

    /// The best velocities on the boundaries of half-planes that satisfy all `earlier` ones, and where there
    /// are any.
    ///
    /// A point of the boundary is `point + t direction`. The speed limit leaves an interval of t, from the
    /// roots of
    /// |point + t direction|^2 = max_speed^2; each earlier half-plane raises its begin or lowers its end.
    #[inline(always)]
    fn best_on_boundary(
        &self,
        half_plane: &HalfPlanes<S>,
        earlier: &[HalfPlaneColumns],
        aim: Aim<S>,
    ) -> (Vec2s<S>, Mask<S>) {
        let (max_speed, simd) = (self.max_speed, self.max_speed.simd());
        let zero = F32s::splat(simd, 0.0);
        let HalfPlanes { point, direction } = *half_plane;
        // With |direction| = 1 the quadratic equation is t^2 + 2 t along + |point|^2 - max_speed^2 = 0.
        let along = point.dot(direction);
        let discriminant = along * along + max_speed * max_speed - point.length_squared();
        // Where the discriminant is negative, every point of the boundary is too fast, and the root is NaN.
        // All comparisons with it are false, and the mask drops the result.
        let mut is_infeasible = discriminant.lt(zero);
        let root = discriminant.sqrt();
        let (mut from, mut to) = (-along - root, -along + root);
        for other in earlier {
            let (other, exists) = other.load(simd);
            // The boundaries cross where other.direction x (point + t direction - other.point) = 0, x being
            // the cross product.
            let denominator = direction.perp_dot(other.direction);
            let numerator = other.direction.perp_dot(point - other.point);
            // Parallel boundaries: the other half-plane contains this boundary entirely or not at all. They
            // divide by nearly zero; `crosses` drops the result.
            let are_parallel = denominator.abs().le(F32s::splat(simd, EPSILON));
            is_infeasible = is_infeasible | exists & are_parallel & numerator.lt(zero);
            let crosses = exists & !are_parallel;
            // The sign of the denominator says whether the boundary leaves or enters the other half-plane
            // there.
            let crossing = numerator.div(denominator);
            let is_end = denominator.ge(zero);
            to = (crosses & is_end & crossing.lt(to)).select(crossing, to);
            from = (crosses & !is_end & from.lt(crossing)).select(crossing, from);
        }
        // The interval only shrinks, so one test at the end is enough.
        is_infeasible = is_infeasible | from.gt(to);
        // On a line both objectives have a best point: one of the ends of the interval, or the projection of
        // the preferred velocity, clamped to the interval.
        let at = match aim {
            Aim::Farthest(aim) => aim.dot(direction).gt(zero).select(to, from),
            Aim::Nearest(preferred) => {
                let nearest = direction.dot(preferred - point);
                nearest.lt(from).select(from, nearest.gt(to).select(to, nearest))
            }
        };
        (point + direction * at, !is_infeasible)
    }

    /// The velocities whose worst violation of the half-planes that can be relaxed is least, where there is
    /// no permitted one.
    #[inline(always)]
    fn least_violation(
        &self,
        half_planes: &[HalfPlaneColumns],
        failed: Solutions<S>,
        projected: &mut [HalfPlaneColumns],
    ) -> Vec2s<S> {
        let simd = self.max_speed.simd();
        let Solutions { mut velocities, is_infeasible, half_plane: first } = failed;
        // `worst` is the violation so far by the half-planes before i. One that is violated more must be
        // among the most violated of the solution; there it and some earlier one are violated equally.
        let mut worst = F32s::splat(simd, 0.0);
        // The hard half-planes come first and stay as they are. If one of them failed, there are none of
        // units before it.
        projected[..self.n_hard].copy_from_slice(&half_planes[..self.n_hard]);
        for (i, columns) in half_planes.iter().enumerate() {
            let (half_plane, exists) = columns.load(simd);
            let is_worse = half_plane.violation(velocities).gt(worst);
            // Half-planes before the first that failed are satisfied.
            let concerned = is_infeasible & exists & is_worse & first.le(F32s::splat(simd, i as f32));
            if !concerned.any() {
                continue;
            }
            let projected = &mut projected[..i.max(self.n_hard)];
            let relaxed = &mut projected[self.n_hard..];
            for (other, projected) in half_planes[self.n_hard..].iter().zip(relaxed) {
                let (other, exists) = other.load(simd);
                let (between, applies) = half_plane.equal_violation(&other);
                projected.store(between, exists & applies);
            }
            let inward = Vec2s { x: -half_plane.direction.y, y: half_plane.direction.x };
            let farthest = inward * self.max_speed;
            let better = self.best_velocity(projected, Aim::Farthest(inward), farthest, concerned);
            // This is feasible up to rounding, because the velocity so far is a solution. If rounding makes
            // it fail, that velocity stays.
            velocities = (concerned & !better.is_infeasible).either(better.velocities, velocities);
            worst = concerned.select(half_plane.violation(velocities), worst);
        }
        velocities
    }
}

/// Velocities, and which programs are infeasible, because of the half-plane with that number.
#[derive(Clone, Copy)]
struct Solutions<S: InstructionSet> {
    velocities: Vec2s<S>,
    is_infeasible: Mask<S>,
    half_plane: F32s<S>,
}

impl<S: InstructionSet> HalfPlanes<S> {
    /// The half-planes whose boundary violates these and others equally, and where the two do not face the
    /// same way.
    #[inline(always)]
    fn equal_violation(&self, other: &HalfPlanes<S>) -> (HalfPlanes<S>, Mask<S>) {
        let simd = self.point.x.simd();
        // Two lines have equal distances along the bisector of their angle: it passes through their crossing,
        // in the direction of the difference of the two directions. If they are parallel it is the line in
        // the middle.
        let determinant = self.direction.perp_dot(other.direction);
        let are_parallel = determinant.abs().le(F32s::splat(simd, EPSILON));
        let face_one_way = are_parallel & self.direction.dot(other.direction).gt(F32s::splat(simd, 0.0));
        let at = other.direction.perp_dot(self.point - other.point).div(determinant);
        let middle = (self.point + other.point) * F32s::splat(simd, 0.5);
        let point = are_parallel.either(middle, self.point + self.direction * at);
        let direction = (other.direction - self.direction).normalize();
        (HalfPlanes { point, direction }, !face_one_way)
    }
}

/// A vector scaled to length 1, by the rounded reciprocal of its length.
#[cfg(test)]
pub(super) fn normalize(vector: Vec2) -> Vec2 {
    vector * (1.0 / vector.length())
}
