//! The half-planes that obstacle edges impose on ground units, one per entry, and the search for edges.
//!
//! Derivation (the paper's section on static obstacles). An obstacle does not move and takes no share of the
//! avoidance, so the unit must avoid it alone. Seen from the unit, the velocity obstacle of an edge is the
//! set of velocities that lead to a collision within the horizon of 1 s: everything behind the edge as seen
//! from the unit (its *shadow*), widened by the radius. Its boundary has three parts: a leg from the left
//! corner, a leg from the right corner, and the *cut-off* between them, which is the edge itself. Both legs
//! are tangents of the discs of the unit's radius around the corners, and at the corners the boundary is an
//! arc of these discs.
//!
//! The permitted velocities are the half-plane outside the boundary at the point nearest to the current
//! velocity. This is done for every edge in sight, nearest first; edges that earlier half-planes cover
//! already are skipped.
//!
//! The outline of an obstacle is closed, and adjacent edges share a corner. Where a leg would point into the
//! adjacent edge, that edge bounds the shadow instead (a *foreign* leg), and its own half-plane does the
//! work.
//!
//! An entry cannot branch on its own: a case that applies to any entry is computed for all, and selected where
//! it applies. The tests have the same for one unit at a time, and compare the bits.

#[cfg(test)]
mod alone;

use glam::Vec2;

use super::EPSILON;
use super::linear_program::{HalfPlaneColumns, HalfPlanes};
use super::nearest_list::NearestList;
use super::neighbours::Movers;
use crate::arena::{Edge, EdgeBlock};
use crate::simd::{Column, F32s, InstructionSet, MAX_WIDTH, Mask, Vec2s};

/// Finds the edges of a list that a unit sees, nearest first, one edge per entry. `range` is a squared
/// distance.
#[inline(always)]
pub(super) fn find<S: InstructionSet>(
    simd: S,
    position: Vec2,
    near: &[EdgeBlock],
    range: f32,
    found: &mut NearestList,
) {
    found.clear();
    let position = Vec2s::splat(simd, position);
    let [zero, one, range] = [0.0, 1.0, range].map(
        #[inline(always)]
        |x| F32s::splat(simd, x),
    );
    let mut distances = Column::default();
    for block in near {
        for first in (0..MAX_WIDTH).step_by(S::WIDTH) {
            if block.numbers[first] == EdgeBlock::NO_EDGE {
                break;
            }
            let [start, end] = [&block.start, &block.end].map(
                #[inline(always)]
                |point| Vec2s::load_from(simd, point, first),
            );
            let span = end - start;
            // The list is that of the unit's square; the unit itself may be on the line of an edge, and sees
            // the outer side of edges only. Not that of an empty entry, of which the span is zero.
            let is_outside = (start - position).perp_dot(span).lt(zero);
            // The projection on the line, as a share of the edge: below 0 or above 1 the nearest point is an
            // end.
            let share = (position - start).dot(span).div(span.length_squared());
            let nearest = share.lt(zero).either(start, share.gt(one).either(end, start + span * share));
            let distance_squared = (position - nearest).length_squared();
            distance_squared.store(&mut distances);
            let mut seen = (is_outside & distance_squared.lt(range)).bits();
            while seen != 0 {
                let entry = seen.trailing_zeros() as usize;
                seen &= seen - 1;
                found.insert(distances[entry], block.numbers[first + entry] as usize);
            }
        }
    }
}

/// An edge that the unit of each entry sees, in memory.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct EdgeColumns {
    start: [Column; 2],
    end: [Column; 2],
    before: [Column; 2],
    along: [Column; 2],
    after: [Column; 2],
}

impl EdgeColumns {
    /// Sets the edge of an entry.
    #[inline(always)]
    pub fn set(&mut self, entry: usize, edge: &Edge) {
        let columns = [&mut self.start, &mut self.end, &mut self.before, &mut self.along, &mut self.after];
        for ([x, y], vector) in
            columns.into_iter().zip([edge.start, edge.end, edge.before, edge.along, edge.after])
        {
            (x[entry], y[entry]) = vector.into();
        }
    }
}

/// A corner of an obstacle, and the directions of the outline before and after it.
#[derive(Clone, Copy)]
struct Corner<S: InstructionSet> {
    /// Position relative to the unit.
    offset: Vec2s<S>,
    incoming: Vec2s<S>,
    outgoing: Vec2s<S>,
}

impl<S: InstructionSet> Corner<S> {
    #[inline(always)]
    fn either(is_this: Mask<S>, this: &Corner<S>, that: &Corner<S>) -> Corner<S> {
        Corner {
            offset: is_this.either(this.offset, that.offset),
            incoming: is_this.either(this.incoming, that.incoming),
            outgoing: is_this.either(this.outgoing, that.outgoing),
        }
    }
}

/// Half-planes, and in which entries there are any.
type Optional<S> = (HalfPlanes<S>, Mask<S>);

/// The first where the condition holds, elsewhere the second.
#[inline(always)]
fn either<S: InstructionSet>(is_this: Mask<S>, this: Optional<S>, that: Optional<S>) -> Optional<S> {
    let half_planes = HalfPlanes {
        point: is_this.either(this.0.point, that.0.point),
        direction: is_this.either(this.0.direction, that.0.direction),
    };
    (half_planes, is_this & this.1 | !is_this & that.1)
}

/// Where half-planes of nearer edges keep each unit off its edge already.
#[inline(always)]
pub(super) fn are_covered<S: InstructionSet>(
    movers: &Movers<S>,
    edges: &EdgeColumns,
    nearer: &[HalfPlaneColumns],
) -> Mask<S> {
    let (simd, radius) = (movers.radius.simd(), movers.radius);
    let zero = F32s::splat(simd, 0.0);
    let [start, end] = [&edges.start, &edges.end].map(
        #[inline(always)]
        |end| Vec2s::load(simd, end) - movers.position,
    );
    let mut are_covered = zero.lt(zero);
    for half_planes in nearer {
        let (half_planes, exist) = half_planes.load(simd);
        let both = covers(&half_planes, start, radius) & covers(&half_planes, end, radius);
        are_covered = are_covered | exist & both;
    }
    are_covered
}

/// The velocities that keep each unit off its edge for the time horizon, and where there are any: not where
/// the half-plane of an adjacent edge ensures that.
#[inline(always)]
pub(super) fn keep_off<S: InstructionSet>(movers: &Movers<S>, edges: &EdgeColumns) -> Optional<S> {
    let (simd, radius) = (movers.radius.simd(), movers.radius);
    let (zero, one) = (F32s::splat(simd, 0.0), F32s::splat(simd, 1.0));
    let origin = Vec2s { x: zero, y: zero };
    let everywhere = zero.le(zero);
    let [from, to] = [&edges.start, &edges.end].map(
        #[inline(always)]
        |end| Vec2s::load(simd, end),
    );
    let along = Vec2s::load(simd, &edges.along);
    let start = Corner {
        offset: from - movers.position,
        incoming: Vec2s::load(simd, &edges.before),
        outgoing: along,
    };
    let end =
        Corner { offset: to - movers.position, incoming: along, outgoing: Vec2s::load(simd, &edges.after) };
    // The position of the unit projected on the line of the edge, as a share of the edge.
    let radius_squared = radius * radius;
    let span = to - from;
    let share = (-start.offset).dot(span).div(span.length_squared());
    let (is_before, is_behind) = (share.lt(zero), share.gt(one));
    let touches_line = (-start.offset - span * share).length_squared().le(radius_squared);

    // A unit beside the edge and close to its line sees the edge end-on: only the nearer corner bounds the
    // shadow.
    let (only_start, only_end) = (is_before & touches_line, is_behind & touches_line);
    let shadow = Shadow::cast(
        &Corner::either(only_end, &end, &start),
        &Corner::either(only_start, &start, &end),
        only_start | only_end,
        radius,
    );
    let chosen = shadow.half_planes(movers.velocity, radius);

    // The unit touches the obstacle already, at a corner or along the edge. Then the velocity obstacle is a
    // half-plane, of which the boundary passes through velocity zero: do not come closer.
    let touches_edge = share.ge(zero) & share.lt(one) & touches_line;
    let mut chosen =
        either(touches_edge, (HalfPlanes { point: origin, direction: -along }, everywhere), chosen);
    // If the next edge is in view too, it is the one that keeps the unit off this corner.
    let touches_end = is_behind & end.offset.length_squared().le(radius_squared);
    if touches_end.any() {
        let keeps_off_end = end.offset.perp_dot(end.outgoing).ge(zero);
        chosen = either(touches_end, (away_from(end.offset), keeps_off_end), chosen);
    }
    let touches_start = is_before & start.offset.length_squared().le(radius_squared);
    if touches_start.any() {
        chosen = either(touches_start, (away_from(start.offset), everywhere), chosen);
    }
    chosen
}

/// Whether the half-planes already keep each unit off this point of an obstacle: whether all velocities that
/// reach the disc of the unit's radius around the point within 1 s are outside of it.
#[inline(always)]
fn covers<S: InstructionSet>(half_planes: &HalfPlanes<S>, offset: Vec2s<S>, radius: F32s<S>) -> Mask<S> {
    let distance = (offset - half_planes.point).perp_dot(half_planes.direction) - radius;
    distance.ge(F32s::splat(radius.simd(), -EPSILON))
}

/// The half-planes of units that touch a corner: velocities that do not come closer.
#[inline(always)]
fn away_from<S: InstructionSet>(corner: Vec2s<S>) -> HalfPlanes<S> {
    let zero = F32s::splat(corner.x.simd(), 0.0);
    HalfPlanes {
        point: Vec2s { x: zero, y: zero },
        direction: Vec2s { x: -corner.y, y: corner.x }.normalize(),
    }
}

/// The velocity obstacle of an edge before it is widened by the radius: two legs, and the cut-off between
/// them.
#[derive(Clone, Copy)]
struct Shadow<S: InstructionSet> {
    left: Leg<S>,
    right: Leg<S>,
    /// Direction of the outline at the left corner.
    along: Vec2s<S>,
    /// Whether both legs start at one corner; then there is no cut-off.
    single: Mask<S>,
}

#[derive(Clone, Copy)]
struct Leg<S: InstructionSet> {
    corner: Vec2s<S>,
    direction: Vec2s<S>,
    /// Whether the adjacent edge bounds the shadow instead; then the half-plane is left to that edge.
    foreign: Mask<S>,
}

impl<S: InstructionSet> Shadow<S> {
    #[inline(always)]
    fn cast(left: &Corner<S>, right: &Corner<S>, single: Mask<S>, radius: F32s<S>) -> Shadow<S> {
        Shadow {
            left: Leg::left(left, radius),
            right: Leg::right(right, radius),
            along: left.outgoing,
            single,
        }
    }

    /// The half-planes at the points of the shadows' boundaries nearest to the velocities.
    #[inline(always)]
    fn half_planes(&self, velocity: Vec2s<S>, radius: F32s<S>) -> Optional<S> {
        let simd = radius.simd();
        let [zero, half, one, infinite] = [0.0, 0.5, 1.0, f32::INFINITY].map(
            #[inline(always)]
            |x| F32s::splat(simd, x),
        );
        // Because the horizon is 1 s, a velocity is also the point that the unit reaches within the horizon,
        // and can be compared with the corners. Its projections decide which part of the boundary is nearest.
        let Shadow { left, right, along, single } = *self;
        let cutoff = right.corner - left.corner;
        let from_left = velocity - left.corner;
        let share = single.select(half, from_left.dot(cutoff).div(cutoff.length_squared()));
        let on_left = from_left.dot(left.direction);
        let on_right = (velocity - right.corner).dot(right.direction);
        // Behind the start of a leg and beside the cut-off: the nearest point is on the arc around the
        // corner.
        let rounds_left = on_left.lt(zero) & (share.lt(zero) | single & on_right.lt(zero));
        let rounds_right = share.gt(one) & on_right.lt(zero);

        // Otherwise it is on the nearest of the three lines, of those that the velocity projects onto. Of
        // equal distances the cut-off comes first, then the left leg.
        let is_beside = !single & share.ge(zero) & share.le(one);
        let to_cutoff =
            is_beside.select((velocity - (left.corner + cutoff * share)).length_squared(), infinite);
        let to_left = left.distance_squared(velocity, on_left);
        let to_right = right.distance_squared(velocity, on_right);
        let everywhere = zero.le(zero);
        // A foreign leg gives no half-plane: the adjacent edge gives one.
        let chosen = either(
            to_left.le(to_right),
            (widened(left.corner, left.direction, radius), !left.foreign),
            (widened(right.corner, -right.direction, radius), !right.foreign),
        );
        let is_cutoff = to_cutoff.le(to_left) & to_cutoff.le(to_right);
        let mut chosen = either(is_cutoff, (widened(left.corner, -along, radius), everywhere), chosen);
        if rounds_right.any() {
            chosen = either(rounds_right, (round_corner(right.corner, velocity, radius), everywhere), chosen);
        }
        if rounds_left.any() {
            chosen = either(rounds_left, (round_corner(left.corner, velocity, radius), everywhere), chosen);
        }
        chosen
    }
}

impl<S: InstructionSet> Leg<S> {
    /// The left tangent from each unit to the disc around a corner; see `neighbours::leg_escape` for the
    /// derivation. A leg that would point into the adjacent edge is replaced by the direction of that edge.
    #[inline(always)]
    fn left(corner: &Corner<S>, radius: F32s<S>) -> Leg<S> {
        let (offset, distance_squared) = (corner.offset, corner.offset.length_squared());
        let length = (distance_squared - radius * radius).sqrt();
        let direction =
            Vec2s { x: offset.x * length - offset.y * radius, y: offset.x * radius + offset.y * length }
                * distance_squared.recip();
        let adjacent = -corner.incoming;
        let foreign = direction.perp_dot(adjacent).ge(F32s::splat(radius.simd(), 0.0));
        Leg { corner: offset, direction: foreign.either(adjacent, direction), foreign }
    }

    /// The right tangent.
    #[inline(always)]
    fn right(corner: &Corner<S>, radius: F32s<S>) -> Leg<S> {
        let (offset, distance_squared) = (corner.offset, corner.offset.length_squared());
        let length = (distance_squared - radius * radius).sqrt();
        let direction =
            Vec2s { x: offset.x * length + offset.y * radius, y: -offset.x * radius + offset.y * length }
                * distance_squared.recip();
        let adjacent = corner.outgoing;
        let foreign = direction.perp_dot(adjacent).le(F32s::splat(radius.simd(), 0.0));
        Leg { corner: offset, direction: foreign.either(adjacent, direction), foreign }
    }

    /// The squared distances of velocities whose projections on the leg are `at`; infinite before the leg
    /// starts.
    #[inline(always)]
    fn distance_squared(&self, velocity: Vec2s<S>, at: F32s<S>) -> F32s<S> {
        let simd = at.simd();
        let distance_squared = (velocity - (self.corner + self.direction * at)).length_squared();
        at.lt(F32s::splat(simd, 0.0)).select(F32s::splat(simd, f32::INFINITY), distance_squared)
    }
}

/// The half-planes at the arc around a corner: the tangent of the disc at the point nearest to the velocity.
#[inline(always)]
fn round_corner<S: InstructionSet>(corner: Vec2s<S>, velocity: Vec2s<S>, radius: F32s<S>) -> HalfPlanes<S> {
    let outward = (velocity - corner).normalize();
    HalfPlanes { point: corner + outward * radius, direction: Vec2s { x: outward.y, y: -outward.x } }
}

/// The half-planes through `corner` along `direction`, moved out by the radius.
#[inline(always)]
fn widened<S: InstructionSet>(corner: Vec2s<S>, direction: Vec2s<S>, radius: F32s<S>) -> HalfPlanes<S> {
    let outward = Vec2s { x: -direction.y, y: direction.x };
    HalfPlanes { point: corner + outward * radius, direction }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;
    use smaclite_scenarios::Terrain;

    use super::super::linear_program::HalfPlane;
    use super::alone::{self, Mover, sees};
    use super::*;
    use crate::arena::{EdgeSearch, EdgesByCell};
    use crate::simd::{Kernel, Level};

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

        fn half_planes_alone(&self) -> Vec<HalfPlane> {
            let mut half_planes = Vec::new();
            for edge in &self.edges {
                half_planes.extend(alone::half_plane(&self.mover, edge, &half_planes));
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
            let alone = |&position: &Vec2| -> Vec<usize> {
                let numbers = 0..edges.len();
                let seen = numbers.filter_map(|n| Some((sees(edges.edge(n as u32), position, 12.25)?, n)));
                let mut seen: Vec<_> = seen.collect();
                seen.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                seen.into_iter().map(|(_, number)| number).collect()
            };
            let expected: Vec<Vec<usize>> = positions.iter().map(alone).collect();
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
    fn half_planes_made_together_have_the_bits_of_one_alone() {
        let mut random = Pcg64Mcg::seed_from_u64(3);
        let scenes: Vec<Scene> = (0..4000 * MAX_WIDTH).map(|_| Scene::random(&mut random)).collect();
        let alone: Vec<Vec<HalfPlane>> = scenes.iter().map(Scene::half_planes_alone).collect();
        let n_edges: usize = scenes.iter().map(|scene| scene.edges.len()).sum();
        let n_half_planes: usize = alone.iter().map(Vec::len).sum();
        assert!(
            n_half_planes > n_edges / 4 && n_half_planes < n_edges * 9 / 10,
            "some are covered or foreign"
        );
        for level in Level::available() {
            let mut half_planes = Vec::new();
            level.run(Together { scenes: &scenes, half_planes: &mut half_planes });
            for (i, (together, alone)) in half_planes.iter().zip(&alone).enumerate() {
                let bits = |all: &[HalfPlane]| -> Vec<u32> {
                    let floats =
                        all.iter().flat_map(|l| [l.point.x, l.point.y, l.direction.x, l.direction.y]);
                    // A velocity exactly at a corner gives no direction but NaN, whose sign has no meaning.
                    floats.map(|x| if x.is_nan() { f32::NAN.to_bits() } else { x.to_bits() }).collect()
                };
                assert_eq!(bits(together), bits(alone), "{level:?}, scene {i}: {together:?} and {alone:?}");
            }
        }
    }
}
