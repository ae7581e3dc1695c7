//! Phase 5, deaths: units without health leave the battle for good.

use super::World;

#[inline(never)] // so that profiles show it
pub(super) fn take_out(world: &mut World) {
    let World { arena, units, living, neighbour_order, .. } = world;
    let mut anyone = false;
    for &id in &living.all {
        if !units.has_health(id) {
            units.alive[id as usize] = false;
            anyone = true;
        }
    }
    if anyone {
        living.gather(arena, units);
        neighbour_order.remove_dead(units);
    }
}
