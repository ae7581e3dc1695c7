//! The columns of a battle: what changes about each unit, one vector a quantity, indexed by battle-wide id.
//!
//! What never changes about a unit (its kind, its side) is in the arena.

use glam::Vec2;

use crate::arena::Arena;

/// The changing part of every unit of a battle, indexed by battle-wide id; all columns have equal lengths.
///
/// A dead unit keeps its last values.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Units {
    /// Position in terrain squares; x grows east, y north.
    pub pos: Vec<Vec2>,
    /// Velocity with which the unit last moved, in squares per second.
    pub vel: Vec<Vec2>,
    /// Velocity planned for the last tick, which other units assume that it has. It is `vel` but for a unit
    /// that was killed before it could move, and healed to life in the same tick (R2).
    pub planned_vel: Vec<Vec2>,
    /// Health, from 0 to the type's maximum.
    pub hp: Vec<f64>,
    /// Shield, from 0 to the type's maximum.
    pub shield: Vec<f64>,
    /// Energy, from 0 to the type's maximum.
    pub energy: Vec<f64>,
    /// Seconds until the unit can act again.
    pub cooldown: Vec<f64>,
    /// Seconds until the shield regenerates.
    pub shield_cooldown: Vec<f64>,
    /// Healing that was paid for with energy and not yet given, in health.
    pub healing: Vec<f64>,
    /// Whether the unit is in the battle. A unit that left it stays out, whatever becomes of its health (R2).
    pub alive: Vec<bool>,
    /// The unit's target.
    pub target: Vec<Option<u32>>,
    /// Whether the unit holds an attack that it declared and has not executed. Between ticks only a unit does
    /// that was killed before its turn and healed to life in the same tick (R4).
    pub declared: Vec<bool>,
}

impl Units {
    /// Puts every unit where and as it starts an episode.
    pub(crate) fn reset(&mut self, arena: &Arena) {
        let all_stats = || arena.unit_ids().map(|id| arena.stats(id));
        refill(&mut self.pos, arena.starts.iter().copied());
        refill(&mut self.vel, all_stats().map(|_| Vec2::ZERO));
        refill(&mut self.planned_vel, all_stats().map(|_| Vec2::ZERO));
        refill(&mut self.hp, all_stats().map(|stats| stats.hp));
        refill(&mut self.shield, all_stats().map(|stats| stats.shield));
        refill(&mut self.energy, all_stats().map(|stats| stats.initial_energy));
        for column in [&mut self.cooldown, &mut self.shield_cooldown, &mut self.healing] {
            refill(column, all_stats().map(|_| 0.0));
        }
        refill(&mut self.alive, all_stats().map(|_| true));
        refill(&mut self.target, all_stats().map(|_| None));
        refill(&mut self.declared, all_stats().map(|_| false));
    }

    /// Whether the unit still has health. In the middle of a tick that is not the same as `alive`.
    pub(crate) fn has_health(&self, id: u32) -> bool {
        self.hp[id as usize] > 0.0
    }
}

/// The distance between two points in f64, as searches and comparisons use it.
pub(crate) fn distance(a: Vec2, b: Vec2) -> f64 {
    distance_squared(a, b).sqrt()
}

/// The square of [`distance`].
pub(crate) fn distance_squared(a: Vec2, b: Vec2) -> f64 {
    let (dx, dy) = (f64::from(a.x) - f64::from(b.x), f64::from(a.y) - f64::from(b.y));
    dx * dx + dy * dy
}

/// The greatest number whose root is at most `distance`: a square can be compared with it in place of its
/// root with the distance, to the same end.
pub(crate) fn square_within(distance: f64) -> f64 {
    if distance.is_nan() || distance < 0.0 || distance == f64::INFINITY {
        return distance;
    }
    let mut square = distance * distance;
    while square.sqrt() > distance {
        square = square.next_down();
    }
    while square.next_up().sqrt() <= distance {
        square = square.next_up();
    }
    square
}

// As `f64::min` and `f64::max` for numbers, without their care for what is none.

/// The lesser of two numbers.
pub(crate) fn least(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The greater of two numbers.
pub(crate) fn most(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// The square that a coordinate lies in; the nearest number there is for what no square has.
///
/// `f64::floor` is a call into the C library on the plainest x86-64, and this is asked for every unit and
/// tick.
pub(crate) fn floor(x: f64) -> i64 {
    let whole = x as i64;
    if whole as f64 > x { whole.saturating_sub(1) } else { whole }
}

/// The ids of the units that are in the battle, ascending.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct AliveIds {
    pub all: Vec<u32>,
    pub allies: Vec<u32>,
    pub enemies: Vec<u32>,
}

impl AliveIds {
    /// Gathers the ids of those that `units` says are alive.
    pub fn gather(&mut self, arena: &Arena, units: &Units) {
        let alive = |id: &u32| units.alive[*id as usize];
        refill(&mut self.all, arena.unit_ids().filter(alive));
        refill(&mut self.allies, arena.agents.iter().copied().filter(alive));
        refill(&mut self.enemies, arena.enemies.iter().copied().filter(alive));
    }

    /// The living units of the side that `id` is on.
    pub fn side_of(&self, arena: &Arena, id: u32) -> &[u32] {
        if arena.is_enemy(id) { &self.enemies } else { &self.allies }
    }

    /// The living units of the side that `id` is not on.
    pub fn opponents(&self, arena: &Arena, id: u32) -> &[u32] {
        if arena.is_enemy(id) { &self.allies } else { &self.enemies }
    }
}

/// Empties a vector that is to hold up to `n` things.
pub(crate) fn make_room<T>(column: &mut Vec<T>, n: usize) {
    column.clear();
    column.reserve(n);
}

/// Replaces the contents of a vector, keeping its memory.
pub(crate) fn refill<T>(column: &mut Vec<T>, values: impl Iterator<Item = T>) {
    column.clear();
    column.extend(values);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_stand_for_distances() {
        for distance in [0.0, 1e-160, 0.1, 5.0f64.sqrt(), 6.0, 9.0, 6.75 + 0.375, 1e200] {
            let square = square_within(distance);
            assert!(square.sqrt() <= distance && square.next_up().sqrt() > distance, "{distance}: {square}");
        }
        assert_eq!([square_within(-1.0), square_within(f64::INFINITY)], [-1.0, f64::INFINITY]);
    }
}
