//! Four linear programs at a time, each with up to four half-planes of units.
//!
//! They are solved as in the parent module, one program per entry of the registers. An entry cannot branch on
//! its own: every half-plane is processed for all four programs, and masks select the results that apply. A
//! test compares the bits.
//!
//! Functions have the names and the order of computation of the parent module; its comments derive them.

use glam::Vec2;

use super::super::neighbours::HalfPlaneX4;
use super::super::{Constrained, EPSILON};
use crate::simd::{F32x4, Mask, Vec2x4, WIDTH};

/// The programs of four units.
pub(in super::super) struct LinearProgramX4 {
    /// One half-plane of each unit per entry, those of the nearest neighbours first.
    half_planes: [HalfPlaneX4; WIDTH],
    /// The squared distances of the neighbours; infinite where there is none.
    distances_squared: [F32x4; WIDTH],
    preferred: Vec2x4,
    max_speed: F32x4,
    /// The best velocities without half-planes.
    unconstrained: Vec2x4,
}

impl LinearProgramX4 {
    pub fn of([a, b, c, d]: [&Constrained; WIDTH]) -> LinearProgramX4 {
        // In `Constrained` a register has one quantity of four neighbours of one unit; here it has one
        // quantity of one neighbour of each of four units. So every quantity is transposed.
        let transposed = |quantity: fn(&Constrained) -> F32x4| {
            F32x4::transpose([quantity(a), quantity(b), quantity(c), quantity(d)])
        };
        let distances = transposed(|unit| unit.distances_squared);
        let (x, y) =
            (transposed(|unit| unit.half_planes.point.x), transposed(|unit| unit.half_planes.point.y));
        let along_x = transposed(|unit| unit.half_planes.direction.x);
        let along_y = transposed(|unit| unit.half_planes.direction.y);
        let row = |i: usize| Row { distance: distances[i], half_plane: [x[i], y[i], along_x[i], along_y[i]] };
        let [mut first, mut second, mut third, mut fourth] = [row(0), row(1), row(2), row(3)];
        // The order of the half-planes decides the rounding, so the nearest neighbours come first. A bubble
        // sort exchanges adjacent rows only, so equally near neighbours keep their order.
        order(&mut first, &mut second);
        order(&mut second, &mut third);
        order(&mut third, &mut fourth);
        order(&mut first, &mut second);
        order(&mut second, &mut third);
        order(&mut first, &mut second);
        let vectors = |quantity: fn(&Constrained) -> Vec2| {
            Vec2x4::new([quantity(a), quantity(b), quantity(c), quantity(d)])
        };
        LinearProgramX4 {
            half_planes: [
                first.half_planes(),
                second.half_planes(),
                third.half_planes(),
                fourth.half_planes(),
            ],
            distances_squared: [first.distance, second.distance, third.distance, fourth.distance],
            preferred: vectors(|unit| unit.preferred),
            max_speed: F32x4::new([a.max_speed, b.max_speed, c.max_speed, d.max_speed]),
            unconstrained: vectors(|unit| unit.unconstrained),
        }
    }

    /// Which units have neighbours that are equally near.
    pub fn have_equals(&self) -> Mask {
        let [a, b, c, d] = self.distances_squared;
        let both = |near: F32x4, far: F32x4| near.simd_eq(far) & exists(near);
        both(a, b) | both(b, c) | both(c, d)
    }

    /// The permitted velocities nearest to the preferred ones, else those that violate the half-planes least.
    pub fn solve(&self) -> Vec2x4 {
        let are_there = self.distances_squared.map(exists);
        let nearest = best_velocity(
            &self.half_planes,
            &are_there,
            self.max_speed,
            Aim::Nearest(self.preferred),
            self.unconstrained,
        );
        if nearest.is_infeasible.any() {
            self.least_violation(&are_there, nearest)
        } else {
            nearest.velocities
        }
    }

    /// The velocities whose worst violation of half-planes is least, where there is no permitted one.
    fn least_violation(&self, are_there: &[Mask; WIDTH], failed: Solutions) -> Vec2x4 {
        let Solutions { mut velocities, is_infeasible, half_plane: first } = failed;
        let mut worst = F32x4::ZERO;
        for (i, half_plane) in self.half_planes.iter().enumerate() {
            // `first <= i` does what `skip(first)` does in the scalar loop: earlier half-planes are
            // satisfied.
            let is_worse =
                half_plane.violation(velocities).simd_gt(worst) & first.simd_le(F32x4::splat(i as f32));
            let concerned = is_infeasible & are_there[i] & is_worse;
            if !concerned.any() {
                continue;
            }
            let mut projected = [HalfPlaneX4::default(); WIDTH];
            let mut are_projected = [F32x4::ZERO; WIDTH];
            for (j, other) in self.half_planes[..i].iter().enumerate() {
                (projected[j], are_projected[j]) = equal_violation(half_plane, other);
            }
            let inward = Vec2x4 { x: -half_plane.direction.y, y: half_plane.direction.x };
            let aim = Aim::Farthest(inward);
            let better = best_velocity(
                &projected[..i],
                &are_projected[..i],
                self.max_speed,
                aim,
                inward * self.max_speed,
            );
            // If rounding makes it infeasible, the velocity so far stays, as in the scalar program.
            velocities = Vec2x4::either(concerned & !better.is_infeasible, better.velocities, velocities);
            worst = concerned.select(half_plane.violation(velocities), worst);
        }
        velocities
    }
}

/// The objective: which of the permitted velocities is best.
#[derive(Clone, Copy)]
enum Aim {
    Nearest(Vec2x4),
    /// The farthest in directions of length 1.
    Farthest(Vec2x4),
}

/// Velocities, and which programs are infeasible, because of the half-plane with that number.
struct Solutions {
    velocities: Vec2x4,
    is_infeasible: Mask,
    half_plane: F32x4,
}

/// The best velocities; `velocities` are the best without half-planes. `are_there` masks the half-planes that
/// exist.
#[inline(always)]
fn best_velocity(
    half_planes: &[HalfPlaneX4],
    are_there: &[Mask],
    max_speed: F32x4,
    aim: Aim,
    velocities: Vec2x4,
) -> Solutions {
    let mut solutions = Solutions { velocities, is_infeasible: F32x4::ZERO, half_plane: F32x4::ZERO };
    for (i, half_plane) in half_planes.iter().enumerate() {
        // A program that is infeasible already stays as it is: its velocity is that without the half-plane.
        let is_violated = half_plane.violation(solutions.velocities).simd_gt(F32x4::ZERO);
        let concerned = is_violated & are_there[i] & !solutions.is_infeasible;
        if !concerned.any() {
            continue;
        }
        let (better, is_feasible) =
            best_on_boundary(half_plane, &half_planes[..i], &are_there[..i], max_speed, aim);
        solutions.velocities = Vec2x4::either(concerned & is_feasible, better, solutions.velocities);
        let fails = concerned & !is_feasible;
        solutions.is_infeasible |= fails;
        solutions.half_plane = fails.select(F32x4::splat(i as f32), solutions.half_plane);
    }
    solutions
}

/// The best velocities on the boundaries of half-planes that satisfy all `earlier` ones, and where there are
/// any.
#[inline(always)]
fn best_on_boundary(
    half_plane: &HalfPlaneX4,
    earlier: &[HalfPlaneX4],
    are_there: &[Mask],
    max_speed: F32x4,
    aim: Aim,
) -> (Vec2x4, Mask) {
    let HalfPlaneX4 { point, direction } = *half_plane;
    let along = point.dot(direction);
    let discriminant = along * along + max_speed * max_speed - point.length_squared();
    // Where the discriminant is negative the root is NaN. All comparisons with it are false, and the mask
    // drops the result.
    let mut is_infeasible = discriminant.simd_lt(F32x4::ZERO);
    let root = discriminant.sqrt();
    let (mut from, mut to) = (-along - root, -along + root);
    for (other, is_there) in earlier.iter().zip(are_there) {
        let denominator = direction.perp_dot(other.direction);
        let numerator = other.direction.perp_dot(point - other.point);
        let are_parallel = denominator.abs().simd_le(F32x4::splat(EPSILON));
        is_infeasible |= *is_there & are_parallel & numerator.simd_lt(F32x4::ZERO);
        let crossing = numerator / denominator;
        let crosses = *is_there & !are_parallel;
        // Parallel boundaries divide by nearly zero; `crosses` drops the result.
        let is_end = denominator.simd_ge(F32x4::ZERO);
        to = (crosses & is_end & crossing.simd_lt(to)).select(crossing, to);
        from = (crosses & !is_end & from.simd_lt(crossing)).select(crossing, from);
    }
    // The scalar program tests this after every half-plane. The interval only shrinks, so once is enough.
    is_infeasible |= from.simd_gt(to);
    let at = match aim {
        Aim::Farthest(aim) => aim.dot(direction).simd_gt(F32x4::ZERO).select(to, from),
        Aim::Nearest(preferred) => {
            let nearest = direction.dot(preferred - point);
            nearest.simd_lt(from).select(from, nearest.simd_gt(to).select(to, nearest))
        }
    };
    (point + direction * at, !is_infeasible)
}

/// The half-planes whose boundary violates both half-planes equally, and where they do not face the same way.
fn equal_violation(half_plane: &HalfPlaneX4, other: &HalfPlaneX4) -> (HalfPlaneX4, Mask) {
    let determinant = half_plane.direction.perp_dot(other.direction);
    let are_parallel = determinant.abs().simd_le(F32x4::splat(EPSILON));
    let face_one_way = are_parallel & half_plane.direction.dot(other.direction).simd_gt(F32x4::ZERO);
    let at = other.direction.perp_dot(half_plane.point - other.point) / determinant;
    let middle = (half_plane.point + other.point) * F32x4::splat(0.5);
    let point = Vec2x4::either(are_parallel, middle, half_plane.point + half_plane.direction * at);
    let difference = other.direction - half_plane.direction;
    let direction = difference * (F32x4::ONE / difference.length_squared().sqrt());
    (HalfPlaneX4 { point, direction }, !face_one_way)
}

/// A half-plane of each unit.
struct Row {
    distance: F32x4,
    /// Point and direction.
    half_plane: [F32x4; 4],
}

impl Row {
    fn half_planes(&self) -> HalfPlaneX4 {
        let [x, y, along_x, along_y] = self.half_plane;
        HalfPlaneX4 { point: Vec2x4 { x, y }, direction: Vec2x4 { x: along_x, y: along_y } }
    }
}

/// Puts the nearer row before the farther one, independently for each unit.
#[inline(always)]
fn order(near: &mut Row, far: &mut Row) {
    let is_wrong = far.distance.simd_lt(near.distance);
    let swap = |a: &mut F32x4, b: &mut F32x4| {
        // Exchanges the bits that differ, where the mask is set.
        let difference = (*a ^ *b) & is_wrong;
        (*a, *b) = (*a ^ difference, *b ^ difference);
    };
    swap(&mut near.distance, &mut far.distance);
    for i in 0..4 {
        swap(&mut near.half_plane[i], &mut far.half_plane[i]);
    }
}

/// Whether there is a neighbour.
fn exists(distance_squared: F32x4) -> Mask {
    distance_squared.simd_lt(F32x4::splat(f32::INFINITY))
}

#[cfg(test)]
mod tests {
    use super::super::{self as linear_program, HalfPlane};
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    struct Unit {
        half_planes: Vec<HalfPlane>,
        preferred: Vec2,
        max_speed: f32,
    }

    impl Unit {
        /// With up to four half-planes; some are parallel or the same, and some leave no velocity.
        fn random(random: &mut Pcg64Mcg) -> Unit {
            let n_half_planes = random.random_range(0..=WIDTH);
            let angle = |random: &mut Pcg64Mcg| match random.random_range(0..3) {
                0 => random.random_range(0..4) as f32 * std::f32::consts::FRAC_PI_2,
                _ => random.random_range(0.0..std::f32::consts::TAU),
            };
            let mut half_plane = || HalfPlane {
                point: Vec2::from_angle(angle(random)) * random.random_range(0.0..4.0),
                direction: Vec2::from_angle(angle(random)),
            };
            let half_planes = (0..n_half_planes).map(|_| half_plane()).collect();
            let preferred = Vec2::from_angle(angle(random)) * random.random_range(0.1..3.5);
            Unit { half_planes, preferred, max_speed: 3.15 }
        }

        /// Its half-planes in any order, as they are found.
        fn constrained(&self, random: &mut Pcg64Mcg) -> Constrained {
            let mut slots: Vec<usize> = (0..self.half_planes.len()).collect();
            for i in (1..slots.len()).rev() {
                slots.swap(i, random.random_range(0..=i));
            }
            let (mut columns, mut distances) = ([[f32::NAN; WIDTH]; 4], [f32::INFINITY; WIDTH]);
            for (rank, (half_plane, &slot)) in self.half_planes.iter().zip(&slots).enumerate() {
                let HalfPlane { point, direction } = half_plane;
                let row = [point.x, point.y, direction.x, direction.y];
                columns.iter_mut().zip(row).for_each(|(column, x)| column[slot] = x);
                distances[slot] = 0.25 * (rank + 1) as f32;
            }
            let [x, y, along_x, along_y] = columns.map(F32x4::new);
            Constrained {
                index: 0,
                id: 0,
                half_planes: HalfPlaneX4 {
                    point: Vec2x4 { x, y },
                    direction: Vec2x4 { x: along_x, y: along_y },
                },
                distances_squared: F32x4::new(distances),
                preferred: self.preferred,
                unconstrained: linear_program::within(self.max_speed, self.preferred),
                max_speed: self.max_speed,
            }
        }
    }

    #[test]
    fn each_of_four_has_the_bits_of_one_alone() {
        let mut random = Pcg64Mcg::seed_from_u64(1);
        let mut hindered = [0, 0];
        for round in 0..20_000 {
            let units: [Unit; WIDTH] = std::array::from_fn(|_| Unit::random(&mut random));
            let constrained = units.each_ref().map(|unit| unit.constrained(&mut random));
            let velocities = LinearProgramX4::of(constrained.each_ref()).solve();
            for (i, unit) in units.iter().enumerate() {
                let Unit { half_planes, preferred, max_speed } = unit;
                let alone = linear_program::solve(half_planes, 0, *max_speed, *preferred, &mut Vec::new());
                let bits = |velocity: Vec2| velocity.to_array().map(f32::to_bits);
                let same = bits(velocities.extract(i)) == bits(alone);
                assert!(same, "{round}: {} and {alone}", velocities.extract(i));
                let permitted = half_planes.iter().all(|l| l.direction.perp_dot(l.point - alone) <= 1e-3);
                hindered[usize::from(!permitted)] += usize::from(alone != *preferred);
            }
        }
        assert!(hindered.iter().all(|n| *n > 10_000), "both kinds of program: {hindered:?}");
    }

    #[test]
    fn equals_keep_their_order_and_are_reported() {
        let mut random = Pcg64Mcg::seed_from_u64(2);
        let unit = Unit {
            half_planes: vec![HalfPlane { point: Vec2::ZERO, direction: Vec2::X }; 3],
            preferred: Vec2::X,
            max_speed: 1.0,
        };
        let mut constrained = unit.constrained(&mut random);
        constrained.distances_squared = F32x4::new([2.0, 1.0, 2.0, f32::INFINITY]);
        constrained.half_planes.point.x = F32x4::new([1.0, 2.0, 3.0, 4.0]);
        let alone = unit.constrained(&mut random);
        let programs = LinearProgramX4::of([&alone, &constrained, &alone, &alone]);
        assert_eq!(programs.have_equals().to_bitmask(), 0b0010);
        assert_eq!(
            programs.half_planes.map(|half_plane| half_plane.point.x.to_array()[1]),
            [2.0, 1.0, 3.0, 4.0]
        );
    }
}
