//! Observations: what each agent sees from where it stands.

use super::{View, write_body};
use crate::SIGHT_RANGE;
use crate::command::action;
use crate::units::distance;

/// Working memory: the figures of every unit's body, so that they are worked out once and not once an observer.
#[derive(Debug, Default)]
pub(crate) struct Bodies {
    allies: Vec<f32>,
    enemies: Vec<f32>,
}

/// Writes the rows of all agents.
pub(crate) fn write_obs(view: &View, out: &mut [f32], bodies: &mut Bodies) {
    let sizes = view.arena.sizes();
    assert_eq!(out.len(), sizes.n_agents * sizes.obs_size, "one row an agent");
    bodies.gather(view);
    for (agent, row) in out.chunks_exact_mut(sizes.obs_size).enumerate() {
        row.fill(0.0);
        if view.units.alive[view.arena.agents[agent] as usize] {
            write_row(view, bodies, agent, row);
        }
    }
}

impl Bodies {
    fn gather(&mut self, view: &View) {
        let Bodies { allies, enemies } = self;
        let layout = &view.arena.layout;
        let sides = [
            (&view.arena.agents, layout.ally_body(), allies),
            (&view.arena.enemies, layout.enemy_body(), enemies),
        ];
        for (ids, size, out) in sides {
            out.resize(ids.len() * size, 0.0);
            for (&id, out) in ids.iter().zip(out.chunks_exact_mut(size)) {
                write_body(view, id, out);
            }
        }
    }
}

fn write_row(view: &View, bodies: &Bodies, agent: usize, row: &mut [f32]) {
    let (arena, layout) = (view.arena, &view.arena.layout);
    let (ally_body, enemy_body) = (layout.ally_body(), layout.enemy_body());
    let (moves, row) = row.split_at_mut(4);
    for (i, out) in moves.iter_mut().enumerate() {
        *out = bit(view.available.has(agent, action::NORTH + i));
    }
    let (enemies, row) = row.split_at_mut(arena.enemies.len() * (4 + enemy_body));
    let (allies, own) = row.split_at_mut(row.len() - ally_body);

    let bodies_of_enemies = bodies.enemies.chunks_exact(enemy_body);
    let blocks = enemies.chunks_exact_mut(4 + enemy_body);
    for (other, (block, body)) in blocks.zip(bodies_of_enemies).enumerate() {
        // A healer's target actions are allies; SMAC puts them next to the enemies all the same.
        let targetable = bit(view.available.has(agent, action::FIRST_TARGET + other));
        write_seen(view, arena.agents[agent], arena.enemies[other], targetable, body, block);
    }
    let others = bodies.allies.chunks_exact(ally_body).enumerate().filter(|&(other, _)| other != agent);
    for (block, (other, body)) in allies.chunks_exact_mut(4 + ally_body).zip(others) {
        write_seen(view, arena.agents[agent], arena.agents[other], 1.0, body, block);
    }
    own.copy_from_slice(&bodies.allies[agent * ally_body..(agent + 1) * ally_body]);
}

/// Writes the block of one other unit if it is alive and in sight.
fn write_seen(view: &View, observer: u32, other: u32, mark: f32, body: &[f32], block: &mut [f32]) {
    let (from, to) = (view.units.pos[observer as usize], view.units.pos[other as usize]);
    if !view.units.alive[other as usize] {
        return;
    }
    let distance = distance(from, to);
    if distance < SIGHT_RANGE {
        let (place, rest) = block.split_at_mut(4);
        let share = |d: f64| (d / SIGHT_RANGE) as f32;
        let way = to.as_dvec2() - from.as_dvec2();
        place.copy_from_slice(&[mark, share(distance), share(way.x), share(way.y)]);
        rest.copy_from_slice(body);
    }
}

fn bit(is_set: bool) -> f32 {
    if is_set { 1.0 } else { 0.0 }
}
