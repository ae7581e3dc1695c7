//! The order of equally near neighbours: the order in which a search through a k-d tree visits them.
//!
//! The tree is part of the rules. Neighbours come nearest first, but units that march in formation are often
//! equally near to the last bit. Then those come first that the tree visits first, and the rounding of the
//! linear program depends on that order. Where no two are equally near, the plain search of `plane_units`
//! finds the same order.
//!
//! The tree is built in every tick by partitioning the list of units in place, and each tick partitions the
//! order that the last one left (`NeighbourOrder`). Units move little in a tick, so the list is mostly
//! partitioned already and only scanned, a register at a time ([`crate::simd`]).

use std::ops::Range;

use glam::Vec2;

use super::columns::{Columns, WORD};
use crate::buffers::clear_and_reserve;
use crate::fast_math::max;
use crate::simd::{Column, F32s, InstructionSet, Vec2s};

/// A k-d tree whose boxes are halved across their longer side. The positions lie in columns outside it.
#[derive(Debug, Default)]
pub(super) struct Tree {
    nodes: Vec<Node>,
    /// Upper halves that are still to be divided.
    upper_halves: Vec<Half>,
    /// Bit i of word w: whether unit `WORD * w + i` of a box belongs to its lower half.
    lower: Vec<u64>,
}

/// A box around the units `begin..end`. If it has halves, the lower one is the next node.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// `None` for leaves, where it is computed when a search needs it: most searches do not.
    corners: Option<Corners>,
    begin: u32,
    end: u32,
    /// The index of the upper half; 0 for leaves, because the root is not a half.
    upper: u32,
}

/// The least and the greatest coordinates of a box.
#[derive(Clone, Copy, Debug)]
struct Corners {
    low: Vec2,
    high: Vec2,
}

/// The upper half of the node with the index `of`.
#[derive(Clone, Copy, Debug)]
struct Half {
    of: usize,
    begin: usize,
    end: usize,
}

impl Tree {
    /// The largest number of units of a box that is not divided; these units are visited in the order of the
    /// list.
    pub const LEAF_SIZE: usize = 10;

    /// Reserves memory for `n_units` units.
    pub fn reserve(&mut self, n_units: usize) {
        // A binary tree with one unit in every leaf is the largest.
        clear_and_reserve(&mut self.nodes, 2 * n_units);
        clear_and_reserve(&mut self.upper_halves, n_units);
        self.lower.resize(n_units.div_ceil(WORD), 0);
    }

    /// Builds the tree over the units of a list, which it partitions together with their positions. Whole
    /// registers of positions are read, also beyond the last unit.
    #[inline(always)]
    pub fn build<S: InstructionSet>(&mut self, simd: S, ids: &mut [u32], positions: &mut Columns) {
        self.nodes.clear();
        let (mut begin, mut end) = (0, ids.len());
        loop {
            // The lower halves of a box are divided first, the upper ones wait.
            let index = self.nodes.len();
            self.nodes.push(Node { corners: None, begin: begin as u32, end: end as u32, upper: 0 });
            if end - begin > Tree::LEAF_SIZE {
                let corners = Corners::of(simd, positions, begin..end);
                self.nodes[index].corners = Some(corners);
                let n_lower = self.find_lower(simd, positions, begin..end, corners);
                self.partition(ids, positions, begin..end, n_lower);
                // Units at one point are all in the upper half. Moving one to the lower half ends the
                // division.
                let middle = begin + n_lower.max(1);
                self.upper_halves.push(Half { of: index, begin: middle, end });
                end = middle;
            } else {
                let Some(half) = self.upper_halves.pop() else { return };
                self.nodes[half.of].upper = self.nodes.len() as u32;
                (begin, end) = (half.begin, half.end);
            }
        }
    }

    /// Finds the units of the lower half of a box, and their number. The line crosses the longer side in its
    /// middle; units on it belong to the upper half.
    #[inline(always)]
    fn find_lower<S: InstructionSet>(
        &mut self,
        simd: S,
        positions: &Columns,
        units: Range<usize>,
        Corners { low, high }: Corners,
    ) -> usize {
        // The sum of two great coordinates is infinite. The line is not beyond the greatest one, so that the
        // upper half has a unit: a lower half of all units would be divided without end.
        let (sides, middle) = (high - low, (0.5 * (high + low)).min(high));
        let (column, line) =
            if sides.x > sides.y { (&positions.x, middle.x) } else { (&positions.y, middle.y) };
        let line = F32s::splat(simd, line);
        let mut n_lower = 0;
        for (word, first) in self.lower.iter_mut().zip(units.clone().step_by(WORD)) {
            let n = (units.end - first).min(WORD);
            let mut lower = 0;
            for i in (0..n).step_by(S::WIDTH) {
                let is_lower = F32s::from_slice(simd, &column[first + i..]).lt(line);
                lower |= u64::from(is_lower.bits()) << i;
            }
            *word = lower & first_bits(n);
            n_lower += word.count_ones() as usize;
        }
        n_lower
    }

    /// Moves the units of the lower half before the others.
    ///
    /// The first unit that does not belong to the lower half is exchanged with the last that does, and so on
    /// inwards. Which units are exchanged decides the order of equally near neighbours in later ticks. Units
    /// move little in a tick, so most boxes are partitioned already, and no bit is out of place.
    #[inline(always)]
    fn partition(&mut self, ids: &mut [u32], positions: &mut Columns, units: Range<usize>, n_lower: usize) {
        // As many units of the lower half are behind the first `n_lower` as others are among them, so the
        // search from behind ends before it comes to those.
        let (begin, mut behind) = (units.start, units.len().div_ceil(WORD));
        let mut lower = 0;
        for word in 0..n_lower.div_ceil(WORD) {
            let mut upper = !self.lower[word] & first_bits(n_lower - word * WORD);
            while upper != 0 {
                let one = begin + word * WORD + upper.trailing_zeros() as usize;
                upper &= upper - 1;
                while lower == 0 {
                    behind -= 1;
                    lower = self.lower[behind];
                }
                let last = lower.ilog2() as usize;
                lower &= !(1 << last);
                let other = begin + behind * WORD + last;
                ids.swap(one, other);
                positions.swap(one, other);
            }
        }
    }

    /// Visits the units whose squared distance to `position` is below `range_squared`: distance and index.
    pub fn find(
        &self,
        positions: &Columns,
        position: Vec2,
        range_squared: f32,
        mut visit: impl FnMut(f32, u32),
    ) {
        if !self.nodes.is_empty() {
            let search = Search { tree: self, positions, position, range_squared };
            search.find_in(0, &mut visit);
        }
    }
}

/// A search through a tree.
struct Search<'a> {
    tree: &'a Tree,
    positions: &'a Columns,
    position: Vec2,
    range_squared: f32,
}

impl Search<'_> {
    /// The squared distance of a box to the position; 0 inside.
    fn distance_squared(&self, index: usize) -> f32 {
        let Node { corners: known, begin, end, .. } = self.tree.nodes[index];
        let units = || (begin..end).map(|index| self.positions.get(index as usize));
        let Corners { low, high } = known.unwrap_or_else(|| Corners {
            low: units().fold(Vec2::INFINITY, Vec2::min),
            high: units().fold(Vec2::NEG_INFINITY, Vec2::max),
        });
        let beyond = |low: f32, x: f32, high: f32| max(low - x, 0.0) + max(x - high, 0.0);
        let (dx, dy) = (beyond(low.x, self.position.x, high.x), beyond(low.y, self.position.y, high.y));
        dx * dx + dy * dy
    }

    fn find_in(&self, index: usize, visit: &mut impl FnMut(f32, u32)) {
        let node = &self.tree.nodes[index];
        if node.upper == 0 {
            for index in node.begin..node.end {
                let other = self.positions.get(index as usize);
                let distance_squared = (self.position - other).length_squared();
                if distance_squared < self.range_squared {
                    visit(distance_squared, index);
                }
            }
            return;
        }
        // The nearer half first, and of equally near halves the upper one. A half out of range is skipped.
        let (lower, upper) = (index + 1, node.upper as usize);
        let [to_lower, to_upper] = [lower, upper].map(|half| self.distance_squared(half));
        let nearer_first = if to_lower < to_upper {
            [(to_lower, lower), (to_upper, upper)]
        } else {
            [(to_upper, upper), (to_lower, lower)]
        };
        for (distance_squared, half) in nearer_first {
            if distance_squared < self.range_squared {
                self.find_in(half, visit);
            }
        }
    }
}

impl Corners {
    /// The corners of the box around units.
    #[inline(always)]
    fn of<S: InstructionSet>(simd: S, positions: &Columns, units: Range<usize>) -> Corners {
        let infinite = Vec2s::splat(simd, Vec2::INFINITY);
        let negative = Vec2s::splat(simd, Vec2::NEG_INFINITY);
        let (mut low, mut high) = (infinite, negative);
        let numbers = F32s::load(simd, &Column::NUMBERS);
        for first in units.clone().step_by(S::WIDTH) {
            // The last register has other units behind the last of these.
            let count = numbers.lt(F32s::splat(simd, (units.end - first) as f32));
            let units = positions.load(simd, first);
            let (lowest, highest) = (count.either(units, infinite), count.either(units, negative));
            low = Vec2s { x: low.x.min(lowest.x), y: low.y.min(lowest.y) };
            high = Vec2s { x: high.x.max(highest.x), y: high.y.max(highest.y) };
        }
        Corners {
            low: Vec2::new(low.x.least(), low.y.least()),
            high: Vec2::new(high.x.greatest(), high.y.greatest()),
        }
    }
}

/// A word whose first `n` bits are set.
fn first_bits(n: usize) -> u64 {
    if n < WORD { !(!0 << n) } else { !0 }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;
    use crate::simd::{Kernel, Level, MAX_WIDTH};

    /// Positions in columns that are long enough for whole registers.
    fn columns(positions: &[Vec2]) -> Columns {
        let mut columns = Columns::default();
        columns.resize(positions.len() + MAX_WIDTH);
        for (i, position) in positions.iter().enumerate() {
            (columns.x[i], columns.y[i]) = (*position).into();
        }
        columns
    }

    /// Builds a tree.
    struct Build<'a> {
        tree: &'a mut Tree,
        ids: &'a mut [u32],
        positions: &'a mut Columns,
    }

    impl Kernel for Build<'_> {
        #[inline(always)]
        fn run<S: InstructionSet>(self, simd: S) {
            self.tree.build(simd, self.ids, self.positions);
        }
    }

    /// A tree, its positions, and its list, which begins with ascending ids; the same at every level.
    fn build(positions: &[Vec2]) -> (Tree, Columns, Vec<u32>) {
        let at = |level: Level| {
            let (mut tree, mut columns) = (Tree::default(), columns(positions));
            let mut ids: Vec<u32> = (0..positions.len() as u32).collect();
            tree.reserve(positions.len());
            level.run(Build { tree: &mut tree, ids: &mut ids, positions: &mut columns });
            (tree, columns, ids)
        };
        let (tree, columns, list) = at(Level::default());
        for level in Level::available() {
            assert_eq!(at(level).2, list, "{level:?}");
        }
        (tree, columns, list)
    }

    /// Partitions the list of a box and those of its halves, unit by unit, from both ends inwards.
    fn partition_one_by_one(ids: &mut [u32], positions: &[Vec2]) {
        if ids.len() <= Tree::LEAF_SIZE {
            return;
        }
        let at = |&id: &u32| positions[id as usize];
        let low = ids.iter().map(at).fold(Vec2::INFINITY, Vec2::min);
        let high = ids.iter().map(at).fold(Vec2::NEG_INFINITY, Vec2::max);
        let (sides, middle) = (high - low, 0.5 * (high + low));
        let is_lower = |id: &u32| if sides.x > sides.y { at(id).x < middle.x } else { at(id).y < middle.y };
        let (mut begin, mut end) = (0, ids.len());
        while begin < end {
            if is_lower(&ids[begin]) {
                begin += 1;
            } else if !is_lower(&ids[end - 1]) {
                end -= 1;
            } else {
                ids.swap(begin, end - 1);
            }
        }
        let (lower, upper) = ids.split_at_mut(begin.max(1));
        partition_one_by_one(lower, positions);
        partition_one_by_one(upper, positions);
    }

    #[test]
    fn many_units_are_partitioned_as_one_by_one() {
        let mut random = Pcg64Mcg::seed_from_u64(7);
        for n in (0..=40).chain([63, 64, 65, 127, 128, 129, 200, 500]) {
            for round in 0..20 {
                // On a grid, so that units lie on the lines, and anywhere.
                let mut coordinate = || match round % 2 {
                    0 => random.random_range(0..12) as f32 * 0.5,
                    _ => random.random_range(0.0..6.0),
                };
                let positions: Vec<Vec2> = (0..n).map(|_| Vec2::new(coordinate(), coordinate())).collect();
                let (_, columns, list) = build(&positions);
                let mut expected: Vec<u32> = (0..n).collect();
                partition_one_by_one(&mut expected, &positions);
                assert_eq!(list, expected, "{n} units");
                for (i, &id) in list.iter().enumerate() {
                    assert_eq!(columns.get(i), positions[id as usize]);
                }
            }
        }
    }

    #[test]
    fn many_units_at_one_point_fit() {
        let (tree, columns, _) = build(&[Vec2::ONE; 50]);
        let mut n_visited = 0;
        tree.find(&columns, Vec2::ONE, 1.0, |_, _| n_visited += 1);
        assert_eq!(n_visited, 50);
    }

    /// The sum of two coordinates was infinite here, so that no line divided the units, and the tree grew
    /// until memory was used up.
    #[test]
    fn units_at_the_greatest_numbers_fit() {
        let mut random = Pcg64Mcg::seed_from_u64(3);
        for scale in [f32::MAX, 3.0e38, f32::MIN_POSITIVE, f32::from_bits(1)] {
            for (low, high) in [(-1.0, 1.0), (0.9, 1.0), (-1.0, -0.9), (1.0, 1.0)] {
                let mut coordinate = || random.random_range(low..=high) * scale;
                let positions: Vec<Vec2> = (0..200).map(|_| Vec2::new(coordinate(), coordinate())).collect();
                let (tree, _, mut list) = build(&positions);
                assert!(tree.nodes.len() < 2 * positions.len(), "{} nodes", tree.nodes.len());
                list.sort_unstable();
                assert!(list.into_iter().eq(0..200));
            }
        }
    }

    #[test]
    fn the_nearer_half_is_visited_first() {
        let positions: Vec<Vec2> = (0..12).map(|x| Vec2::new(x as f32, 0.0)).collect();
        let (tree, columns, _) = build(&positions);
        let mut visited = Vec::new();
        tree.find(&columns, Vec2::new(8.0, 0.0), 100.0, |_, index| visited.push(index));
        assert_eq!(visited, [6, 7, 8, 9, 10, 11, 0, 1, 2, 3, 4, 5]);
    }
}
