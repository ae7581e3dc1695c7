//! Programs solved together compared, to the bit, with the reference at every level.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::*;
use crate::simd::{Kernel, Level, MAX_WIDTH};

/// The program of one unit.
struct Program {
    half_planes: Vec<HalfPlane>,
    n_hard: usize,
    preferred: Vec2,
    max_speed: f32,
}

impl Program {
    /// Some half-planes are parallel or the same, and some leave no velocity.
    fn random(random: &mut Pcg64Mcg) -> Program {
        let n = random.random_range(0..=9);
        let angle = |random: &mut Pcg64Mcg| match random.random_range(0..3) {
            0 => random.random_range(0..4) as f32 * std::f32::consts::FRAC_PI_2,
            _ => random.random_range(0.0..std::f32::consts::TAU),
        };
        let mut half_plane = || HalfPlane {
            point: Vec2::from_angle(angle(random)) * random.random_range(0.0..4.0),
            direction: Vec2::from_angle(angle(random)),
        };
        let half_planes = (0..n).map(|_| half_plane()).collect();
        let n_hard = random.random_range(0..=3).min(n) * random.random_range(0..=1);
        let preferred = Vec2::from_angle(angle(random)) * random.random_range(0.1..3.5);
        Program { half_planes, n_hard, preferred, max_speed: random.random_range(1.0..4.0) }
    }

    fn solve_by_reference(&self) -> Vec2 {
        reference::solve(&self.half_planes, self.n_hard, self.max_speed, self.preferred)
    }
}

/// Solves programs together, as many as there are entries.
struct Together<'a> {
    programs: &'a [Program],
    solutions: &'a mut Vec<Vec2>,
}

impl Kernel for Together<'_> {
    #[inline(always)]
    fn run<S: InstructionSet>(self, simd: S) {
        for programs in self.programs.chunks(S::WIDTH) {
            let column = |of: &dyn Fn(&Program) -> f32| {
                let mut column = Column::default();
                column.iter_mut().zip(programs).for_each(|(x, program)| *x = of(program));
                column
            };
            let n_hard = programs.iter().map(|program| program.n_hard).max().unwrap_or(0);
            let n_relaxed = programs.iter().map(|p| p.half_planes.len() - p.n_hard).max().unwrap_or(0);
            // The number in a program of the half-plane in a row.
            let number = |p: &Program, row: usize| match row {
                _ if row >= n_hard => Some(row - n_hard + p.n_hard),
                _ => Some(row).filter(|row| *row < p.n_hard),
            };
            let in_row = |p: &Program, row| number(p, row).and_then(|i| p.half_planes.get(i)).copied();
            // Entries without a half-plane in this row have one that must not count.
            let unused = HalfPlane { point: Vec2::X, direction: Vec2::NEG_X };
            let rows: Vec<_> = (0..n_hard + n_relaxed)
                .map(|i| {
                    let get = |program: &Program| in_row(program, i).unwrap_or(unused);
                    HalfPlaneColumns {
                        point: [column(&|p| get(p).point.x), column(&|p| get(p).point.y)],
                        direction: [column(&|p| get(p).direction.x), column(&|p| get(p).direction.y)],
                        exists: column(&|p| f32::from(in_row(p, i).is_some())),
                    }
                })
                .collect();
            let preferred = [column(&|p| p.preferred.x), column(&|p| p.preferred.y)];
            let preferred = Vec2s::load(simd, &preferred);
            let max_speed = F32s::load(simd, &column(&|p| p.max_speed));
            let all = Programs { preferred, unconstrained: preferred.within(max_speed), max_speed, n_hard };
            let mut solved = [Column::default(); 2];
            all.solve(&rows, &mut rows.clone()).store(&mut solved);
            let [x, y] = solved;
            self.solutions.extend((0..programs.len()).map(|entry| Vec2::new(x[entry], y[entry])));
        }
    }
}

#[test]
fn programs_solved_together_have_the_bits_of_the_reference() {
    let mut random = Pcg64Mcg::seed_from_u64(1);
    let programs: Vec<Program> = (0..1000 * MAX_WIDTH).map(|_| Program::random(&mut random)).collect();
    let expected: Vec<Vec2> = programs.iter().map(Program::solve_by_reference).collect();
    let mut hindered = [0, 0];
    for (program, velocity) in programs.iter().zip(&expected) {
        let is_permitted = |l: &HalfPlane| l.direction.perp_dot(l.point - *velocity) <= 1e-3;
        let permitted = program.half_planes.iter().all(is_permitted);
        hindered[usize::from(!permitted)] += usize::from(*velocity != program.preferred);
    }
    assert!(hindered.iter().all(|n| *n > 3_000), "both kinds of program: {hindered:?}");
    for level in Level::available() {
        let mut solutions = Vec::new();
        level.run(Together { programs: &programs, solutions: &mut solutions });
        for (i, (together, expected)) in solutions.iter().zip(&expected).enumerate() {
            let bits = |velocity: &Vec2| velocity.to_array().map(f32::to_bits);
            assert_eq!(bits(together), bits(expected), "{level:?}, program {i}: {together} and {expected}");
        }
        assert_eq!(solutions.len(), programs.len());
    }
}
