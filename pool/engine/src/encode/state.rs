//! The state: features of all units, for centralised training.

use super::{View, ratio, write_body};
use crate::arena::Arena;

/// Writes the state; `last_actions` is indexed by agent.
#[inline(never)]
pub(crate) fn write_state(view: &View, last_actions: &[Option<u32>], out: &mut [f32]) {
    let (arena, sizes) = (view.arena, view.arena.sizes());
    assert_eq!(out.len(), sizes.state_size, "one state");
    out.fill(0.0);
    let (ally, enemy) = (3 + arena.features.ally_body(), 2 + arena.features.enemy_body());
    let (allies, rest) = out.split_at_mut(sizes.n_agents * ally);
    let (enemies, actions) = rest.split_at_mut(sizes.n_enemies * enemy);
    for (&id, block) in arena.agents.iter().zip(allies.chunks_exact_mut(ally)) {
        write_unit(view, id, block);
    }
    for (&id, block) in arena.enemies.iter().zip(enemies.chunks_exact_mut(enemy)) {
        write_unit(view, id, block);
    }
    for (action, one_hot) in last_actions.iter().zip(actions.chunks_exact_mut(sizes.n_actions)) {
        if let Some(action) = action {
            one_hot[*action as usize] = 1.0;
        }
    }
}

/// Writes a living unit's health, \[cooldown or energy of agents\], x, y, \[shield\], \[type\].
fn write_unit(view: &View, id: u32, block: &mut [f32]) {
    let (arena, units, i) = (view.arena, view.units, id as usize);
    if !units.alive[i] {
        return;
    }
    let features = &arena.features;
    let n_before = if arena.is_enemy(id) { 2 } else { 3 };
    // The block is health, [cooldown or energy], x, y, [shield], [type], and the body is health, [shield],
    // [type]. The body is written to the end of the block; then its health moves to the front, and y takes
    // the entry that becomes free.
    let (before, body) = block.split_at_mut(n_before);
    write_body(view, id, body);
    let health = body[0];
    before[0] = health;
    if n_before == 3 {
        before[1] = energy_or_cooldown(view, id);
    }
    let [x, y] = features.relative(units.pos[i]);
    before[n_before - 1] = x;
    body[0] = y;
}

/// As in SMAC, the entry of the cooldown is the energy for healers.
fn energy_or_cooldown(view: &View, id: u32) -> f32 {
    let (stats, units, i) = (view.arena.stats(id), view.units, id as usize);
    if stats.is_healer {
        ratio(units.energy[i], stats.energy)
    } else {
        ratio(units.cooldown[i], stats.cooldown)
    }
}

/// The features of a unit in the state, all zeros for the dead.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UnitFeatures {
    /// Health divided by its maximum.
    pub health: f32,
    /// Energy of a healer or cooldown of another unit, divided by its maximum; 0 for enemies.
    pub energy_or_cooldown: f32,
    /// Offset from the centre of the map to the east, divided by the width of the map.
    pub x: f32,
    /// Offset from the centre of the map to the north, divided by the height of the map.
    pub y: f32,
    /// Shield divided by its maximum; 0 if the scenario hides shields.
    pub shield: f32,
}

impl UnitFeatures {
    /// The features that [`write_state`] writes.
    pub(crate) fn of(view: &View, id: u32) -> UnitFeatures {
        let (stats, units, i) = (view.arena.stats(id), view.units, id as usize);
        if !units.alive[i] {
            return UnitFeatures::default();
        }
        let is_enemy = view.arena.is_enemy(id);
        let has_shield = view.arena.features.has_shield(is_enemy);
        let [x, y] = view.arena.features.relative(units.pos[i]);
        UnitFeatures {
            health: ratio(units.hp[i], stats.hp),
            energy_or_cooldown: if is_enemy { 0.0 } else { energy_or_cooldown(view, id) },
            x,
            y,
            shield: if has_shield { ratio(units.shield[i], stats.shield) } else { 0.0 },
        }
    }

    /// The features of a unit in a state, f32 `[state_size]`.
    pub(crate) fn read(arena: &Arena, id: u32, state: &[f32]) -> UnitFeatures {
        let (is_enemy, features, i) = (arena.is_enemy(id), &arena.features, arena.id_in_faction(id));
        let (ally, enemy) = (3 + features.ally_body(), 2 + features.enemy_body());
        let start = if is_enemy { arena.agents.len() * ally + i * enemy } else { i * ally };
        // Health, [cooldown or energy], x, y, [shield].
        let (health, rest) = (state[start], &state[start + 1..]);
        let (energy_or_cooldown, rest) = if is_enemy { (0.0, rest) } else { (rest[0], &rest[1..]) };
        let shield = if features.has_shield(is_enemy) { rest[2] } else { 0.0 };
        UnitFeatures { health, energy_or_cooldown, x: rest[0], y: rest[1], shield }
    }
}
