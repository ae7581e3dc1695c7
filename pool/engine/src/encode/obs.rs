//! Observations: what each agent sees from where it stands.

use glam::Vec2;

use super::{View, write_body};
use crate::arena::Sizes;
use crate::command::action;
use crate::units::distance_squared;
use crate::{SIGHT_RANGE, TARGETING_RANGE};

/// Working memory: what is to be seen of every unit, so that it is worked out once and not once an observer.
#[derive(Debug, Default)]
pub(crate) struct Sights {
    allies: Side,
    enemies: Side,
}

/// The units of one side, by in-faction id.
#[derive(Debug, Default)]
struct Side {
    /// Positions; the dead are at infinity, out of sight of every unit.
    positions: Vec<Vec2>,
    /// Health, \[shield\], \[type\] of one unit after the other.
    bodies: Vec<f32>,
    body_size: usize,
}

impl Side {
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

    /// Floats that the block of one unit takes in the row of another.
    fn block_size(&self) -> usize {
        4 + self.body_size
    }
}

/// Writes the rows of all agents.
#[inline(never)] // so that profiles show it
pub(crate) fn write_obs(view: &View, out: &mut [f32], sights: &mut Sights) {
    let (arena, layout) = (view.arena, &view.arena.layout);
    let sizes = arena.sizes();
    assert_eq!(out.len(), sizes.n_agents * sizes.obs_size, "one row an agent");
    sights.allies.gather(view, &arena.agents, layout.ally_body());
    sights.enemies.gather(view, &arena.enemies, layout.enemy_body());
    for (agent, row) in out.chunks_exact_mut(sizes.obs_size).enumerate() {
        row.fill(0.0);
        if view.units.alive[arena.agents[agent] as usize] {
            write_moves(view, agent, row);
            write_enemies(view, sights, agent, row);
            let own = sizes.obs_size - sights.allies.body_size;
            row[own..].copy_from_slice(sights.allies.body(agent));
        }
    }
    write_allies(&sizes, sights, out);
}

fn write_moves(view: &View, agent: usize, row: &mut [f32]) {
    for (i, out) in row[..4].iter_mut().enumerate() {
        *out = bit(view.available.has(agent, action::NORTH + i));
    }
}

/// Writes what an agent sees of the enemies.
///
/// A healer targets allies, and the mark beside enemy i says whether ally i is near enough. It says so of
/// healers too, which the available actions leave out.
fn write_enemies(view: &View, sights: &Sights, agent: usize, row: &mut [f32]) {
    let Sights { allies, enemies } = sights;
    let own = allies.positions[agent];
    let is_healer = view.arena.stats(view.arena.agents[agent]).is_healer;
    let blocks = row[4..].chunks_exact_mut(enemies.block_size());
    for (enemy, (&position, block)) in enemies.positions.iter().zip(blocks).enumerate() {
        if let Some(sight) = Sight::of(own, position) {
            let targetable = if is_healer {
                allies
                    .positions
                    .get(enemy)
                    .is_some_and(|&ally| enemy != agent && in_targeting_range(own, ally))
            } else {
                view.available.has(agent, action::FIRST_TARGET + enemy)
            };
            sight.write(bit(targetable), enemies.body(enemy), block);
        }
    }
}

/// Writes what allies see of each other: who sees is seen, so each two are looked at once.
fn write_allies(sizes: &Sizes, sights: &Sights, out: &mut [f32]) {
    let allies = &sights.allies;
    let size = allies.block_size();
    let first_block = 4 + sizes.n_enemies * sights.enemies.block_size();
    // An agent has no block in its own row.
    let mut write = |agent: usize, other: usize, sight: &Sight| {
        let block = if other < agent { other } else { other - 1 };
        let begin = agent * sizes.obs_size + first_block + block * size;
        sight.write(1.0, allies.body(other), &mut out[begin..begin + size]);
    };
    for (agent, &from) in allies.positions.iter().enumerate() {
        for (other, &to) in allies.positions.iter().enumerate().skip(agent + 1) {
            if let Some(sight) = Sight::of(from, to) {
                write(agent, other, &sight);
                write(other, agent, &sight.reversed());
            }
        }
    }
}

/// Where one unit sees another, in shares of the sight range.
struct Sight {
    distance: f32,
    dx: f32,
    dy: f32,
}

impl Sight {
    /// `None` if the other is out of sight, or either is at infinity.
    ///
    /// The distance is computed in f64 and rounded once, dx and dy are f32 throughout: so they are recorded.
    fn of(from: Vec2, to: Vec2) -> Option<Sight> {
        let squared = distance_squared(from, to);
        // The root of a greater number is not less than the sight range.
        if squared < SIGHT_RANGE * SIGHT_RANGE {
            let distance = squared.sqrt();
            let offset = to - from;
            return (distance < SIGHT_RANGE).then(|| Sight {
                distance: (distance / SIGHT_RANGE) as f32,
                dx: offset.x / SIGHT_RANGE as f32,
                dy: offset.y / SIGHT_RANGE as f32,
            });
        }
        None
    }

    /// Seen from the other side; taken from zero so that zero stays zero.
    fn reversed(&self) -> Sight {
        Sight { distance: self.distance, dx: 0.0 - self.dx, dy: 0.0 - self.dy }
    }

    fn write(&self, mark: f32, body: &[f32], block: &mut [f32]) {
        let (place, rest) = block.split_at_mut(4);
        place.copy_from_slice(&[mark, self.distance, self.dx, self.dy]);
        rest.copy_from_slice(body);
    }
}

fn in_targeting_range(from: Vec2, to: Vec2) -> bool {
    distance_squared(from, to).sqrt() <= TARGETING_RANGE
}

fn bit(is_set: bool) -> f32 {
    if is_set { 1.0 } else { 0.0 }
}
