//! The order in which collision avoidance keeps the units of each plane, and its history.
//!
//! Two neighbours that are equally near are answered in the order in which a k-d tree meets them, and the order in
//! which its leaves hold units has a history: the list from which the tree is built begins an episode with
//! ascending ids, every tick partitions it in place (`tick::avoid`), and a unit that dies is replaced by the last
//! of the list. Nothing else resets it. So the list is part of a battle, and of a snapshot.

use smaclite_units::Plane;

use crate::arena::Arena;
use crate::units::{Units, refill};

/// All planes, by `Plane as usize`.
const PLANES: [Plane; 3] = [Plane::Ground, Plane::Air, Plane::Colossus];

/// The living units of each plane by battle-wide id, in the order in which collision avoidance keeps them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NeighbourOrder {
    /// By plane: `GROUND`, `AIR`, `COLOSSUS`.
    pub planes: [Vec<u32>; PLANES.len()],
}

impl NeighbourOrder {
    /// The order without a history: the units that are alive in `units`, by ascending id.
    ///
    /// # Panics
    /// If `units` has another number of units than the arena.
    pub fn new(arena: &Arena, units: &Units) -> NeighbourOrder {
        let mut order = NeighbourOrder::default();
        order.reset(arena, units);
        order
    }

    /// Forgets the history, as a new episode does.
    pub(crate) fn reset(&mut self, arena: &Arena, units: &Units) {
        for (plane, ids) in PLANES.into_iter().zip(&mut self.planes) {
            refill(ids, living_in(arena, units, plane));
        }
    }

    /// Takes out the units that are no longer alive: each is replaced by the last of its list, the hindmost first.
    pub(crate) fn remove_dead(&mut self, units: &Units) {
        for ids in &mut self.planes {
            for i in (0..ids.len()).rev() {
                if !units.alive[ids[i] as usize] {
                    ids.swap_remove(i);
                }
            }
        }
    }

    /// Whether the lists hold exactly the living units, each in its plane; else the first plane that does not.
    pub(crate) fn check(&self, arena: &Arena, units: &Units) -> Result<(), Plane> {
        for (plane, ids) in PLANES.into_iter().zip(&self.planes) {
            let mut ids = ids.clone();
            ids.sort_unstable();
            if !ids.into_iter().eq(living_in(arena, units, plane)) {
                return Err(plane);
            }
        }
        Ok(())
    }
}

fn living_in(arena: &Arena, units: &Units, plane: Plane) -> impl Iterator<Item = u32> {
    let belongs = move |&id: &u32| units.alive[id as usize] && arena.kind(id).plane == plane;
    arena.unit_ids().filter(belongs)
}
