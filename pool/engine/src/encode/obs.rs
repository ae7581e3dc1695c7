//! Observations: what each agent sees within its sight range.

use glam::Vec2;

use super::{View, write_body};
use crate::arena::Sizes;
use crate::command::action;
use crate::units::distance_squared;
use crate::{SIGHT_RANGE, TARGETING_RANGE};

/// Working memory: the features of every unit, computed once per step rather than once per observer.
#[derive(Debug, Default)]
pub(crate) struct ObsScratch {
    allies: FactionScratch,
    enemies: FactionScratch,
}

/// The units of one faction, by in-faction id.
#[derive(Debug, Default)]
struct FactionScratch {
    /// Positions. Dead units are at infinity, out of sight of every unit.
    positions: Vec<Vec2>,
    /// Health, \[shield\], \[type\] of one unit after the other.
    bodies: Vec<f32>,
    body_size: usize,
}

impl FactionScratch {
    fn gather(&mut self, view: &View, ids: &[u32], body_size: usize) {
        self.body_size = body_size;
        self.bodies.resize(ids.len() * body_size, 0.0);
        self.positions.clear();
        for (&id, body) in ids.iter().zip(self.bodies.chunks_exact_mut(body_size)) {
            write_body(view, id, body);
            let alive = view.units.alive[id as usize];
            self.positions.push(if alive { view.units.pos[id as usize] } else { Vec2::INFINITY });
        }
    }

    fn body(&self, unit: usize) -> &[f32] {
        &self.bodies[unit * self.body_size..(unit + 1) * self.body_size]
    }

    /// Number of floats for one unit in the row of another.
    fn block_size(&self) -> usize {
        4 + self.body_size
    }
}

/// Writes the rows of all agents. Rows may be longer than `obs_size`; the rest of them becomes 0.
#[inline(never)]
pub(crate) fn write_obs(view: &View, out: &mut [f32], scratch: &mut ObsScratch) {
    let (arena, features) = (view.arena, &view.arena.features);
    let sizes = arena.sizes();
    let row_len = out.len() / sizes.n_agents;
    assert!(row_len >= sizes.obs_size && out.len() == sizes.n_agents * row_len, "one row per agent");
    scratch.allies.gather(view, &arena.agents, features.ally_body());
    scratch.enemies.gather(view, &arena.enemies, features.enemy_body());
    for (agent, row) in out.chunks_exact_mut(row_len).enumerate() {
        // What is not written below stays 0: rows of dead agents, blocks of units out of sight, and what
        // follows the features.
        row.fill(0.0);
        if view.units.alive[arena.agents[agent] as usize] {
            write_moves(view, agent, row);
            write_enemies(view, scratch, agent, row);
            let own = sizes.obs_size - scratch.allies.body_size;
            row[own..sizes.obs_size].copy_from_slice(scratch.allies.body(agent));
        }
    }
    write_allies(&sizes, scratch, row_len, out);
}

fn write_moves(view: &View, agent: usize, row: &mut [f32]) {
    for (i, out) in row[..4].iter_mut().enumerate() {
        *out = bit(view.available.has(agent, action::NORTH + i));
    }
}

/// Writes the enemies that an agent sees.
///
/// The first entry of a block says whether target action i is available. A healer's target actions mean
/// allies, so beside enemy i it says whether ally i is within targeting range. It does so for healers too,
/// which the available actions exclude.
fn write_enemies(view: &View, scratch: &ObsScratch, agent: usize, row: &mut [f32]) {
    let ObsScratch { allies, enemies } = scratch;
    let own = allies.positions[agent];
    let is_healer = view.arena.stats(view.arena.agents[agent]).is_healer;
    let blocks = row[4..].chunks_exact_mut(enemies.block_size());
    for (enemy, (&position, block)) in enemies.positions.iter().zip(blocks).enumerate() {
        if let Some(relative) = RelativePosition::of(own, position) {
            let targetable = if is_healer {
                allies
                    .positions
                    .get(enemy)
                    .is_some_and(|&ally| enemy != agent && in_targeting_range(own, ally))
            } else {
                view.available.has(agent, action::FIRST_TARGET + enemy)
            };
            relative.write(bit(targetable), enemies.body(enemy), block);
        }
    }
}

/// Writes the allies that agents see. Sight is mutual, so each pair is computed once.
fn write_allies(sizes: &Sizes, scratch: &ObsScratch, row_len: usize, out: &mut [f32]) {
    let allies = &scratch.allies;
    let size = allies.block_size();
    let first_block = 4 + sizes.n_enemies * scratch.enemies.block_size();
    // An agent has no block in its own row.
    let mut write = |agent: usize, other: usize, relative: &RelativePosition| {
        let block = if other < agent { other } else { other - 1 };
        let begin = agent * row_len + first_block + block * size;
        relative.write(1.0, allies.body(other), &mut out[begin..begin + size]);
    };
    for (agent, &from) in allies.positions.iter().enumerate() {
        for (other, &to) in allies.positions.iter().enumerate().skip(agent + 1) {
            if let Some(relative) = RelativePosition::of(from, to) {
                write(agent, other, &relative);
                write(other, agent, &relative.reversed());
            }
        }
    }
}

/// The offset from one unit to another that it sees, in shares of the sight range.
struct RelativePosition {
    distance: f32,
    dx: f32,
    dy: f32,
}

impl RelativePosition {
    /// `None` if the other is out of sight, or either is at infinity.
    ///
    /// The distance is computed in f64 and rounded once; dx and dy are f32 throughout, as in the published
    /// environment.
    fn of(from: Vec2, to: Vec2) -> Option<RelativePosition> {
        let squared = distance_squared(from, to);
        // A unit is seen if the root is less than the sight range. Where the square is not less the root is
        // not either, so most pairs need no root.
        if squared < SIGHT_RANGE * SIGHT_RANGE {
            let distance = squared.sqrt();
            let offset = to - from;
            return (distance < SIGHT_RANGE).then(|| RelativePosition {
                distance: (distance / SIGHT_RANGE) as f32,
                dx: offset.x / SIGHT_RANGE as f32,
                dy: offset.y / SIGHT_RANGE as f32,
            });
        }
        None
    }

    /// The offset in the other direction. Subtracting from 0 keeps 0.0 where negation would give -0.0.
    fn reversed(&self) -> RelativePosition {
        RelativePosition { distance: self.distance, dx: 0.0 - self.dx, dy: 0.0 - self.dy }
    }

    fn write(&self, first: f32, body: &[f32], block: &mut [f32]) {
        let (start, rest) = block.split_at_mut(4);
        start.copy_from_slice(&[first, self.distance, self.dx, self.dy]);
        rest.copy_from_slice(body);
    }
}

fn in_targeting_range(from: Vec2, to: Vec2) -> bool {
    distance_squared(from, to).sqrt() <= TARGETING_RANGE
}

fn bit(is_set: bool) -> f32 {
    if is_set { 1.0 } else { 0.0 }
}
