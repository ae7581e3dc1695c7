//! The living units of a plane, packed for one tick, and the search among them for neighbours.

use std::hint::select_unpredictable;

use glam::Vec2;

use super::nearest_list::NearestList;
use super::tree::Tree;
use crate::arena::{AvoidanceParams, EdgesByCell};
use crate::simd::{F32s, InstructionSet, MAX_WIDTH, Vec2s};
use crate::units::clear_and_reserve;

/// Units whose search results are one word: bit i is unit `WORD * word + i`.
pub(super) const WORD: usize = u64::BITS as usize;

/// The living units of a plane, in the order of [`NeighbourOrder`](crate::NeighbourOrder); a unit's *index*
/// is its number in that order.
#[derive(Debug, Default)]
pub(super) struct PlaneUnits {
    /// The members; entries from `n` on are stale, here and below.
    members: Vec<Member>,
    n: usize,
    /// The indices of the units that move.
    movers: Vec<u32>,
    n_movers: usize,
    /// What is computed for several units at a time, by index. Padded to full registers; padding is at
    /// infinity, where no search finds it.
    position: Columns,
    preferred: Columns,
    max_speed: Vec<f32>,
    /// The preferred velocity within the speed limit.
    unconstrained: Columns,
    /// The cell in which each unit is.
    cell: Vec<f32>,
    /// The corners of the box around the units of each word, padded to [`MAX_WIDTH`] with boxes at infinity.
    /// Empty if there is one word only.
    low: Columns,
    high: Columns,
    /// Decides which of two equally near units comes first, if there are more units than fit in a leaf.
    tree: Tree,
    /// Memory for the results of the tree.
    visited: Vec<u32>,
}

/// The coordinates of one vector per unit.
#[derive(Debug, Default)]
pub(super) struct Columns {
    pub x: Vec<f32>,
    pub y: Vec<f32>,
}

impl Columns {
    pub fn resize(&mut self, n: usize) {
        self.x.resize(n, 0.0);
        self.y.resize(n, 0.0);
    }

    #[inline(always)]
    pub fn load<S: InstructionSet>(&self, simd: S, begin: usize) -> Vec2s<S> {
        Vec2s { x: F32s::from_slice(simd, &self.x[begin..]), y: F32s::from_slice(simd, &self.y[begin..]) }
    }

    pub fn get(&self, index: usize) -> Vec2 {
        Vec2::new(self.x[index], self.y[index])
    }

    pub fn swap(&mut self, one: usize, other: usize) {
        self.x.swap(one, other);
        self.y.swap(one, other);
    }
}

/// A unit as its neighbours see it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Member {
    pub position: Vec2,
    /// The velocity that it planned in the last tick, which its neighbours expect it to keep.
    pub velocity: Vec2,
    pub radius: f32,
    /// The share of the avoidance that neighbours take. Reciprocity: both units take one half each. A unit
    /// that stays takes none, so its neighbours take all.
    pub share: f32,
    /// Battle-wide id.
    pub id: u32,
}

/// Some neighbours of a unit: those of one word.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Near {
    /// The unit's index.
    pub index: u32,
    word: u32,
    /// Bit i stands for the unit with index `WORD * word + i`.
    bits: u64,
}

/// The neighbours of all units of a plane, unit by unit.
#[derive(Debug, Default)]
pub(super) struct NearList {
    /// Entries from `n` on are stale.
    entries: Vec<Near>,
    n: usize,
}

impl NearList {
    pub fn reserve(&mut self, n_units: usize) {
        // Every unit has at most one entry per word, and one more.
        self.entries.resize(n_units * (n_units.div_ceil(WORD) + 1), Near::default());
    }

    pub fn clear(&mut self) {
        self.n = 0;
    }

    /// Written before it is known whether it is needed: no branch, which would be hard to predict.
    #[inline(always)]
    fn add_if(&mut self, condition: bool, entry: Near) {
        self.entries[self.n] = entry;
        self.n += usize::from(condition);
    }

    /// The entries of each unit.
    pub fn units(&self) -> impl Iterator<Item = &[Near]> {
        self.entries[..self.n].chunk_by(|a, b| a.index == b.index)
    }
}

impl Near {
    /// Whether the unit may see an edge: its first entry has no neighbours then.
    pub fn may_see_edges(&self) -> bool {
        self.bits == 0
    }

    /// Visits the indices of the neighbours, ascending.
    #[inline(always)]
    pub fn for_each(&self, mut visit: impl FnMut(usize)) {
        let (begin, mut bits) = (self.word as usize * WORD, self.bits);
        while bits != 0 {
            visit(begin + bits.trailing_zeros() as usize);
            // Clears the lowest bit.
            bits &= bits - 1;
        }
    }

    /// These neighbours, all of the first word.
    #[cfg(test)]
    pub fn of(indices: &[usize]) -> Near {
        Near { bits: indices.iter().fold(0, |bits, index| bits | 1 << index), ..Near::default() }
    }
}

impl PlaneUnits {
    /// Reserves memory for `n_units` units.
    pub fn reserve(&mut self, n_units: usize) {
        self.members.resize(n_units, Member::default());
        clear_and_reserve(&mut self.visited, n_units);
        let n_padded = n_units.next_multiple_of(MAX_WIDTH);
        let n_boxes = n_units.div_ceil(WORD).next_multiple_of(MAX_WIDTH);
        self.movers.resize(n_units, 0);
        for columns in [&mut self.preferred, &mut self.unconstrained] {
            columns.resize(n_padded);
        }
        // The tree loads registers from any unit on.
        self.position.resize(n_padded + MAX_WIDTH);
        self.max_speed.resize(n_padded, 0.0);
        self.cell.resize(n_padded, 0.0);
        self.low.resize(n_boxes);
        self.high.resize(n_boxes);
        self.tree.reserve(n_units);
    }

    /// Packs the units of a list, which is put in the order that equally near neighbours require. The other
    /// slices are by battle-wide id.
    #[inline(always)]
    pub fn pack<S: InstructionSet>(
        &mut self,
        simd: S,
        ids: &mut [u32],
        positions: &[Vec2],
        velocities: &[Vec2],
        preferred: &[Vec2],
        stats: &[AvoidanceParams],
    ) {
        let n = ids.len();
        // The last register of coordinates as a whole, in one store, before the units overwrite a part of it.
        let last = n.saturating_sub(1) / MAX_WIDTH * MAX_WIDTH;
        for column in [&mut self.position.x, &mut self.position.y] {
            column[last..][..MAX_WIDTH].copy_from_slice(&[f32::INFINITY; MAX_WIDTH]);
        }
        let has_tree = n > Tree::LEAF_SIZE;
        if has_tree {
            let Columns { x, y } = &mut self.position;
            for ((&id, x), y) in ids.iter().zip(x).zip(y) {
                (*x, *y) = positions[id as usize].into();
            }
            self.tree.build(simd, ids, &mut self.position);
        }
        // Slices of one known length: one check of an index serves them all.
        let (members, movers) = (&mut self.members[..n], &mut self.movers[..n]);
        let (x, y) = (&mut self.position.x[..n], &mut self.position.y[..n]);
        let (preferred_x, preferred_y) = (&mut self.preferred.x[..n], &mut self.preferred.y[..n]);
        let max_speed = &mut self.max_speed[..n];
        let n_units = positions.len();
        let (velocities, preferred, stats) =
            (&velocities[..n_units], &preferred[..n_units], &stats[..n_units]);
        let mut n_movers = 0;
        for (index, &id) in ids.iter().enumerate() {
            let i = id as usize;
            let (position, velocity, preferred) = (positions[i], velocities[i], preferred[i]);
            // Whether both are 0 or -0, by their bits: comparisons of floats become branches.
            let stays = (preferred.x.to_bits() | preferred.y.to_bits()) << 1 == 0;
            let share = select_unpredictable(stays, 1.0, 0.5);
            members[index] = Member { position, velocity, radius: stats[i].radius, share, id };
            // Not twice: registers that were just written float by float are slow to load.
            if !has_tree {
                (x[index], y[index]) = position.into();
            }
            (preferred_x[index], preferred_y[index]) = preferred.into();
            max_speed[index] = stats[i].max_speed;
            // Written before it is known whether it moves: no branch, which would be hard to predict.
            movers[n_movers] = index as u32;
            n_movers += usize::from(!stays);
        }
        (self.n, self.n_movers) = (n, n_movers);
        if n > WORD {
            self.find_boxes();
        }
    }

    fn find_boxes(&mut self) {
        let n = self.n;
        let columns = [
            (&self.position.x, &mut self.low.x, &mut self.high.x),
            (&self.position.y, &mut self.low.y, &mut self.high.y),
        ];
        for (column, low, high) in columns {
            low.fill(f32::INFINITY);
            high.fill(f32::INFINITY);
            for ((word, low), high) in column[..n].chunks(WORD).zip(low).zip(high) {
                *low = word.iter().copied().fold(f32::INFINITY, f32::min);
                *high = word.iter().copied().fold(f32::NEG_INFINITY, f32::max);
            }
        }
    }

    /// The indices of the units that move, ascending.
    pub fn movers(&self) -> &[u32] {
        &self.movers[..self.n_movers]
    }

    /// All members.
    pub fn members(&self) -> &[Member] {
        &self.members[..self.n]
    }

    /// The cell in which a unit is.
    pub fn cell(&self, index: usize) -> f32 {
        self.cell[index]
    }

    /// The velocity that a unit prefers.
    pub fn preferred(&self, index: usize) -> Vec2 {
        self.preferred.get(index)
    }

    /// The velocities of all units without neighbours and obstacles, with their ids, after
    /// [`find_unconstrained`](Self::find_unconstrained).
    #[inline(always)]
    pub fn all_unconstrained(&self) -> impl Iterator<Item = (u32, Vec2)> {
        let (x, y) = (&self.unconstrained.x[..self.n], &self.unconstrained.y[..self.n]);
        self.members().iter().zip(x).zip(y).map(|((member, &x), &y)| (member.id, Vec2::new(x, y)))
    }

    /// The velocity of a unit without neighbours or obstacles, after
    /// [`find_unconstrained`](Self::find_unconstrained).
    pub fn unconstrained(&self, index: usize) -> Vec2 {
        self.unconstrained.get(index)
    }

    /// Finds the cells of all units, and their velocities without neighbours and obstacles: the preferred
    /// ones within the speed limit. Those that are no finite number are zero.
    #[inline(always)]
    pub fn find_unconstrained<S: InstructionSet>(&mut self, simd: S, edges: &EdgesByCell) {
        let n = self.n.next_multiple_of(MAX_WIDTH);
        let (x, y) = (&self.preferred.x[..n], &self.preferred.y[..n]);
        let (to_x, to_y) = (&mut self.unconstrained.x[..n], &mut self.unconstrained.y[..n]);
        let max_speed = F32s::all(simd, &self.max_speed[..n]);
        let preferred = Vec2s::all(simd, x, y);
        let to = to_x.chunks_exact_mut(S::WIDTH).zip(to_y.chunks_exact_mut(S::WIDTH));
        for ((max_speed, preferred), (to_x, to_y)) in max_speed.zip(preferred).zip(to) {
            let velocity = preferred.within(max_speed).finite_or_zero();
            velocity.x.to_slice(to_x);
            velocity.y.to_slice(to_y);
        }
        let positions = Vec2s::all(simd, &self.position.x[..n], &self.position.y[..n]);
        for (position, to) in positions.zip(self.cell[..n].chunks_exact_mut(S::WIDTH)) {
            edges.cells(position).to_slice(to);
        }
    }

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
            list.add_if(may_see, Near { index, ..Near::default() });
            let centre = Vec2s::splat(simd, member.position);
            let range = F32s::splat(simd, stats.neighbour_range_squared);
            if self.n <= S::WIDTH {
                // Of a small plane, all positions stay in one register.
                let near = (centre - first).length_squared().lt(range).bits() & !(1 << index);
                list.add_if(near != 0, Near { index, word: 0, bits: near.into() });
                continue;
            }
            if n_words == 1 {
                self.find_in(centre, range, 0, index, list);
                continue;
            }
            for group in (0..n_words).step_by(MAX_WIDTH) {
                let mut words = self.near_words(centre, range, group);
                while words != 0 {
                    let word = group + words.trailing_zeros() as usize;
                    words &= words - 1;
                    self.find_in(centre, range, word, index, list);
                }
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

    #[inline(always)]
    fn find_in<S: InstructionSet>(
        &self,
        centre: Vec2s<S>,
        range: F32s<S>,
        word: usize,
        index: u32,
        list: &mut NearList,
    ) {
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
        bits &= !itself;
        list.add_if(bits != 0, Near { index, word: word as u32, bits });
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
    use super::*;
    use crate::simd::{Kernel, Level};
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
            plane.pack(simd, &mut ids, self.positions, &vec![Vec2::ZERO; n], &vec![Vec2::ONE; n], &stats);
            let edges = EdgesByCell::new(&Terrain::from_fn(32, 32, |_, _| true).unwrap(), 1.0);
            plane.find_unconstrained(simd, &edges);
            plane.find_neighbours(simd, &stats, &edges, &mut near);
            (self.found, self.by_tree) = (vec![Vec::new(); n], vec![Vec::new(); n]);
            for entries in near.units() {
                let index = entries[0].index as usize;
                let id = |index: usize| plane.members()[index].id;
                let unit = id(index) as usize;
                entries.iter().for_each(|near| near.for_each(|index| self.found[unit].push(id(index))));
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
