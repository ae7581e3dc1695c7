//! Four linear programs at a time, one a lane, of up to four lines of units each. They are solved as in `program`, but
//! no lane takes a branch of its own: all lines are gone through for all, and what does not apply is dropped.

use super::neighbours::FourLines;
use super::{EPSILON, Impeded};
use crate::lanes::{Floats, LANES, Vectors};

/// The programs of four units.
pub(super) struct Programs {
    /// One line of every unit an entry, those of the nearest neighbours first.
    lines: [FourLines; LANES],
    /// How far the neighbours are, squared; infinite where there is none.
    distances_squared: [Floats; LANES],
    preferred: Vectors,
    max_speed: Floats,
    /// The best velocities where there are no lines.
    unhindered: Vectors,
}

impl Programs {
    pub fn of([a, b, c, d]: [&Impeded; LANES]) -> Programs {
        let by_line = |quantity: fn(&Impeded) -> Floats| {
            Floats::transpose([quantity(a), quantity(b), quantity(c), quantity(d)])
        };
        let distances = by_line(|unit| unit.distances_squared);
        let (x, y) = (by_line(|unit| unit.lines.point.x), by_line(|unit| unit.lines.point.y));
        let along_x = by_line(|unit| unit.lines.direction.x);
        let along_y = by_line(|unit| unit.lines.direction.y);
        let row = |i: usize| Row { distance: distances[i], line: [x[i], y[i], along_x[i], along_y[i]] };
        let [mut first, mut second, mut third, mut fourth] = [row(0), row(1), row(2), row(3)];
        // Only neighbours change places, so those that are equal keep their order.
        order(&mut first, &mut second);
        order(&mut second, &mut third);
        order(&mut third, &mut fourth);
        order(&mut first, &mut second);
        order(&mut second, &mut third);
        order(&mut first, &mut second);
        let [preferred_x, preferred_y, unhindered_x, unhindered_y] = by_line(|unit| unit.wish);
        Programs {
            lines: [first.lines(), second.lines(), third.lines(), fourth.lines()],
            distances_squared: [first.distance, second.distance, third.distance, fourth.distance],
            preferred: Vectors { x: preferred_x, y: preferred_y },
            max_speed: Floats::new([a.max_speed, b.max_speed, c.max_speed, d.max_speed]),
            unhindered: Vectors { x: unhindered_x, y: unhindered_y },
        }
    }

    /// Which units have neighbours that are equally near.
    pub fn have_equals(&self) -> Floats {
        let [a, b, c, d] = self.distances_squared;
        let both = |near: Floats, far: Floats| near.simd_eq(far) & exists(near);
        both(a, b) | both(b, c) | both(c, d)
    }

    /// The velocities nearest to the preferred ones that are permitted, or else that violate lines the least deeply.
    pub fn solve(&self) -> Vectors {
        let are_there = self.distances_squared.map(exists);
        let nearest =
            optimum(&self.lines, &are_there, self.max_speed, Aim::Nearest(self.preferred), self.unhindered);
        if nearest.is_infeasible.any() { self.least_deep(&are_there, nearest) } else { nearest.velocities }
    }

    /// The velocities whose deepest violation of lines is least, where there is no permitted one.
    fn least_deep(&self, are_there: &[Floats; LANES], failed: Solutions) -> Vectors {
        let Solutions { mut velocities, is_infeasible, line: first } = failed;
        let mut deepest = Floats::ZERO;
        for (i, line) in self.lines.iter().enumerate() {
            let is_deeper = line.depth(velocities).simd_gt(deepest) & first.simd_le(Floats::splat(i as f32));
            let concerned = is_infeasible & are_there[i] & is_deeper;
            if !concerned.any() {
                continue;
            }
            let mut projected = [FourLines::default(); LANES];
            let mut are_projected = [Floats::ZERO; LANES];
            for (j, other) in self.lines[..i].iter().enumerate() {
                (projected[j], are_projected[j]) = equally_deep(line, other);
            }
            let inward = Vectors { x: -line.direction.y, y: line.direction.x };
            let aim = Aim::Farthest(inward);
            let better =
                optimum(&projected[..i], &are_projected[..i], self.max_speed, aim, inward * self.max_speed);
            // Failing here is a matter of rounding: the velocity so far lies within.
            velocities = Vectors::either(concerned & !better.is_infeasible, better.velocities, velocities);
            deepest = concerned.select(line.depth(velocities), deepest);
        }
        velocities
    }
}

/// What is looked for among the permitted velocities.
#[derive(Clone, Copy)]
enum Aim {
    Nearest(Vectors),
    /// The farthest in directions of length 1.
    Farthest(Vectors),
}

/// Velocities, and which of them are none, because the line of that number was infeasible.
struct Solutions {
    velocities: Vectors,
    is_infeasible: Floats,
    line: Floats,
}

/// The best velocities; `velocities` are the best where there are no lines. Not all lines are there for all.
#[inline(always)]
fn optimum(
    lines: &[FourLines],
    are_there: &[Floats],
    max_speed: Floats,
    aim: Aim,
    velocities: Vectors,
) -> Solutions {
    let mut solutions = Solutions { velocities, is_infeasible: Floats::ZERO, line: Floats::ZERO };
    for (i, line) in lines.iter().enumerate() {
        let is_violated = line.depth(solutions.velocities).simd_gt(Floats::ZERO);
        let concerned = is_violated & are_there[i] & !solutions.is_infeasible;
        if !concerned.any() {
            continue;
        }
        let (better, is_possible) = optimum_on(line, &lines[..i], &are_there[..i], max_speed, aim);
        solutions.velocities = Vectors::either(concerned & is_possible, better, solutions.velocities);
        let fails = concerned & !is_possible;
        solutions.is_infeasible |= fails;
        solutions.line = fails.select(Floats::splat(i as f32), solutions.line);
    }
    solutions
}

/// The best velocities on lines that satisfy all `earlier` ones, and whether there are any.
#[inline(always)]
fn optimum_on(
    line: &FourLines,
    earlier: &[FourLines],
    are_there: &[Floats],
    max_speed: Floats,
    aim: Aim,
) -> (Vectors, Floats) {
    let FourLines { point, direction } = *line;
    let along = point.dot(direction);
    let discriminant = along * along + max_speed * max_speed - point.length_squared();
    let mut is_impossible = discriminant.simd_lt(Floats::ZERO);
    let root = discriminant.sqrt();
    let (mut from, mut to) = (-along - root, -along + root);
    for (other, is_there) in earlier.iter().zip(are_there) {
        let denominator = direction.perp_dot(other.direction);
        let numerator = other.direction.perp_dot(point - other.point);
        let are_parallel = denominator.abs().simd_le(Floats::splat(EPSILON));
        is_impossible |= *is_there & are_parallel & numerator.simd_lt(Floats::ZERO);
        let crossing = numerator / denominator;
        let crosses = *is_there & !are_parallel;
        let is_end = denominator.simd_ge(Floats::ZERO);
        to = (crosses & is_end & crossing.simd_lt(to)).select(crossing, to);
        from = (crosses & !is_end & from.simd_lt(crossing)).select(crossing, from);
    }
    is_impossible |= from.simd_gt(to);
    let at = match aim {
        Aim::Farthest(aim) => aim.dot(direction).simd_gt(Floats::ZERO).select(to, from),
        Aim::Nearest(preferred) => {
            let nearest = direction.dot(preferred - point);
            nearest.simd_lt(from).select(from, nearest.simd_gt(to).select(to, nearest))
        }
    };
    (point + direction * at, !is_impossible)
}

/// The lines of velocities that violate both lines equally deeply, and whether they do not face the same way.
fn equally_deep(line: &FourLines, other: &FourLines) -> (FourLines, Floats) {
    let determinant = line.direction.perp_dot(other.direction);
    let are_parallel = determinant.abs().simd_le(Floats::splat(EPSILON));
    let face_one_way = are_parallel & line.direction.dot(other.direction).simd_gt(Floats::ZERO);
    let at = other.direction.perp_dot(line.point - other.point) / determinant;
    let middle = (line.point + other.point) * Floats::splat(0.5);
    let point = Vectors::either(are_parallel, middle, line.point + line.direction * at);
    let difference = other.direction - line.direction;
    let direction = difference * (Floats::ONE / difference.length_squared().sqrt());
    (FourLines { point, direction }, !face_one_way)
}

/// A line of every unit.
struct Row {
    distance: Floats,
    /// Point and direction.
    line: [Floats; 4],
}

impl Row {
    fn lines(&self) -> FourLines {
        let [x, y, along_x, along_y] = self.line;
        FourLines { point: Vectors { x, y }, direction: Vectors { x: along_x, y: along_y } }
    }
}

/// Puts the nearer before the farther, in every lane for itself.
#[inline(always)]
fn order(near: &mut Row, far: &mut Row) {
    let is_wrong = far.distance.simd_lt(near.distance);
    let swap = |a: &mut Floats, b: &mut Floats| {
        let difference = (*a ^ *b) & is_wrong;
        (*a, *b) = (*a ^ difference, *b ^ difference);
    };
    swap(&mut near.distance, &mut far.distance);
    for i in 0..4 {
        swap(&mut near.line[i], &mut far.line[i]);
    }
}

/// Whether there is a neighbour.
fn exists(distance_squared: Floats) -> Floats {
    distance_squared.simd_lt(Floats::splat(f32::INFINITY))
}

#[cfg(test)]
mod tests {
    use super::super::program::{self, Line};
    use super::*;
    use glam::Vec2;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    struct Unit {
        lines: Vec<Line>,
        preferred: Vec2,
        max_speed: f32,
    }

    impl Unit {
        /// Of up to four lines; some are parallel or the same, and some leave no velocity.
        fn random(random: &mut Pcg64Mcg) -> Unit {
            let n_lines = random.random_range(0..=LANES);
            let angle = |random: &mut Pcg64Mcg| match random.random_range(0..3) {
                0 => random.random_range(0..4) as f32 * std::f32::consts::FRAC_PI_2,
                _ => random.random_range(0.0..std::f32::consts::TAU),
            };
            let mut line = || Line {
                point: Vec2::from_angle(angle(random)) * random.random_range(0.0..4.0),
                direction: Vec2::from_angle(angle(random)),
            };
            let lines = (0..n_lines).map(|_| line()).collect();
            let preferred = Vec2::from_angle(angle(random)) * random.random_range(0.1..3.5);
            Unit { lines, preferred, max_speed: 3.15 }
        }

        /// Its lines in any order, as they are found.
        fn impeded(&self, random: &mut Pcg64Mcg) -> Impeded {
            let mut seats: Vec<usize> = (0..self.lines.len()).collect();
            for i in (1..seats.len()).rev() {
                seats.swap(i, random.random_range(0..=i));
            }
            let (mut columns, mut distances) = ([[f32::NAN; LANES]; 4], [f32::INFINITY; LANES]);
            for (rank, (line, &seat)) in self.lines.iter().zip(&seats).enumerate() {
                let Line { point, direction } = line;
                let row = [point.x, point.y, direction.x, direction.y];
                columns.iter_mut().zip(row).for_each(|(column, x)| column[seat] = x);
                distances[seat] = 0.25 * (rank + 1) as f32;
            }
            let [x, y, along_x, along_y] = columns.map(Floats::new);
            let unhindered = program::within(self.max_speed, self.preferred);
            Impeded {
                place: 0,
                id: 0,
                lines: FourLines { point: Vectors { x, y }, direction: Vectors { x: along_x, y: along_y } },
                distances_squared: Floats::new(distances),
                wish: Floats::new([self.preferred.x, self.preferred.y, unhindered.x, unhindered.y]),
                max_speed: self.max_speed,
            }
        }
    }

    #[test]
    fn each_of_four_has_the_bits_of_one_alone() {
        let mut random = Pcg64Mcg::seed_from_u64(1);
        let mut hindered = [0, 0];
        for round in 0..20_000 {
            let units: [Unit; LANES] = std::array::from_fn(|_| Unit::random(&mut random));
            let impeded = units.each_ref().map(|unit| unit.impeded(&mut random));
            let velocities = Programs::of(impeded.each_ref()).solve();
            for (lane, unit) in units.iter().enumerate() {
                let Unit { lines, preferred, max_speed } = unit;
                let alone = program::solve(lines, 0, *max_speed, *preferred, &mut Vec::new());
                let bits = |velocity: Vec2| velocity.to_array().map(f32::to_bits);
                let same = bits(velocities.lane(lane)) == bits(alone);
                assert!(same, "{round}: {} and {alone}", velocities.lane(lane));
                let permitted = lines.iter().all(|l| l.direction.perp_dot(l.point - alone) <= 1e-3);
                hindered[usize::from(!permitted)] += usize::from(alone != *preferred);
            }
        }
        assert!(hindered.iter().all(|n| *n > 10_000), "both kinds of program: {hindered:?}");
    }

    #[test]
    fn equals_keep_their_order_and_are_told() {
        let mut random = Pcg64Mcg::seed_from_u64(2);
        let unit = Unit {
            lines: vec![Line { point: Vec2::ZERO, direction: Vec2::X }; 3],
            preferred: Vec2::X,
            max_speed: 1.0,
        };
        let mut impeded = unit.impeded(&mut random);
        impeded.distances_squared = Floats::new([2.0, 1.0, 2.0, f32::INFINITY]);
        impeded.lines.point.x = Floats::new([1.0, 2.0, 3.0, 4.0]);
        let alone = unit.impeded(&mut random);
        let programs = Programs::of([&alone, &impeded, &alone, &alone]);
        assert_eq!(programs.have_equals().to_bitmask(), 0b0010);
        assert_eq!(programs.lines.map(|line| line.point.x.to_array()[1]), [2.0, 1.0, 3.0, 4.0]);
    }
}
