//! Phase 5, deaths: units without health leave the battle for the rest of the episode.

use super::World;
use crate::units::Units;

/// Deaths wait for the end of the tick, so a unit that was killed in phase 4 and healed in the same tick is
/// still here (R2).
#[inline(never)]
pub(super) fn remove_dead(world: &mut World) {
    let World { units, alive_ids, neighbour_order, scratch, .. } = world;
    if !std::mem::take(&mut scratch.may_have_dead) {
        return;
    }
    let Units { hp, alive, .. } = &mut **units;
    let mut any_died = false;
    for &id in &alive_ids.all {
        if hp[id as usize] <= 0.0 {
            // Only `alive` changes. A dead unit keeps its last position, velocity, shield and so on. Its
            // velocity has no effect any more, because collision avoidance considers only units in the
            // neighbour order, which it leaves below. Its position remains the destination of units commanded
            // to target it.
            alive[id as usize] = false;
            any_died = true;
        }
    }
    if any_died {
        alive_ids.remove_dead(alive);
        scratch.remove_dead(alive);
        neighbour_order.remove_dead(units);
    }
}
