//! The living units of a plane, packed for one tick, and the search among them for neighbours.

use std::hint::select_unpredictable;

use glam::Vec2;

use super::found::Found;
use super::tree::Tree;
use crate::lanes::{Floats, LANES, PART, Vectors, mask};
use crate::units::make_room;

/// The living units of a plane, in the order of [`NeighbourOrder`](crate::NeighbourOrder); a unit's *place* is its number
/// in that order.
#[derive(Debug, Default)]
pub(super) struct Crowd {
    /// The members; once packed, behind them [`LANES`] nobodies at infinity.
    members: Vec<Member>,
    /// How many members there are.
    n_members: usize,
    /// The places of those who do not stay, once packed.
    movers: Vec<u32>,
    /// The positions of all members, four an entry. The last entry is filled up with positions at infinity, which
    /// no search finds.
    positions: Vec<Vectors>,
    /// Answers which of two equally near units comes first, if there are more units than a leaf holds.
    tree: Tree,
    /// Memory for the tree's answer.
    met: Vec<u32>,
}

/// What others know of a unit.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Member {
    /// Position and velocity.
    motion: Floats,
    /// Radius, the share of the avoidance that falls to others, and battle-wide id.
    body: Floats,
    pub id: u32,
}

impl Member {
    pub fn new(id: u32, position: Vec2, velocity: Vec2, radius: f32, stays: bool) -> Member {
        // A unit that stays where it is will not do its half.
        let share = select_unpredictable(stays, 1.0, 0.5);
        Member {
            motion: Floats::new([position.x, position.y, velocity.x, velocity.y]),
            body: Floats::new([radius, share, 0.0, 0.0]),
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

/// Neighbours of a unit as bits, one a place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Few(u64);

impl Few {
    /// Whether there is any.
    pub fn is_any(self) -> bool {
        self.0 != 0
    }
}

/// Four members, quantity by quantity.
pub(super) struct FourMembers {
    pub position: Vectors,
    pub velocity: Vectors,
    pub radius: Floats,
    pub share: Floats,
}

impl FourMembers {
    #[inline]
    pub fn of(members: [&Member; LANES]) -> FourMembers {
        let [x, y, vx, vy] = Floats::transpose(members.map(|member| member.motion));
        let [radius, share, ..] = Floats::transpose(members.map(|member| member.body));
        FourMembers { position: Vectors { x, y }, velocity: Vectors { x: vx, y: vy }, radius, share }
    }
}

impl Crowd {
    pub fn fit(&mut self, n_units: usize) {
        make_room(&mut self.members, n_units + LANES);
        make_room(&mut self.movers, n_units);
        make_room(&mut self.positions, n_units.div_ceil(LANES));
        make_room(&mut self.met, n_units);
        self.tree.fit(n_units);
    }

    pub fn clear(&mut self) {
        self.members.clear();
        self.movers.clear();
        self.positions.clear();
    }

    /// Partitions the ids of the units to come, as the order of equally near neighbours asks.
    pub fn sort(&mut self, ids: &mut [u32], positions: &[Vec2]) {
        if ids.len() > Tree::LEAF_SIZE {
            self.tree.grow(ids, positions);
        }
    }

    /// Adds a unit, in the order of the sorted ids. When all are there, the crowd is to be [packed](Self::pack).
    pub fn push(&mut self, member: Member, stays: bool) {
        self.movers.push(self.members.len() as u32);
        keep_last_if(!stays, &mut self.movers);
        self.members.push(member);
    }

    pub fn pack(&mut self) {
        self.n_members = self.members.len();
        self.members.extend([Member::new(0, Vec2::INFINITY, Vec2::ZERO, 0.0, false); LANES]);
        for members in self.members[..self.n_members.next_multiple_of(LANES)].as_chunks().0 {
            self.positions.push(FourMembers::of(members.each_ref()).position);
        }
    }

    /// Who does not stay, in order of place.
    pub fn movers(&self) -> &[u32] {
        &self.movers
    }

    /// A member by its place.
    pub fn member(&self, place: usize) -> &Member {
        &self.members[place]
    }

    /// All members.
    pub fn members(&self) -> &[Member] {
        &self.members[..self.n_members]
    }

    /// Whether there are so few members that [`Few`] has a bit for each.
    pub fn is_small(&self) -> bool {
        self.n_members <= PART
    }

    /// The neighbours of the member in `place` of a [small](Self::is_small) crowd.
    pub fn near(&self, place: usize, range_squared: f32) -> Few {
        let (centre, range) = (Vectors::splat(self.members[place].position()), Floats::splat(range_squared));
        let near = mask(&self.positions, |four| (centre - *four).length_squared().simd_lt(range));
        Few(near & !(1 << place))
    }

    /// The first four of those, filled up with nobodies; `None` if there are more than four.
    pub fn four(&self, few: Few) -> Option<FourMembers> {
        let mut bits = few.0;
        let four = [(); LANES].map(|()| {
            let place = bits.trailing_zeros() as usize;
            bits &= bits.wrapping_sub(1);
            &self.members[place.min(self.n_members)]
        });
        (bits == 0).then(|| FourMembers::of(four))
    }

    /// Whether the order of units that are equally near is that of their places, and not the [tree's](Tree).
    pub fn equals_keep_order(&self) -> bool {
        self.n_members <= Tree::LEAF_SIZE
    }

    /// Finds the members whose squared distance to that in `place` is below `range_squared`, nearest first.
    pub fn find(&mut self, place: usize, range_squared: f32, found: &mut Found) {
        found.clear();
        let position = self.members[place].position();
        let (centre, range) = (Vectors::splat(position), Floats::splat(range_squared));
        for (part, fours) in self.positions.chunks(PART / LANES).enumerate() {
            let mut near = mask(fours, |four| (centre - *four).length_squared().simd_lt(range));
            while near != 0 {
                let other = part * PART + near.trailing_zeros() as usize;
                near &= near - 1;
                if other != place {
                    let distance_squared = (position - self.members[other].position()).length_squared();
                    found.insert(distance_squared, other);
                }
            }
        }
        if !self.equals_keep_order() && found.has_equals() {
            self.find_by_tree(place, range_squared, found);
        }
    }

    /// The same in the order of the tree where distances are equal.
    #[cold]
    fn find_by_tree(&mut self, place: usize, range_squared: f32, found: &mut Found) {
        let Crowd { members, tree, met, .. } = self;
        found.clear();
        met.clear();
        tree.find(members[place].position(), range_squared, |distance_squared, other| {
            if other as usize != place {
                found.insert(distance_squared, met.len());
                met.push(other);
            }
        });
        found.replace(met);
    }
}

/// Keeps the last of a list only on this condition, which nobody can foretell: there is no branch to go wrong.
pub(super) fn keep_last_if<T: Copy>(condition: bool, list: &mut Vec<T>) {
    list.truncate(select_unpredictable(condition, list.len(), list.len() - 1));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A crowd of units with ids from 0 up.
    fn crowd(positions: &[Vec2]) -> Crowd {
        let mut crowd = Crowd::default();
        let mut ids: Vec<u32> = (0..positions.len() as u32).collect();
        crowd.sort(&mut ids, positions);
        for &id in &ids {
            crowd.push(Member::new(id, positions[id as usize], Vec2::ZERO, 0.5, false), false);
        }
        crowd.pack();
        crowd
    }

    fn find(crowd: &mut Crowd, place: usize, range_squared: f32) -> Vec<usize> {
        let mut found = Found::default();
        crowd.find(place, range_squared, &mut found);
        found.places().collect()
    }

    /// A grid, so that there are many equal distances, and a few units in one spot.
    #[test]
    fn finds_those_in_range_nearest_first() {
        let positions: Vec<Vec2> =
            (0..97).map(|i| Vec2::new((i * 37 % 23) as f32 * 0.25, (i * 53 % 19) as f32 * 0.25)).collect();
        for n in [1, 4, 9, 10, 11, 97] {
            let mut crowd = crowd(&positions[..n]);
            for place in 0..n {
                let positions: Vec<Vec2> = crowd.members().iter().map(Member::position).collect();
                let away = |other: &usize| (positions[place] - positions[*other]).length_squared();
                for range_squared in [0.0, 0.1, 1.3, 100.0] {
                    let mut found = find(&mut crowd, place, range_squared);
                    assert!(found.is_sorted_by_key(away), "nearest first: {found:?}");
                    found.sort_unstable();
                    let near = |other: &usize| away(other) < range_squared && *other != place;
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
            let mut crowd = crowd(&positions[..n]);
            assert!(crowd.is_small());
            for (place, range_squared) in (0..n).flat_map(|place| [0.0, 0.1, 0.3, 1.3].map(|r| (place, r))) {
                let few = crowd.near(place, range_squared);
                let mut found = find(&mut crowd, place, range_squared);
                found.sort_unstable();
                assert_eq!((0..64).filter(|bit| few.0 >> bit & 1 == 1).collect::<Vec<_>>(), found);
                assert_eq!(few.is_any(), !found.is_empty());
                let Some(four) = crowd.four(few) else {
                    assert!(found.len() > LANES);
                    continue;
                };
                found.resize(LANES, n); // behind the members there are nobodies
                let x = found.iter().map(|place| crowd.members[*place].position().x).collect::<Vec<_>>();
                assert_eq!(four.position.x.to_array(), x[..]);
            }
        }
        assert!(!crowd(&positions).is_small());
    }

    #[test]
    fn of_a_few_equally_near_the_lowest_id_is_first() {
        assert_eq!(find(&mut crowd(&[Vec2::X, Vec2::ZERO, Vec2::NEG_X]), 1, 2.0), [0, 2]);
    }

    /// Of more than a leaf of the tree holds, those in the half whose box is nearer; of equally near boxes the
    /// upper one.
    #[test]
    fn of_many_equally_near_the_tree_decides() {
        let positions: Vec<Vec2> = (0..12).map(|x| Vec2::new(x as f32, 0.0)).collect();
        let mut crowd = crowd(&positions);
        assert_eq!(find(&mut crowd, 5, 2.0), [4, 6]);
        assert_eq!(find(&mut crowd, 6, 2.0), [7, 5]);
    }
}
