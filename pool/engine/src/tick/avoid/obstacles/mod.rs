//! The half-planes that obstacle edges impose on ground units, one per lane, and the search for edges.
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
//! A lane cannot branch on its own: a case that applies to any lane is computed for all, and selected where
//! it applies. The tests have the same for one unit at a time, and compare the bits.

#[cfg(test)]
mod alone;

use glam::Vec2;

use super::EPSILON;
use super::linear_program::{HalfPlaneColumns, HalfPlanes};
use super::nearest_list::NearestList;
use super::neighbours::Movers;
use crate::arena::{Edge, EdgeBlock};
use crate::lanes::{Column, Floats, Lanes, MAX_LANES, Mask, Vectors};

/// Finds the edges of a list that a unit sees, nearest first, one edge per lane. `range` is a squared
/// distance.
#[inline(always)]
pub(super) fn find<S: Lanes>(
    simd: S,
    position: Vec2,
    near: &[EdgeBlock],
    range: f32,
    found: &mut NearestList,
) {
    found.clear();
    let position = Vectors::splat(simd, position);
    let [zero, one, range] = [0.0, 1.0, range].map(
        #[inline(always)]
        |x| Floats::splat(simd, x),
    );
    let mut distances = Column::default();
    for block in near {
        for first in (0..MAX_LANES).step_by(S::F32_LANES) {
            if block.numbers[first] == EdgeBlock::NO_EDGE {
                break;
            }
            let [start, end] = [&block.start, &block.end].map(
                #[inline(always)]
                |point| Vectors::load_from(simd, point, first),
            );
            let span = end - start;
            // The list is that of the unit's square; the unit itself may be on the line of an edge, and sees
            // the outer side of edges only. Not that of an empty lane, of which the span is zero.
            let is_outside = (start - position).perp_dot(span).lt(zero);
            // The projection on the line, as a share of the edge: below 0 or above 1 the nearest point is an
            // end.
            let share = (position - start).dot(span).div(span.length_squared());
            let nearest = share.lt(zero).either(start, share.gt(one).either(end, start + span * share));
            let distance_squared = (position - nearest).length_squared();
            distance_squared.store(&mut distances);
            let mut seen = (is_outside & distance_squared.lt(range)).bits();
            while seen != 0 {
                let lane = seen.trailing_zeros() as usize;
                seen &= seen - 1;
                found.insert(distances[lane], block.numbers[first + lane] as usize);
            }
        }
    }
}

/// An edge that the unit of each lane sees, in memory.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct EdgeColumns {
    start: [Column; 2],
    end: [Column; 2],
    before: [Column; 2],
    along: [Column; 2],
    after: [Column; 2],
}

impl EdgeColumns {
    /// Sets the edge of a lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, edge: &Edge) {
        let columns = [&mut self.start, &mut self.end, &mut self.before, &mut self.along, &mut self.after];
        for ([x, y], vector) in
            columns.into_iter().zip([edge.start, edge.end, edge.before, edge.along, edge.after])
        {
            (x[lane], y[lane]) = vector.into();
        }
    }
}

/// A corner of an obstacle, and the directions of the outline before and after it.
#[derive(Clone, Copy)]
struct Corner<S: Lanes> {
    /// Position relative to the unit.
    offset: Vectors<S>,
    incoming: Vectors<S>,
    outgoing: Vectors<S>,
}

impl<S: Lanes> Corner<S> {
    #[inline(always)]
    fn either(is_this: Mask<S>, this: &Corner<S>, that: &Corner<S>) -> Corner<S> {
        Corner {
            offset: is_this.either(this.offset, that.offset),
            incoming: is_this.either(this.incoming, that.incoming),
            outgoing: is_this.either(this.outgoing, that.outgoing),
        }
    }
}

/// Half-planes, and in which lanes there are any.
type Optional<S> = (HalfPlanes<S>, Mask<S>);

/// The first where the condition holds, elsewhere the second.
#[inline(always)]
fn either<S: Lanes>(is_this: Mask<S>, this: Optional<S>, that: Optional<S>) -> Optional<S> {
    let half_planes = HalfPlanes {
        point: is_this.either(this.0.point, that.0.point),
        direction: is_this.either(this.0.direction, that.0.direction),
    };
    (half_planes, is_this & this.1 | !is_this & that.1)
}

/// Where half-planes of nearer edges keep each unit off its edge already.
#[inline(always)]
pub(super) fn are_covered<S: Lanes>(
    movers: &Movers<S>,
    edges: &EdgeColumns,
    nearer: &[HalfPlaneColumns],
) -> Mask<S> {
    let (simd, radius) = (movers.radius.simd(), movers.radius);
    let zero = Floats::splat(simd, 0.0);
    let [start, end] = [&edges.start, &edges.end].map(
        #[inline(always)]
        |end| Vectors::load(simd, end) - movers.position,
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
pub(super) fn keep_off<S: Lanes>(movers: &Movers<S>, edges: &EdgeColumns) -> Optional<S> {
    let (simd, radius) = (movers.radius.simd(), movers.radius);
    let (zero, one) = (Floats::splat(simd, 0.0), Floats::splat(simd, 1.0));
    let origin = Vectors { x: zero, y: zero };
    let everywhere = zero.le(zero);
    let [from, to] = [&edges.start, &edges.end].map(
        #[inline(always)]
        |end| Vectors::load(simd, end),
    );
    let along = Vectors::load(simd, &edges.along);
    let start = Corner {
        offset: from - movers.position,
        incoming: Vectors::load(simd, &edges.before),
        outgoing: along,
    };
    let end =
        Corner { offset: to - movers.position, incoming: along, outgoing: Vectors::load(simd, &edges.after) };
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
fn covers<S: Lanes>(half_planes: &HalfPlanes<S>, offset: Vectors<S>, radius: Floats<S>) -> Mask<S> {
    let distance = (offset - half_planes.point).perp_dot(half_planes.direction) - radius;
    distance.ge(Floats::splat(radius.simd(), -EPSILON))
}

/// The half-planes of units that touch a corner: velocities that do not come closer.
#[inline(always)]
fn away_from<S: Lanes>(corner: Vectors<S>) -> HalfPlanes<S> {
    let zero = Floats::splat(corner.x.simd(), 0.0);
    HalfPlanes {
        point: Vectors { x: zero, y: zero },
        direction: Vectors { x: -corner.y, y: corner.x }.normalize(),
    }
}

/// The velocity obstacle of an edge before it is widened by the radius: two legs, and the cut-off between
/// them.
#[derive(Clone, Copy)]
struct Shadow<S: Lanes> {
    left: Leg<S>,
    right: Leg<S>,
    /// Direction of the outline at the left corner.
    along: Vectors<S>,
    /// Whether both legs start at one corner; then there is no cut-off.
    single: Mask<S>,
}

#[derive(Clone, Copy)]
struct Leg<S: Lanes> {
    corner: Vectors<S>,
    direction: Vectors<S>,
    /// Whether the adjacent edge bounds the shadow instead; then the half-plane is left to that edge.
    foreign: Mask<S>,
}

impl<S: Lanes> Shadow<S> {
    #[inline(always)]
    fn cast(left: &Corner<S>, right: &Corner<S>, single: Mask<S>, radius: Floats<S>) -> Shadow<S> {
        Shadow {
            left: Leg::left(left, radius),
            right: Leg::right(right, radius),
            along: left.outgoing,
            single,
        }
    }

    /// The half-planes at the points of the shadows' boundaries nearest to the velocities.
    #[inline(always)]
    fn half_planes(&self, velocity: Vectors<S>, radius: Floats<S>) -> Optional<S> {
        let simd = radius.simd();
        let [zero, half, one, infinite] = [0.0, 0.5, 1.0, f32::INFINITY].map(
            #[inline(always)]
            |x| Floats::splat(simd, x),
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

impl<S: Lanes> Leg<S> {
    /// The left tangent from each unit to the disc around a corner; see `neighbours::leg_escape` for the
    /// derivation. A leg that would point into the adjacent edge is replaced by the direction of that edge.
    #[inline(always)]
    fn left(corner: &Corner<S>, radius: Floats<S>) -> Leg<S> {
        let (offset, distance_squared) = (corner.offset, corner.offset.length_squared());
        let length = (distance_squared - radius * radius).sqrt();
        let direction =
            Vectors { x: offset.x * length - offset.y * radius, y: offset.x * radius + offset.y * length }
                * distance_squared.recip();
        let adjacent = -corner.incoming;
        let foreign = direction.perp_dot(adjacent).ge(Floats::splat(radius.simd(), 0.0));
        Leg { corner: offset, direction: foreign.either(adjacent, direction), foreign }
    }

    /// The right tangent.
    #[inline(always)]
    fn right(corner: &Corner<S>, radius: Floats<S>) -> Leg<S> {
        let (offset, distance_squared) = (corner.offset, corner.offset.length_squared());
        let length = (distance_squared - radius * radius).sqrt();
        let direction =
            Vectors { x: offset.x * length + offset.y * radius, y: -offset.x * radius + offset.y * length }
                * distance_squared.recip();
        let adjacent = corner.outgoing;
        let foreign = direction.perp_dot(adjacent).le(Floats::splat(radius.simd(), 0.0));
        Leg { corner: offset, direction: foreign.either(adjacent, direction), foreign }
    }

    /// The squared distances of velocities whose projections on the leg are `at`; infinite before the leg
    /// starts.
    #[inline(always)]
    fn distance_squared(&self, velocity: Vectors<S>, at: Floats<S>) -> Floats<S> {
        let simd = at.simd();
        let distance_squared = (velocity - (self.corner + self.direction * at)).length_squared();
        at.lt(Floats::splat(simd, 0.0)).select(Floats::splat(simd, f32::INFINITY), distance_squared)
    }
}

/// The half-planes at the arc around a corner: the tangent of the disc at the point nearest to the velocity.
#[inline(always)]
fn round_corner<S: Lanes>(corner: Vectors<S>, velocity: Vectors<S>, radius: Floats<S>) -> HalfPlanes<S> {
    let outward = (velocity - corner).normalize();
    HalfPlanes { point: corner + outward * radius, direction: Vectors { x: outward.y, y: -outward.x } }
}

/// The half-planes through `corner` along `direction`, moved out by the radius.
#[inline(always)]
fn widened<S: Lanes>(corner: Vectors<S>, direction: Vectors<S>, radius: Floats<S>) -> HalfPlanes<S> {
    let outward = Vectors { x: -direction.y, y: direction.x };
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
    use crate::lanes::{Kernel, Level};

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

    /// Makes the half-planes of units together, as many as there are lanes.
    struct Together<'a> {
        scenes: &'a [Scene],
        half_planes: &'a mut Vec<Vec<HalfPlane>>,
    }

    impl Kernel for Together<'_> {
        #[inline(always)]
        fn run<S: Lanes>(self, simd: S) {
            for scenes in self.scenes.chunks(S::F32_LANES) {
                let column = |of: &dyn Fn(&Scene) -> f32| {
                    let mut column = Column::default();
                    column.iter_mut().zip(scenes).for_each(|(x, scene)| *x = of(scene));
                    column
                };
                let vectors = |of: &dyn Fn(&Scene) -> Vec2| [column(&|s| of(s).x), column(&|s| of(s).y)];
                let movers = Movers {
                    position: Vectors::load(simd, &vectors(&|s| s.mover.position)),
                    velocity: Vectors::load(simd, &vectors(&|s| s.mover.velocity)),
                    radius: Floats::load(simd, &column(&|s| s.mover.radius)),
                };
                let n_slots = scenes.iter().map(|scene| scene.edges.len()).max().unwrap_or(0);
                let mut slots = vec![HalfPlaneColumns::default(); n_slots];
                for slot in 0..n_slots {
                    let mut edges = EdgeColumns::default();
                    for (lane, scene) in scenes.iter().enumerate() {
                        if let Some(edge) = scene.edges.get(slot) {
                            edges.set(lane, edge);
                        }
                    }
                    let is_there = column(&|s| f32::from(slot < s.edges.len()));
                    let (earlier, rest) = slots.split_at_mut(slot);
                    let (half_planes, exist) = keep_off(&movers, &edges);
                    let is_there = Floats::load(simd, &is_there).gt(Floats::splat(simd, 0.0));
                    let is_covered = are_covered(&movers, &edges, earlier);
                    rest[0].store(half_planes, exist & is_there & !is_covered);
                }
                self.half_planes.extend((0..scenes.len()).map(|lane| {
                    let vector = |[x, y]: &[Column; 2]| Vec2::new(x[lane], y[lane]);
                    let half_plane = |slot: &HalfPlaneColumns| HalfPlane {
                        point: vector(&slot.point),
                        direction: vector(&slot.direction),
                    };
                    slots.iter().filter(|slot| slot.exists[lane] == 1.0).map(half_plane).collect()
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
        fn run<S: Lanes>(self, simd: S) {
            let (mut search, mut found) = (EdgeSearch::default(), NearestList::default());
            found.reserve(self.edges.longest_list());
            for &position in self.positions {
                let mut cell = Column::default();
                self.edges.cells(Vectors::splat(simd, position)).store(&mut cell);
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
        let scenes: Vec<Scene> = (0..4000 * MAX_LANES).map(|_| Scene::random(&mut random)).collect();
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
