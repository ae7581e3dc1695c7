//! Phase 5, deaths: units without health leave the battle for the rest of the episode.

use super::World;

#[inline(never)]
pub(super) fn remove_dead(world: &mut World) {
    let World { arena, units, alive_ids, neighbour_order, .. } = world;
    // Deaths wait for the end of the tick, so a unit that was killed in phase 4 and healed in the same tick
    // is still here (R2).
    let any_died = alive_ids.all.iter().any(|&id| !units.has_health(id));
    if any_died {
        for &id in &alive_ids.all {
            // Only `alive` changes. A dead unit keeps its last position, velocity, shield and so on. Its
            // velocity has no effect any more, because collision avoidance considers only units in the
            // neighbour order, which it leaves below. Its position remains the destination of units commanded
            // to target it.
            units.alive[id as usize] = units.has_health(id);
        }
        alive_ids.refresh(arena, units);
        neighbour_order.remove_dead(units);
    }
}
