//! The state: features of all units, for centralised training.

use super::unit_tables::write_body;
use super::{View, ratio};
use std::ops::Range;

use crate::arena::{Arena, Features};
use crate::buffers::refill;
use smaclite_scenarios::Faction;

/// Writes the state of a side; `last_actions` are those of its units.
#[inline(never)]
pub(crate) fn write_state(view: &View, last_actions: &[Option<u32>], out: &mut [f32]) {
    let (arena, sizes) = (view.arena, view.arena.sizes_of(view.faction));
    assert_eq!(out.len(), sizes.state_size, "one state");
    // The dead have zeros only, and one-hots mostly. In parts, because the C library clears large slices
    // with an instruction that takes long to start.
    out.chunks_mut(256).for_each(|part| part.fill(0.0));
    // A body is written so that what follows its health is in place; then what precedes that, health
    // included. The zeros at its end may reach into the next block, which is written later.
    let (allies, enemies) = (view.own(), view.others());
    let (ally, enemy) = (3 + allies.body_size, 2 + enemies.body_size);
    let relative = |position| arena.features.relative(position).map(|x| view.sign() * x);
    let mut begin = 0;
    for (&id, (position, body)) in arena.ids(view.faction).iter().zip(allies.units()) {
        if view.units.alive[id as usize] {
            let block = &mut out[begin..];
            write_body(body, &mut block[3..]);
            let [x, y] = relative(position);
            block[..4].copy_from_slice(&[body[0], energy_or_cooldown(view, id), x, y]);
        }
        begin += ally;
    }
    for (&id, (position, body)) in arena.ids(view.faction.opponent()).iter().zip(enemies.units()) {
        if view.units.alive[id as usize] {
            let block = &mut out[begin..];
            write_body(body, &mut block[2..]);
            let [x, y] = relative(position);
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

/// Where a state of a side has a unit.
fn row_in_state(arena: &Arena, side: Faction, id: u32) -> Range<usize> {
    let [own, other] = arena.state_rows(side);
    let i = arena.id_in_faction(id);
    let (start, len) = match arena.faction(id) == side {
        true => (i * own, own),
        false => (arena.ids(side).len() * own + i * other, other),
    };
    start..start + len
}

/// The types of all units in a state of a side, by battle-wide id, as far as observations tell types apart.
/// A dead unit, which has no type in the state, keeps the one that it has in the arena.
pub(crate) fn types_in_state(arena: &Arena, side: Faction, state: &[f32], types: &mut Vec<u32>) {
    refill(types, arena.type_indices());
    let Features { n_types, ref of_type, .. } = arena.features;
    if !arena.states_have_units(side) {
        return;
    }
    for (id, own) in (0..).zip(types) {
        let row = &state[row_in_state(arena, side, id)];
        // The one-hot of types is at the end of a row.
        let place = row[row.len() - n_types..].iter().position(|&bit| bit == 1.0);
        let found = place.and_then(|place| of_type.iter().position(|other| *other == place));
        *own = found.map_or(*own, |unit_type| unit_type as u32);
    }
}

/// As in SMAC, the entry of the cooldown is the energy for healers.
fn energy_or_cooldown(view: &View, id: u32) -> f32 {
    let (stats, units, i) = (view.arena.stats(id), view.units, id as usize);
    if stats.is_healer {
        ratio(units.energy[i], stats.energy)
    } else {
        ratio(units.cooldown[i], stats.greatest_cooldown)
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
        let has_shield = view.arena.features.has_shield(view.arena.faction(id));
        let [x, y] = view.arena.features.relative(units.pos[i]);
        UnitFeatures {
            health: ratio(units.hp[i], stats.hp),
            energy_or_cooldown: if is_own { energy_or_cooldown(view, id) } else { 0.0 },
            x,
            y,
            shield: if has_shield { ratio(units.shield[i], stats.shield) } else { 0.0 },
        }
    }

    /// The features of a unit in a state of a side, f32 `[state_size]`.
    pub(crate) fn read(arena: &Arena, side: Faction, id: u32, state: &[f32]) -> UnitFeatures {
        if !arena.states_have_units(side) {
            return UnitFeatures::default();
        }
        let (features, is_own) = (&arena.features, arena.faction(id) == side);
        // Health, [cooldown or energy], x, y, [shield].
        let row = &state[row_in_state(arena, side, id)];
        let (health, rest) = (row[0], &row[1..]);
        let (energy_or_cooldown, rest) = if is_own { (rest[0], &rest[1..]) } else { (0.0, rest) };
        let shield = if features.has_shield(arena.faction(id)) { rest[2] } else { 0.0 };
        UnitFeatures { health, energy_or_cooldown, x: rest[0], y: rest[1], shield }
    }
}
