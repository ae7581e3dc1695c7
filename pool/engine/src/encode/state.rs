//! The state: features of all units, for centralised training.

use super::unit_tables::write_body;
use super::{UnitTables, View, ratio};
use crate::arena::Arena;

/// Writes the state; `last_actions` is indexed by agent.
#[inline(never)]
pub(crate) fn write_state(view: &View, last_actions: &[Option<u32>], out: &mut [f32]) {
    let (arena, sizes) = (view.arena, view.arena.sizes());
    assert_eq!(out.len(), sizes.state_size, "one state");
    // The dead have zeros only, and one-hots mostly. In parts, because the C library clears large slices
    // with an instruction that takes long to start.
    out.chunks_mut(256).for_each(|part| part.fill(0.0));
    // A body is written so that what follows its health is in place; then what precedes that, health
    // included. The zeros at its end may reach into the next block, which is written later.
    let (features, UnitTables { allies, enemies }) = (&arena.features, view.tables);
    let (ally, enemy) = (3 + features.ally_body(), 2 + features.enemy_body());
    let mut begin = 0;
    for (&id, (position, body)) in arena.agents.iter().zip(allies.units()) {
        if view.units.alive[id as usize] {
            let block = &mut out[begin..];
            write_body(body, &mut block[3..]);
            let [x, y] = features.relative(position);
            block[..4].copy_from_slice(&[body[0], energy_or_cooldown(view, id), x, y]);
        }
        begin += ally;
    }
    for (&id, (position, body)) in arena.enemies.iter().zip(enemies.units()) {
        if view.units.alive[id as usize] {
            let block = &mut out[begin..];
            write_body(body, &mut block[2..]);
            let [x, y] = features.relative(position);
            block[..3].copy_from_slice(&[body[0], x, y]);
        }
        begin += enemy;
    }
    let one_hots = &mut out[begin..];
    for (agent, action) in last_actions.iter().enumerate() {
        if let Some(action) = action {
            one_hots[agent * sizes.n_actions + *action as usize] = 1.0;
        }
    }
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
    /// Energy of a healer or cooldown of another unit, divided by its maximum; 0 for units of the other side.
    pub energy_or_cooldown: f32,
    /// Offset from the centre of the map to the east, divided by the width of the map.
    pub x: f32,
    /// Offset from the centre of the map to the north, divided by the height of the map.
    pub y: f32,
    /// Shield divided by its maximum; 0 if the scenario hides shields.
    pub shield: f32,
}

impl UnitFeatures {
    /// The features of a unit as its opponents see it, or as its own side does: those that [`write_state`]
    /// writes of an enemy, or of an agent.
    pub(crate) fn of(view: &View, id: u32, is_own: bool) -> UnitFeatures {
        let (stats, units, i) = (view.arena.stats(id), view.units, id as usize);
        if !units.alive[i] {
            return UnitFeatures::default();
        }
        let has_shield = view.arena.features.has_shield(view.arena.is_enemy(id));
        let [x, y] = view.arena.features.relative(units.pos[i]);
        UnitFeatures {
            health: ratio(units.hp[i], stats.hp),
            energy_or_cooldown: if is_own { energy_or_cooldown(view, id) } else { 0.0 },
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
