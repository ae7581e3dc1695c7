//! The available actions of each agent, as bits; computed once after each step, reset or restore.

use glam::Vec2;

use crate::TARGETING_RANGE;
use crate::arena::{Arena, Sizes};
use crate::command::{DIRECTIONS, action};
use crate::fast_math::floor;
use crate::units::{AliveIds, Units, distance_squared};

/// One row of bits per agent: bit `a % 64` of word `a / 64` says whether action `a` is available.
#[derive(Clone, Debug)]
pub(crate) struct Available {
    bits: Vec<u64>,
    words: usize,
    n_actions: usize,
}

impl Available {
    /// Rows for all agents and actions, without a bit set.
    pub fn new(sizes: &Sizes) -> Available {
        let words = sizes.n_actions.div_ceil(64);
        Available { bits: vec![0; words * sizes.n_agents], words, n_actions: sizes.n_actions }
    }

    /// The row of an agent.
    pub fn of(&self, agent: usize) -> &[u64] {
        &self.bits[agent * self.words..(agent + 1) * self.words]
    }

    /// Whether an action is available to an agent.
    pub fn has(&self, agent: usize, action: usize) -> bool {
        action < self.n_actions && self.of(agent)[action / 64] >> (action % 64) & 1 == 1
    }

    /// Writes all rows as bytes of 0 or 1.
    #[inline(never)]
    pub fn write(&self, out: &mut [u8]) {
        assert_eq!(out.len() * self.words, self.bits.len() * self.n_actions, "one byte per agent and action");
        for (row, out) in self.bits.chunks_exact(self.words).zip(out.chunks_exact_mut(self.n_actions)) {
            for (word, out) in row.iter().zip(out.chunks_mut(64)) {
                for (bit, out) in out.iter_mut().enumerate() {
                    *out = (word >> bit & 1) as u8;
                }
            }
        }
    }

    /// Computes all rows.
    #[inline(never)]
    pub fn update(&mut self, arena: &Arena, units: &Units, alive_ids: &AliveIds) {
        for (row, &id) in self.bits.chunks_exact_mut(self.words).zip(&arena.agents) {
            row.fill(0);
            let mut allow = |action: usize| row[action / 64] |= 1 << (action % 64);
            // No-op is the only action of the dead, and not available to the living.
            if !units.alive[id as usize] {
                allow(action::NO_OP);
                continue;
            }
            allow(action::STOP);
            let position = units.pos[id as usize];
            for (direction, action) in DIRECTIONS.into_iter().zip(action::NORTH..) {
                if can_move(arena, position, direction) {
                    allow(action);
                }
            }
            let is_healer = arena.stats(id).is_healer;
            for &target in if is_healer { &alive_ids.allies } else { &alive_ids.enemies } {
                let squared = distance_squared(position, units.pos[target as usize]);
                // Healers heal neither themselves nor other healers.
                let is_targetable = !(is_healer && arena.stats(target).is_healer);
                // Planes do not matter here: a target that the unit cannot attack is available, too.
                if is_targetable && squared.sqrt() <= TARGETING_RANGE {
                    allow(action::FIRST_TARGET + arena.id_in_faction(target));
                }
            }
        }
    }
}

/// Whether a direction is available: whether the square one square away from the unit is on the map and
/// walkable.
///
/// Units and the far end of the move, which is two squares away, do not matter. Near a wall a move may thus
/// be available that collision avoidance then stops at the wall.
fn can_move(arena: &Arena, position: Vec2, [dx, dy]: [f64; 2]) -> bool {
    let (x, y) = (f64::from(position.x) + dx, f64::from(position.y) + dy);
    arena.terrain.is_walkable(floor(x), floor(y))
}
