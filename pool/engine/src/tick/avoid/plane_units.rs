//! The living units of a plane, packed for one tick, and the search among them for neighbours.

use std::hint::select_unpredictable;

use glam::Vec2;

use super::nearest_list::NearestList;
use super::tree::Tree;
use crate::simd::{F32x4, MASK_BITS, Vec2x4, WIDTH, mask};
use crate::units::clear_and_reserve;

/// The living units of a plane, in the order of [`NeighbourOrder`](crate::NeighbourOrder); a unit's *index*
/// is its number in that order.
#[derive(Debug, Default)]
pub(super) struct PlaneUnits {
    /// The members; once packed, followed by [`WIDTH`] entries of padding at infinity.
    members: Vec<Neighbour>,
    /// Number of members.
    n_members: usize,
    /// The indices of the units that move.
    movers: Vec<u32>,
    /// The positions of all members, four per entry. The last entry is padded with positions at infinity,
    /// which no search finds.
    positions: Vec<Vec2x4>,
    /// Decides which of two equally near units comes first, if there are more units than fit in a leaf.
    tree: Tree,
    /// Memory for the results of the tree.
    visited: Vec<u32>,
}

/// A unit as its neighbours see it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Neighbour {
    /// Position and velocity; `body` has the radius, and the share of the avoidance that neighbours take.
    /// They are packed so that four neighbours can be transposed into [`NeighbourX4`] from whole registers.
    motion: F32x4,
    body: F32x4,
    /// Battle-wide id.
    pub id: u32,
}

impl Neighbour {
    pub fn new(id: u32, position: Vec2, velocity: Vec2, radius: f32, stays: bool) -> Neighbour {
        // Reciprocity: both units take one half each. A unit that stays takes none, so its neighbours take
        // all.
        let share = select_unpredictable(stays, 1.0, 0.5);
        Neighbour {
            motion: F32x4::new([position.x, position.y, velocity.x, velocity.y]),
            body: F32x4::new([radius, share, 0.0, 0.0]),
            id,
        }
    }

    pub fn position(&self) -> Vec2 {
        let [x, y, ..] = *self.motion.as_array();
        Vec2::new(x, y)
    }

    pub fn velocity(&self) -> Vec2 {
        let [.., x, y] = *self.motion.as_array();
        Vec2::new(x, y)
    }
}

/// Neighbours of a unit as bits, one per index.
#[derive(Clone, Copy, Debug)]
pub(super) struct NeighbourMask(u64);

impl NeighbourMask {
    /// Whether there is any.
    pub fn is_any(self) -> bool {
        self.0 != 0
    }
}

/// Four neighbours, one vector per quantity.
pub(super) struct NeighbourX4 {
    pub position: Vec2x4,
    pub velocity: Vec2x4,
    pub radius: F32x4,
    pub share: F32x4,
}

impl NeighbourX4 {
    #[inline]
    pub fn of(members: [&Neighbour; WIDTH]) -> NeighbourX4 {
        let [x, y, vx, vy] = F32x4::transpose(members.map(|member| member.motion));
        let [radius, share, ..] = F32x4::transpose(members.map(|member| member.body));
        NeighbourX4 { position: Vec2x4 { x, y }, velocity: Vec2x4 { x: vx, y: vy }, radius, share }
    }
}

impl PlaneUnits {
    pub fn reserve(&mut self, n_units: usize) {
        clear_and_reserve(&mut self.members, n_units + WIDTH);
        clear_and_reserve(&mut self.movers, n_units);
        clear_and_reserve(&mut self.positions, n_units.div_ceil(WIDTH));
        clear_and_reserve(&mut self.visited, n_units);
        self.tree.reserve(n_units);
    }

    pub fn clear(&mut self) {
        self.members.clear();
        self.movers.clear();
        self.positions.clear();
    }

    /// Partitions the ids of the units that will be added, as the order of equally near neighbours requires.
    pub fn sort(&mut self, ids: &mut [u32], positions: &[Vec2]) {
        if ids.len() > Tree::LEAF_SIZE {
            self.tree.build(ids, positions);
        }
    }

    /// Adds a unit, in the order of the sorted ids. After the last one, [`pack`](Self::pack) must be called.
    pub fn push(&mut self, member: Neighbour, stays: bool) {
        self.movers.push(self.members.len() as u32);
        keep_last_if(!stays, &mut self.movers);
        self.members.push(member);
    }

    pub fn pack(&mut self) {
        // The padding lets `four` and the loop below read whole groups of four.
        self.n_members = self.members.len();
        self.members.extend([Neighbour::new(0, Vec2::INFINITY, Vec2::ZERO, 0.0, false); WIDTH]);
        for members in self.members[..self.n_members.next_multiple_of(WIDTH)].as_chunks().0 {
            self.positions.push(NeighbourX4::of(members.each_ref()).position);
        }
    }

    /// The indices of the units that move, ascending.
    pub fn movers(&self) -> &[u32] {
        &self.movers
    }

    /// A member by its index.
    pub fn member(&self, index: usize) -> &Neighbour {
        &self.members[index]
    }

    /// All members.
    pub fn members(&self) -> &[Neighbour] {
        &self.members[..self.n_members]
    }

    /// Whether [`NeighbourMask`] has a bit for each member.
    pub fn is_small(&self) -> bool {
        self.n_members <= MASK_BITS
    }

    /// The neighbours of the member in `index` of a [small](Self::is_small) plane.
    pub fn near(&self, index: usize, range_squared: f32) -> NeighbourMask {
        let (centre, range) = (Vec2x4::splat(self.members[index].position()), F32x4::splat(range_squared));
        let near = mask(&self.positions, |four| (centre - *four).length_squared().simd_lt(range));
        // The unit itself is always near.
        NeighbourMask(near & !(1 << index))
    }

    /// These neighbours, padded to four; `None` if there are more.
    pub fn four(&self, mask: NeighbourMask) -> Option<NeighbourX4> {
        let mut bits = mask.0;
        let four = [(); WIDTH].map(|()| {
            // Without a bit left this is 64, and the limit below makes it the first entry of padding.
            let index = bits.trailing_zeros() as usize;
            bits &= bits.wrapping_sub(1);
            &self.members[index.min(self.n_members)]
        });
        (bits == 0).then(|| NeighbourX4::of(four))
    }

    /// Whether the order of units that are equally near is that of their indices, and not the [tree's](Tree).
    pub fn equals_keep_order(&self) -> bool {
        self.n_members <= Tree::LEAF_SIZE
    }

    /// Finds the members whose squared distance to that in `index` is below `range_squared`, nearest first.
    pub fn find(&mut self, index: usize, range_squared: f32, found: &mut NearestList) {
        found.clear();
        let position = self.members[index].position();
        let (centre, range) = (Vec2x4::splat(position), F32x4::splat(range_squared));
        for (part, fours) in self.positions.chunks(MASK_BITS / WIDTH).enumerate() {
            let mut near = mask(fours, |four| (centre - *four).length_squared().simd_lt(range));
            // For every bit that is set, lowest first.
            while near != 0 {
                let other = part * MASK_BITS + near.trailing_zeros() as usize;
                near &= near - 1;
                if other != index {
                    let distance_squared = (position - self.members[other].position()).length_squared();
                    found.insert(distance_squared, other);
                }
            }
        }
        if !self.equals_keep_order() && found.has_equals() {
            self.find_by_tree(index, range_squared, found);
        }
    }

    /// The same, in the order of the tree where distances are equal.
    #[cold]
    fn find_by_tree(&mut self, index: usize, range_squared: f32, found: &mut NearestList) {
        let PlaneUnits { members, tree, visited, .. } = self;
        // Equal distances are sorted by index, so the index is first the number of the visit and then
        // replaced.
        found.clear();
        visited.clear();
        tree.find(members[index].position(), range_squared, |distance_squared, other| {
            if other as usize != index {
                found.insert(distance_squared, visited.len());
                visited.push(other);
            }
        });
        found.replace(visited);
    }
}

/// Removes the last element unless the condition holds, without a branch, which would be hard to predict.
pub(super) fn keep_last_if<T: Copy>(condition: bool, list: &mut Vec<T>) {
    list.truncate(select_unpredictable(condition, list.len(), list.len() - 1));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plane of units with ids from 0 up.
    fn plane(positions: &[Vec2]) -> PlaneUnits {
        let mut plane = PlaneUnits::default();
        let mut ids: Vec<u32> = (0..positions.len() as u32).collect();
        plane.sort(&mut ids, positions);
        for &id in &ids {
            plane.push(Neighbour::new(id, positions[id as usize], Vec2::ZERO, 0.5, false), false);
        }
        plane.pack();
        plane
    }

    fn find(plane: &mut PlaneUnits, index: usize, range_squared: f32) -> Vec<usize> {
        let mut found = NearestList::default();
        plane.find(index, range_squared, &mut found);
        found.indices().collect()
    }

    /// A grid, so that there are many equal distances, and a few units in one spot.
    #[test]
    fn finds_those_in_range_nearest_first() {
        let positions: Vec<Vec2> =
            (0..97).map(|i| Vec2::new((i * 37 % 23) as f32 * 0.25, (i * 53 % 19) as f32 * 0.25)).collect();
        for n in [1, 4, 9, 10, 11, 97] {
            let mut plane = plane(&positions[..n]);
            for index in 0..n {
                let positions: Vec<Vec2> = plane.members().iter().map(Neighbour::position).collect();
                let away = |other: &usize| (positions[index] - positions[*other]).length_squared();
                for range_squared in [0.0, 0.1, 1.3, 100.0] {
                    let mut found = find(&mut plane, index, range_squared);
                    assert!(found.is_sorted_by_key(away), "nearest first: {found:?}");
                    found.sort_unstable();
                    let near = |other: &usize| away(other) < range_squared && *other != index;
                    assert_eq!(found, (0..n).filter(near).collect::<Vec<_>>());
                }
            }
        }
    }

    #[test]
    fn a_few_are_found_as_all_are() {
        let positions: Vec<Vec2> =
            (0..65).map(|i| Vec2::new((i * 37 % 23) as f32 * 0.25, (i * 53 % 19) as f32 * 0.25)).collect();
        for n in [1, 2, 4, 7, 64] {
            let mut plane = plane(&positions[..n]);
            assert!(plane.is_small());
            for (index, range_squared) in (0..n).flat_map(|index| [0.0, 0.1, 0.3, 1.3].map(|r| (index, r))) {
                let mask = plane.near(index, range_squared);
                let mut found = find(&mut plane, index, range_squared);
                found.sort_unstable();
                assert_eq!((0..64).filter(|bit| mask.0 >> bit & 1 == 1).collect::<Vec<_>>(), found);
                assert_eq!(mask.is_any(), !found.is_empty());
                let Some(four) = plane.four(mask) else {
                    assert!(found.len() > WIDTH);
                    continue;
                };
                found.resize(WIDTH, n); // padding follows the members
                let x = found.iter().map(|index| plane.members[*index].position().x).collect::<Vec<_>>();
                assert_eq!(four.position.x.to_array(), x[..]);
            }
        }
        assert!(!plane(&positions).is_small());
    }

    #[test]
    fn of_a_few_equally_near_the_lowest_id_is_first() {
        assert_eq!(find(&mut plane(&[Vec2::X, Vec2::ZERO, Vec2::NEG_X]), 1, 2.0), [0, 2]);
    }

    /// Of more than a leaf of the tree holds, those in the half whose box is nearer; of equally near boxes
    /// the upper one.
    #[test]
    fn of_many_equally_near_the_tree_decides() {
        let positions: Vec<Vec2> = (0..12).map(|x| Vec2::new(x as f32, 0.0)).collect();
        let mut plane = plane(&positions);
        assert_eq!(find(&mut plane, 5, 2.0), [4, 6]);
        assert_eq!(find(&mut plane, 6, 2.0), [7, 5]);
    }
}
