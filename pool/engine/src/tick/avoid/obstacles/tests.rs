//! Half-planes and the search for edges compared, to the bit, with the reference at every level.

use glam::Vec2;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use smaclite_scenarios::Terrain;

use super::super::linear_program::HalfPlane;
use super::reference::{self, Mover, sees};
use super::*;
use crate::arena::{EdgeSearch, EdgesByCell};
use crate::simd::{Kernel, Level, MAX_WIDTH};
use crate::tick::avoid::nearest_list::NearestList;

/// A unit, and the edges that it sees.
struct Scene {
    mover: Mover,
    edges: Vec<Edge>,
}

impl Scene {
    /// Edges of the grid near a unit, which may touch or overlap them; coordinates are often equal.
    fn random(random: &mut Pcg64Mcg) -> Scene {
        let mut coordinate = |scale: f32| match random.random_range(0..3) {
            0 => random.random_range(-4..=4) as f32 * 0.25 * scale,
            _ => random.random_range(-scale..scale),
        };
        let mut vector = |scale: f32| Vec2::new(coordinate(scale), coordinate(scale));
        let mover = Mover { position: vector(1.5), velocity: vector(3.0), radius: 0.375 };
        let n_edges = random.random_range(0..=4);
        let mut edge = || {
            let side = |random: &mut Pcg64Mcg| random.random_range(-3..=3) as f32;
            let (start, along) =
                (Vec2::new(side(random), side(random)), Vec2::AXES[random.random_range(0..2)]);
            let along = if random.random_range(0..2) == 0 { along } else { -along };
            let turn = [along, along.perp(), -along.perp()];
            Edge {
                start,
                end: start + along * random.random_range(1..=4) as f32,
                along,
                before: turn[random.random_range(0..3)],
                after: turn[random.random_range(0..3)],
            }
        };
        Scene { mover, edges: (0..n_edges).map(|_| edge()).collect() }
    }

    fn half_planes_by_reference(&self) -> Vec<HalfPlane> {
        let mut half_planes = Vec::new();
        for edge in &self.edges {
            half_planes.extend(reference::half_plane(&self.mover, edge, &half_planes));
        }
        half_planes
    }
}

/// Makes the half-planes of units together, as many as there are entries.
struct Together<'a> {
    scenes: &'a [Scene],
    half_planes: &'a mut Vec<Vec<HalfPlane>>,
}

impl Kernel for Together<'_> {
    #[inline(always)]
    fn run<S: InstructionSet>(self, simd: S) {
        for scenes in self.scenes.chunks(S::WIDTH) {
            let column = |of: &dyn Fn(&Scene) -> f32| {
                let mut column = Column::default();
                column.iter_mut().zip(scenes).for_each(|(x, scene)| *x = of(scene));
                column
            };
            let vectors = |of: &dyn Fn(&Scene) -> Vec2| [column(&|s| of(s).x), column(&|s| of(s).y)];
            let movers = Movers {
                position: Vec2s::load(simd, &vectors(&|s| s.mover.position)),
                velocity: Vec2s::load(simd, &vectors(&|s| s.mover.velocity)),
                radius: F32s::load(simd, &column(&|s| s.mover.radius)),
            };
            let n_rows = scenes.iter().map(|scene| scene.edges.len()).max().unwrap_or(0);
            let mut rows = vec![HalfPlaneColumns::default(); n_rows];
            for row in 0..n_rows {
                let mut edges = EdgeColumns::default();
                for (entry, scene) in scenes.iter().enumerate() {
                    if let Some(edge) = scene.edges.get(row) {
                        edges.set(entry, edge);
                    }
                }
                let is_there = column(&|s| f32::from(row < s.edges.len()));
                let (earlier, rest) = rows.split_at_mut(row);
                let (half_planes, exist) = keep_off(&movers, &edges);
                let is_there = F32s::load(simd, &is_there).gt(F32s::splat(simd, 0.0));
                let is_covered = are_covered(&movers, &edges, earlier);
                rest[0].store(half_planes, exist & is_there & !is_covered);
            }
            self.half_planes.extend((0..scenes.len()).map(|entry| {
                let vector = |[x, y]: &[Column; 2]| Vec2::new(x[entry], y[entry]);
                let half_plane = |row: &HalfPlaneColumns| HalfPlane {
                    point: vector(&row.point),
                    direction: vector(&row.direction),
                };
                rows.iter().filter(|row| row.exists[entry] == 1.0).map(half_plane).collect()
            }));
        }
    }
}

/// Looks for edges from each position.
struct Look<'a> {
    edges: &'a EdgesByCell,
    positions: &'a [Vec2],
    range_squared: f32,
    found: Vec<Vec<usize>>,
}

impl Kernel for &mut Look<'_> {
    #[inline(always)]
    fn run<S: InstructionSet>(self, simd: S) {
        let (mut search, mut found) = (EdgeSearch::default(), NearestList::default());
        found.reserve(self.edges.longest_list());
        for &position in self.positions {
            let mut cell = Column::default();
            self.edges.cells(Vec2s::splat(simd, position)).store(&mut cell);
            let near = self.edges.near(cell[0], &mut search);
            find(simd, position, near, self.range_squared, &mut found);
            self.found.push(found.indices().collect());
        }
    }
}

#[test]
fn edges_tested_together_are_those_that_are_seen_one_by_one() {
    let mut random = Pcg64Mcg::seed_from_u64(4);
    let mut coordinate = || match random.random_range(0..3) {
        0 => random.random_range(-2..=34) as f32,
        _ => random.random_range(-2.0..34.0),
    };
    let positions: Vec<Vec2> = (0..2000).map(|_| Vec2::new(coordinate(), coordinate())).collect();
    for terrain in Terrain::preset_names().filter_map(Terrain::preset) {
        let edges = EdgesByCell::new(&terrain, 3.5);
        let seen_from = |&position: &Vec2| -> Vec<usize> {
            let numbers = 0..edges.len();
            let seen = numbers.filter_map(|n| Some((sees(edges.edge(n as u32), position, 12.25)?, n)));
            let mut seen: Vec<_> = seen.collect();
            seen.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            seen.into_iter().map(|(_, number)| number).collect()
        };
        let expected: Vec<Vec<usize>> = positions.iter().map(seen_from).collect();
        for level in Level::available() {
            let (edges, positions) = (&edges, &positions[..]);
            let mut look = Look { edges, positions, range_squared: 12.25, found: Vec::new() };
            level.run(&mut look);
            for ((position, found), expected) in positions.iter().zip(&look.found).zip(&expected) {
                assert_eq!(found, expected, "{level:?}, {position}");
            }
        }
    }
}

#[test]
fn half_planes_made_together_have_the_bits_of_the_reference() {
    let mut random = Pcg64Mcg::seed_from_u64(3);
    let scenes: Vec<Scene> = (0..4000 * MAX_WIDTH).map(|_| Scene::random(&mut random)).collect();
    let expected: Vec<Vec<HalfPlane>> = scenes.iter().map(Scene::half_planes_by_reference).collect();
    let n_edges: usize = scenes.iter().map(|scene| scene.edges.len()).sum();
    let n_half_planes: usize = expected.iter().map(Vec::len).sum();
    assert!(
        n_half_planes > n_edges / 4 && n_half_planes < n_edges * 9 / 10,
        "some are covered, or their legs replaced"
    );
    for level in Level::available() {
        let mut half_planes = Vec::new();
        level.run(Together { scenes: &scenes, half_planes: &mut half_planes });
        for (i, (together, expected)) in half_planes.iter().zip(&expected).enumerate() {
            let bits = |all: &[HalfPlane]| -> Vec<u32> {
                let floats = all.iter().flat_map(|l| [l.point.x, l.point.y, l.direction.x, l.direction.y]);
                // A velocity exactly at a corner gives no direction but NaN, whose sign has no meaning.
                floats.map(|x| if x.is_nan() { f32::NAN.to_bits() } else { x.to_bits() }).collect()
            };
            assert_eq!(bits(together), bits(expected), "{level:?}, scene {i}: {together:?} and {expected:?}");
        }
    }
}
