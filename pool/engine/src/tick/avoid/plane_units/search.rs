//! The search of each unit for its neighbours, among the units of its plane.
//!
//! Distances are compared for a register of units at a time. A plane of few units fits in one register; in
//! one of more units than a word has bits, a box around the units of each word decides whether they are
//! compared.

use super::PlaneUnits;
use crate::arena::{AvoidanceParams, EdgesByCell};
use crate::simd::{F32s, InstructionSet, MAX_WIDTH, Vec2s};
use crate::tick::avoid::columns::WORD;
use crate::tick::avoid::near_list::NearList;
use crate::tick::avoid::nearest_list::NearestList;
use crate::tick::avoid::tree::Tree;

impl PlaneUnits {
    /// Lists the neighbours of all units that move: the units whose squared distance is below the unit's
    /// `neighbour_range_squared`. Units that may see an edge are listed in any case.
    #[inline(always)]
    pub fn find_neighbours<S: InstructionSet>(
        &self,
        simd: S,
        stats: &[AvoidanceParams],
        edges: &EdgesByCell,
        list: &mut NearList,
    ) {
        list.clear();
        let n_words = self.n.div_ceil(WORD);
        let first = self.position.load(simd, 0);
        for &index in self.movers() {
            let member = &self.members[index as usize];
            let stats = &stats[member.id as usize];
            let may_see = stats.edge_range_squared.is_some() && edges.may_see(self.cell[index as usize]);
            list.add_unit(index, may_see);
            let centre = Vec2s::splat(simd, member.position);
            let range = F32s::splat(simd, stats.neighbour_range_squared);
            if self.n <= S::WIDTH {
                // Of a small plane, all positions stay in one register.
                let near = (centre - first).length_squared().lt(range).bits() & !(1 << index);
                list.add_neighbours(index, 0, near.into());
            } else if n_words == 1 {
                list.add_neighbours(index, 0, self.near_in(centre, range, 0, index));
            } else {
                self.find_in_words(centre, range, n_words, index, list);
            }
        }
    }

    /// Finds the neighbours of a unit of a plane with several words.
    #[inline(always)]
    fn find_in_words<S: InstructionSet>(
        &self,
        centre: Vec2s<S>,
        range: F32s<S>,
        n_words: usize,
        index: u32,
        list: &mut NearList,
    ) {
        for group in (0..n_words).step_by(MAX_WIDTH) {
            let mut words = self.near_words(centre, range, group);
            while words != 0 {
                let word = group + words.trailing_zeros() as usize;
                words &= words - 1;
                list.add_neighbours(index, word, self.near_in(centre, range, word, index));
            }
        }
    }

    /// Of up to [`MAX_WIDTH`] words, those in whose box there may be neighbours, as bits.
    #[inline(always)]
    fn near_words<S: InstructionSet>(&self, centre: Vec2s<S>, range: F32s<S>, first: usize) -> u32 {
        let simd = range.simd();
        let zero = F32s::splat(simd, 0.0);
        let mut words = 0;
        for i in (0..MAX_WIDTH).step_by(S::WIDTH) {
            // Rounding is monotonic: no unit in the box is computed to be nearer than the box is here.
            let (low, high) = (self.low.load(simd, first + i), self.high.load(simd, first + i));
            let x = (low.x - centre.x).max(zero) + (centre.x - high.x).max(zero);
            let y = (low.y - centre.y).max(zero) + (centre.y - high.y).max(zero);
            words |= Vec2s { x, y }.length_squared().lt(range).bits() << i;
        }
        words
    }

    /// The neighbours of a unit in one word, as bits.
    #[inline(always)]
    fn near_in<S: InstructionSet>(&self, centre: Vec2s<S>, range: F32s<S>, word: usize, index: u32) -> u64 {
        let simd = range.simd();
        let begin = word * WORD;
        // Of the last word, only the entries up to the last unit are looked at.
        let n = (self.n - begin).min(WORD).next_multiple_of(MAX_WIDTH);
        let (x, y) = (&self.position.x[begin..begin + n], &self.position.y[begin..begin + n]);
        let (mut bits, mut shift) = (0, 0);
        for other in Vec2s::all(simd, x, y) {
            let is_near = (centre - other).length_squared().lt(range);
            bits |= u64::from(is_near.bits()) << shift;
            shift += S::WIDTH;
        }
        // The unit itself is always near.
        let itself = u64::from(index as usize / WORD == word) << (index as usize % WORD);
        bits & !itself
    }

    /// Finds the neighbours of a unit, nearest first, and those that are equally near in the order of the
    /// tree. `false` if that is the order of their indices.
    pub fn find_by_tree(&mut self, index: usize, range_squared: f32, sorted: &mut NearestList) -> bool {
        if self.n <= Tree::LEAF_SIZE {
            return false; // all in one leaf
        }
        let PlaneUnits { position: positions, tree, visited, .. } = self;
        let position = positions.get(index);
        // Equal distances are sorted by index, so the index is first the number of the visit and then
        // replaced.
        sorted.clear();
        visited.clear();
        tree.find(positions, position, range_squared, |distance_squared, other| {
            if other as usize != index {
                sorted.insert(distance_squared, visited.len());
                visited.push(other);
            }
        });
        sorted.replace(visited);
        true
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::super::BattleUnits;
    use super::*;
    use crate::simd::{Kernel, Level};
    use crate::tick::avoid::near_list::NearUnit;
    use smaclite_scenarios::Terrain;

    /// A search around every unit.
    struct Search<'a> {
        positions: &'a [Vec2],
        range_squared: f32,
        /// The neighbours of each unit by battle-wide id, in any order, and as the tree has them.
        found: Vec<Vec<u32>>,
        by_tree: Vec<Vec<u32>>,
    }

    impl Kernel for &mut Search<'_> {
        #[inline(always)]
        fn run<S: InstructionSet>(self, simd: S) {
            let n = self.positions.len();
            let stats = AvoidanceParams { neighbour_range_squared: self.range_squared, ..Default::default() };
            let (mut plane, mut near, mut sorted) = Default::default();
            PlaneUnits::reserve(&mut plane, n);
            NearList::reserve(&mut near, n);
            NearestList::reserve(&mut sorted, n);
            let mut ids: Vec<u32> = (0..n as u32).collect();
            let stats = vec![stats; n];
            let (velocities, preferred) = (&vec![Vec2::ZERO; n], &vec![Vec2::ONE; n]);
            let battle = BattleUnits { positions: self.positions, velocities, preferred, stats: &stats };
            plane.pack(simd, &mut ids, &battle);
            let edges = EdgesByCell::new(&Terrain::from_fn(32, 32, |_, _| true).unwrap(), 1.0);
            plane.find_unconstrained(simd, &edges);
            plane.find_neighbours(simd, &stats, &edges, &mut near);
            (self.found, self.by_tree) = (vec![Vec::new(); n], vec![Vec::new(); n]);
            for NearUnit { index, neighbours, .. } in near.units() {
                let id = |index: usize| plane.members()[index].id;
                let unit = id(index) as usize;
                neighbours.iter().for_each(|near| near.for_each(|index| self.found[unit].push(id(index))));
                plane.find_by_tree(index, self.range_squared, &mut sorted);
                let id = |index: usize| plane.members()[index].id;
                self.by_tree[unit] = sorted.indices().map(id).collect();
            }
        }
    }

    /// The same at every level.
    fn search(positions: &[Vec2], range_squared: f32) -> [Vec<Vec<u32>>; 2] {
        let at = |level: Level| {
            let mut search = Search { positions, range_squared, found: Vec::new(), by_tree: Vec::new() };
            level.run(&mut search);
            [search.found, search.by_tree]
        };
        let found = at(Level::default());
        for level in Level::available() {
            assert_eq!(at(level), found, "{level:?}");
        }
        found
    }

    /// A grid, so that there are many equal distances, and a few units in one spot.
    #[test]
    fn finds_those_in_range() {
        let spot = |i: usize| Vec2::new((i * 37 % 23) as f32 * 0.25, (i * 53 % 19) as f32 * 0.25);
        let positions: Vec<Vec2> = (0..1200).map(spot).collect();
        for n in [1, 4, 9, 10, 11, 63, 64, 65, 97, 1100] {
            let positions = &positions[..n];
            for range_squared in [0.0, 0.1, 1.3, 100.0] {
                let [found, by_tree] = search(positions, range_squared);
                for (id, (mut found, mut by_tree)) in found.into_iter().zip(by_tree).enumerate() {
                    let away = |other: &u32| (positions[id] - positions[*other as usize]).length_squared();
                    let near = |other: &u32| away(other) < range_squared && *other as usize != id;
                    let expected: Vec<u32> = (0..n as u32).filter(near).collect();
                    found.sort_unstable();
                    assert_eq!(found, expected);
                    assert!(by_tree.is_sorted_by_key(away), "nearest first: {by_tree:?}");
                    by_tree.sort_unstable();
                    assert!(n <= 10 || by_tree == expected);
                }
            }
        }
    }

    /// Of more than a leaf of the tree holds, those in the half whose box is nearer; of equally near boxes
    /// the upper one.
    #[test]
    fn of_many_equally_near_the_tree_decides() {
        let positions: Vec<Vec2> = (0..12).map(|x| Vec2::new(x as f32, 0.0)).collect();
        let [_, by_tree] = search(&positions, 2.0);
        assert_eq!([&by_tree[5][..], &by_tree[6][..]], [[4, 6], [7, 5]]);
    }
}
