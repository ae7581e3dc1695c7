//! How far units reach.

use crate::arena::Arena;
use crate::distance::distance;
use crate::units::Units;

/// Whether a unit that has attacked a target can do it again.
pub(super) fn is_in_slop(arena: &Arena, units: &Units, id: u32, target: u32) -> bool {
    is_within(arena, units, id, target, arena.stats(id).conduct.range_slop)
}

/// Whether the gap between two units is at most the attack range of the first, and some slop.
pub(super) fn is_within(arena: &Arena, units: &Units, id: u32, target: u32, slop: f64) -> bool {
    let (own, other) = (arena.stats(id), arena.stats(target));
    let gap = distance(units.pos[id as usize], units.pos[target as usize]);
    gap <= own.attack_range + own.radius + other.radius + slop
}
