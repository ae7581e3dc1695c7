//! A spatial index: units in blocks with bounding boxes, for the searches of `tick::target_choice`.
//!
//! The contract between the two: the rules compare distances in f64, and the index narrows a search down in
//! f32, four distances at a time. A squared distance in f32 has a relative error below 2^-21 (four
//! roundings), and [`MARGIN`] is far more than that. So what the index visits is a superset of the units
//! asked for, by ascending id, and the visitor decides in f64. A search for the nearest also returns a bound,
//! in f64, that all units not visited are farther than: if the best visited unit is within it, that is the
//! nearest of all.

use glam::Vec2;

use crate::buffers::{clear_and_reserve, refill};
use crate::fast_math;
use crate::simd::x4::{F32x4, Four, Vec2x4, WIDTH, four};

/// The units of an index and their positions, packed for one tick.
#[derive(Debug)]
pub(crate) struct BlockIndex {
    /// Battle-wide ids, ascending.
    ids: Vec<u32>,
    /// Their positions.
    blocks: Vec<Block>,
    four: Four,
}

/// Registers of four positions in a block: few, so that the box of a block is small, and enough to make the
/// test of the box cheaper than that of the positions.
const FOURS: usize = 4;

/// Number of positions in a block.
const BLOCK_SIZE: usize = FOURS * WIDTH;

/// Consecutive units. The last block is padded with positions at infinity, which no search finds.
#[derive(Debug)]
#[repr(C, align(16))]
struct Block {
    positions: [Vec2x4; FOURS],
    bounds: BoundingBox,
}

/// The smallest box around some points: the minima of x, y, -x and -y, so that one instruction compares all.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub(crate) struct BoundingBox(F32x4);

/// Squared distances that differ by less than this factor are compared in f64.
const MARGIN: f32 = 1.0001;

/// The square of a search radius with the margin; finite, so that no search finds the padding.
pub(crate) fn search_bound(radius: f64) -> f32 {
    fast_math::min((radius * radius) as f32 * MARGIN, f32::MAX)
}

/// A squared distance in f64 that is less than that of every unit whose squared distance in f32 is more than
/// `bound`.
fn exact_bound(bound: f32) -> f64 {
    // Half of the margin is more than the error of the bound and of the distances compared with it.
    f64::from(bound) * (1.0 - f64::from(MARGIN - 1.0) / 2.0)
}

impl Default for BlockIndex {
    /// Without units.
    fn default() -> BlockIndex {
        BlockIndex { ids: Vec::new(), blocks: Vec::new(), four: four() }
    }
}

impl BlockIndex {
    /// Reserves memory for `n_units` units.
    pub fn reserve(&mut self, n_units: usize) {
        clear_and_reserve(&mut self.ids, n_units);
        clear_and_reserve(&mut self.blocks, n_units.div_ceil(BLOCK_SIZE));
    }

    /// Removes all units.
    pub fn clear(&mut self) {
        self.ids.clear();
        self.blocks.clear();
    }

    /// Replaces the units by those of `ids`, ascending, that belong; `positions` are by battle-wide id.
    pub fn fill(&mut self, ids: &[u32], belongs: impl Fn(&u32) -> bool, positions: &[Vec2]) {
        self.ids.clear();
        for &id in ids {
            if belongs(&id) {
                self.ids.push(id);
            }
        }
        let four = self.four;
        refill(&mut self.blocks, self.ids.chunks(BLOCK_SIZE).map(|ids| Block::new(four, ids, positions)));
    }

    /// All units, by ascending id.
    pub fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// The box around all units.
    pub fn bounds(&self) -> BoundingBox {
        self.blocks.iter().fold(BoundingBox::empty(self.four), |bounds, block| bounds.and(&block.bounds))
    }

    /// Visits by ascending id those that may be the nearest within a [`search_bound`] of a position, and some
    /// others. Returns a squared distance that all units not visited are farther than: it is more than the
    /// square of the search radius if nothing was visited within that.
    #[inline(always)]
    pub fn visit_nearest(&self, position: Vec2, bound: f32, mut visit: impl FnMut(u32)) -> f64 {
        let centre = Vec2x4::splat(self.four, position);
        let mut within = bound;
        for (number, block) in self.blocks.iter().enumerate() {
            if block.bounds.distance_squared(position) <= within {
                let distances = block.distances_squared(centre);
                let [a, b, c, d] = distances;
                let least = a.min(b).min(c.min(d)).to_array().into_iter().fold(f32::INFINITY, fast_math::min);
                // The least positive number makes up for squares too small to have a relative error.
                within = fast_math::min(least * MARGIN + f32::MIN_POSITIVE, within);
                self.visit_those_within(within, number, distances, &mut visit);
            }
        }
        exact_bound(within)
    }

    /// Visits by ascending id all units within a [`search_bound`] of a position, and perhaps some that are a
    /// little farther.
    #[inline(always)]
    pub fn visit_near(&self, position: Vec2, bound: f32, mut visit: impl FnMut(u32)) {
        let centre = Vec2x4::splat(self.four, position);
        for (number, block) in self.blocks.iter().enumerate() {
            if block.bounds.distance_squared(position) <= bound {
                self.visit_those_within(bound, number, block.distances_squared(centre), &mut visit);
            }
        }
    }

    /// Visits the units of a block whose squared distance is at most `bound`.
    #[inline(always)]
    fn visit_those_within(
        &self,
        bound: f32,
        block: usize,
        distances: [F32x4; FOURS],
        visit: &mut impl FnMut(u32),
    ) {
        let [a, b, c, d] = distances.map(|four| four.le(F32x4::splat(four.simd(), bound)).bits());
        let mut near = a | b << WIDTH | c << (2 * WIDTH) | d << (3 * WIDTH);
        while near != 0 {
            visit(self.ids[block * BLOCK_SIZE + near.trailing_zeros() as usize]);
            // Clears the lowest bit.
            near &= near - 1;
        }
    }
}

impl Block {
    #[inline(always)]
    fn new(four: Four, ids: &[u32], positions: &[Vec2]) -> Block {
        let mut points = [Vec2::INFINITY; BLOCK_SIZE];
        let mut bounds = BoundingBox::empty(four);
        for (point, &id) in points.iter_mut().zip(ids) {
            *point = positions[id as usize];
            bounds = bounds.and(&BoundingBox::at(four, *point));
        }
        let quarter = |i: usize| std::array::from_fn(|k| points[i * WIDTH + k]);
        Block { positions: std::array::from_fn(|i| Vec2x4::new(four, quarter(i))), bounds }
    }

    #[inline(always)]
    fn distances_squared(&self, centre: Vec2x4) -> [F32x4; FOURS] {
        self.positions.map(|four| (four - centre).length_squared())
    }
}

impl Default for BoundingBox {
    fn default() -> BoundingBox {
        BoundingBox::empty(four())
    }
}

impl BoundingBox {
    /// Around no point.
    #[inline(always)]
    fn empty(four: Four) -> BoundingBox {
        BoundingBox(F32x4::splat(four, f32::INFINITY))
    }

    /// Around one point.
    #[inline(always)]
    fn at(four: Four, point: Vec2) -> BoundingBox {
        BoundingBox(F32x4::new(four, [point.x, point.y, -point.x, -point.y]))
    }

    /// The box around two boxes.
    #[inline(always)]
    pub fn and(self, other: &BoundingBox) -> BoundingBox {
        BoundingBox(self.0.min(other.0))
    }

    /// The squared distance of a point; infinite from the box around no point. Rounding keeps the order of
    /// differences, squares and sums. So it is never more than that of a point in the box, without a margin.
    #[inline(always)]
    pub fn distance_squared(&self, point: Vec2) -> f32 {
        // Of two opposite sides the point is beyond one at most, or they are infinite and it is beyond both.
        let four = self.0.simd();
        let beyond = (self.0 - BoundingBox::at(four, point).0).max(F32x4::splat(four, 0.0));
        let [west, south, east, north] = beyond.to_array();
        let (x, y) = (fast_math::max(west, east), fast_math::max(south, north));
        x * x + y * y
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distance::distance_squared;

    /// A grid with many equal distances, a few units in one spot, and one that is far away.
    fn positions() -> Vec<Vec2> {
        let grid = (0..70).map(|i| Vec2::new((i * 37 % 23) as f32 * 0.25, (i * 53 % 19) as f32 * 0.25));
        grid.chain([Vec2::new(-1e30, 3.0)]).collect()
    }

    fn index(ids: &[u32], positions: &[Vec2]) -> BlockIndex {
        let mut index = BlockIndex::default();
        index.fill(ids, |_| true, positions);
        index
    }

    #[test]
    fn all_units_within_the_radius_are_visited_and_few_others() {
        let positions = positions();
        let ids: Vec<u32> = (0..71).filter(|id| id % 5 > 0).collect();
        for n in [0, 1, 4, 15, 16, 17, ids.len()] {
            let (ids, index) = (&ids[..n], index(&ids[..n], &positions));
            for (centre, radius) in
                positions.iter().flat_map(|&p| [0.0, 0.25, 1.3, 20.0, 1e300].map(|r| (p, r)))
            {
                let mut visited = Vec::new();
                index.visit_near(centre, search_bound(radius), |id| visited.push(id));
                let within = |factor: f64| {
                    let bound = radius * radius * factor;
                    let away = |id: u32| distance_squared(centre, positions[id as usize]);
                    ids.iter().copied().filter(|&id| away(id) <= bound).collect::<Vec<_>>()
                };
                // Only a radius without limit finds units so far away that their squares overflow.
                let (least, most) = (within(1.0), within(1.001));
                let is_far = |id: &u32| centre.x < -1.0 || *id == 70;
                assert!(visited.is_sorted() && visited.iter().all(|id| most.contains(id)));
                assert!(least.iter().all(|id| visited.contains(id) || is_far(id)), "{least:?} {visited:?}");
            }
        }
    }

    #[test]
    fn those_not_visited_are_farther_than_the_nearest() {
        let positions = positions();
        let ids: Vec<u32> = (0..71).collect();
        let away = |centre: Vec2, id: u32| distance_squared(centre, positions[id as usize]);
        for n in [0, 1, 4, 15, 16, 17, 70] {
            let index = index(&ids[..n], &positions);
            for centre in positions.iter().flat_map(|&p| [p, p + Vec2::new(0.11, 0.07), p * 2.0]) {
                for radius in [0.01, 0.5, 3.0] {
                    let mut visited = Vec::new();
                    let rest = index.visit_nearest(centre, search_bound(radius), |id| visited.push(id));
                    let others = ids[..n].iter().filter(|id| !visited.contains(id));
                    assert!(visited.is_sorted() && others.clone().all(|&id| away(centre, id) > rest));
                    let nearest = ids[..n].iter().map(|&id| away(centre, id)).fold(f64::INFINITY, f64::min);
                    // Either the nearest is among the visited, or all are beyond the radius.
                    assert!(rest >= nearest || rest > radius * radius, "{n} {centre} {radius}");
                }
            }
        }
    }
}
