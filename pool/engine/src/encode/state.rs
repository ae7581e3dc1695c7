//! The state: features of all units, for centralised training.

use super::{View, ratio, write_body};

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
    let (stats, features) = (arena.stats(id), &arena.features);
    let n_before = if arena.is_enemy(id) { 2 } else { 3 };
    // The block is health, [cooldown or energy], x, y, [shield], [type], and the body is health, [shield],
    // [type]. The body is written to the end of the block; then its health moves to the front, and y takes
    // the entry that becomes free.
    let (before, body) = block.split_at_mut(n_before);
    write_body(view, id, body);
    let health = body[0];
    // Positions are relative to the centre of the map, in shares of its sides: -0.5 to 0.5.
    let position = units.pos[i].as_dvec2();
    let x = ((position.x - features.width / 2.0) / features.width) as f32;
    let y = ((position.y - features.height / 2.0) / features.height) as f32;
    before[0] = health;
    // As in SMAC, the entry of the cooldown is the energy for healers, and enemies have neither.
    if n_before == 3 {
        let (value, max) = if stats.is_healer {
            (units.energy[i], stats.energy)
        } else {
            (units.cooldown[i], stats.cooldown)
        };
        before[1] = ratio(value, max);
    }
    before[n_before - 1] = x;
    body[0] = y;
}
