//! The order of the units of each plane in collision avoidance, which decides between equally near
//! neighbours.
//!
//! Of two equally near neighbours the one comes first that a k-d tree visits first, and the order of units in
//! the tree depends on the past: the list from which the tree is built begins an episode with ascending ids,
//! every tick partitions it in place (`tick::avoid`), and a unit that dies is replaced by the last of the
//! list. Nothing else resets it. So the list is part of a battle and of a snapshot.
//!
//! Where several units die in one tick, the order of their removal decides which is replaced by which. Units
//! are removed by descending number. A plane's units begin an episode with the numbers 0, 1, ... by ascending
//! id, and when a unit dies the unit with the last number gets its number.

use smaclite_units::Plane;

use crate::arena::Arena;
use crate::buffers::{clear_and_reserve, refill};
use crate::units::Units;

/// All planes, by `Plane as usize`.
const PLANES: [Plane; 3] = [Plane::Ground, Plane::Air, Plane::Colossus];

/// The living units of each plane, in the orders of collision avoidance.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NeighbourOrder {
    /// By plane: `GROUND`, `AIR`, `COLOSSUS`.
    pub planes: [PlaneOrder; PLANES.len()],
}

/// The living units of one plane by battle-wide id, in two orders.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PlaneOrder {
    /// The list that the tree partitions.
    pub list: Vec<u32>,
    /// The unit with each number.
    pub by_number: Vec<u32>,
}

impl NeighbourOrder {
    /// The order at the start of an episode: the units that are alive in `units`, by ascending id. `types`
    /// are the units' types, as a [`Snapshot`](crate::Snapshot) has them.
    ///
    /// # Panics
    /// If the arena has no such types.
    pub fn new(arena: &Arena, types: &[u32], units: &Units) -> NeighbourOrder {
        let mut order = NeighbourOrder::default();
        order.reset(arena, types.iter().copied(), units);
        order
    }

    /// Becomes equal to `other`, in its own memory.
    pub(crate) fn copy_from(&mut self, other: &NeighbourOrder) {
        for (plane, other) in self.planes.iter_mut().zip(&other.planes) {
            plane.list.clone_from(&other.list);
            plane.by_number.clone_from(&other.by_number);
        }
    }

    /// Resets the order, as a new episode does.
    pub(crate) fn reset(&mut self, arena: &Arena, types: impl Iterator<Item = u32> + Clone, units: &Units) {
        // Where types are drawn, another number of units is of a plane each time.
        let n_units = if arena.drawer().is_some() { units.alive.len() } else { 0 };
        for (plane, order) in PLANES.into_iter().zip(&mut self.planes) {
            clear_and_reserve(&mut order.list, n_units);
            clear_and_reserve(&mut order.by_number, n_units);
            refill(&mut order.list, alive_in(arena, types.clone(), units, plane));
            refill(&mut order.by_number, alive_in(arena, types.clone(), units, plane));
        }
    }

    /// Removes the units that are no longer alive.
    pub(crate) fn remove_dead(&mut self, units: &Units) {
        for PlaneOrder { list, by_number } in &mut self.planes {
            // Descending, so that the unit that gets a number from `swap_remove` was examined already.
            for number in (0..by_number.len()).rev() {
                let id = by_number[number];
                if !units.alive[id as usize] {
                    by_number.swap_remove(number);
                    if let Some(i) = list.iter().position(|&other| other == id) {
                        list.swap_remove(i);
                    }
                }
            }
        }
    }

    /// Whether the orders name the living units and no others.
    pub(crate) fn is_of_living(&self, arena: &Arena, units: &Units) -> bool {
        let mut named = vec![false; units.alive.len()];
        let ids = self.planes.iter().flat_map(|plane| &plane.list);
        ids.filter_map(|id| named.get_mut(*id as usize).map(|named| *named = true)).count();
        arena.unit_ids().all(|id| named[id as usize] == units.alive[id as usize])
    }

    /// The first plane whose orders do not contain exactly the living units of that plane, if any.
    pub(crate) fn invalid_plane(&self, arena: &Arena, types: &[u32], units: &Units) -> Option<Plane> {
        // Both orders must be permutations of the living units, which `alive_in` lists ascending.
        let is_valid = |(plane, order): &(Plane, &PlaneOrder)| {
            [&order.list, &order.by_number].into_iter().all(|ids| {
                let mut ids = ids.clone();
                ids.sort_unstable();
                ids.into_iter().eq(alive_in(arena, types.iter().copied(), units, *plane))
            })
        };
        PLANES.into_iter().zip(&self.planes).find(|plane| !is_valid(plane)).map(|(plane, _)| plane)
    }
}

fn alive_in(
    arena: &Arena,
    types: impl Iterator<Item = u32>,
    units: &Units,
    plane: Plane,
) -> impl Iterator<Item = u32> {
    let all = (0..).zip(types).zip(&units.alive);
    let belongs = move |((_, unit_type), alive): &((u32, u32), &bool)| {
        **alive && arena.types()[*unit_type as usize].plane == plane
    };
    all.filter(belongs).map(|((id, _), _)| id)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Units 2 and 0 have exchanged their numbers, because of deaths before; the one with the higher number
    /// goes first.
    #[test]
    fn of_two_deaths_in_a_tick_the_higher_number_is_removed_first() {
        let mut order = NeighbourOrder::default();
        order.planes[0] = PlaneOrder { list: vec![2, 1, 0, 3, 4], by_number: vec![2, 1, 0, 4, 3] };
        let mut alive = vec![true; 5];
        (alive[0], alive[2]) = (false, false);
        order.remove_dead(&Units { alive, ..Units::default() });
        // Unit 0, with number 2, was replaced by 4; then unit 2, with number 0, by 3.
        assert_eq!(order.planes[0], PlaneOrder { list: vec![3, 1, 4], by_number: vec![4, 1, 3] });
    }
}
