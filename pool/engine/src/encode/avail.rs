//! Which actions each agent can take, as bits; worked out once after each step, reset or restore.

use glam::Vec2;

use crate::TARGETING_RANGE;
use crate::arena::{Arena, Sizes};
use crate::command::{DIRECTIONS, action};
use crate::units::{AliveIds, Units, distance_squared, floor};

/// One row of bits an agent: bit `a % 64` of word `a / 64` says whether action `a` is available.
#[derive(Clone, Debug)]
pub(crate) struct Available {
    bits: Vec<u64>,
    words: usize,
    n_actions: usize,
}

impl Available {
    /// Rows for that many agents and actions, all empty.
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
    #[inline(never)] // so that profiles show it
    pub fn write(&self, out: &mut [u8]) {
        assert_eq!(out.len() * self.words, self.bits.len() * self.n_actions, "one byte an agent and action");
        for (row, out) in self.bits.chunks_exact(self.words).zip(out.chunks_exact_mut(self.n_actions)) {
            for (word, out) in row.iter().zip(out.chunks_mut(64)) {
                for (bit, out) in out.iter_mut().enumerate() {
                    *out = (word >> bit & 1) as u8;
                }
            }
        }
    }

    /// Works out all rows.
    #[inline(never)] // so that profiles show it
    pub fn update(&mut self, arena: &Arena, units: &Units, living: &AliveIds) {
        for (row, &id) in self.bits.chunks_exact_mut(self.words).zip(&arena.agents) {
            row.fill(0);
            let mut allow = |action: usize| row[action / 64] |= 1 << (action % 64);
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
            for &target in if is_healer { &living.allies } else { &living.enemies } {
                let squared = distance_squared(position, units.pos[target as usize]);
                // Healers heal neither themselves nor other healers.
                let fits = !(is_healer && arena.stats(target).is_healer);
                if fits && squared.sqrt() <= TARGETING_RANGE {
                    allow(action::FIRST_TARGET + arena.id_in_faction(target));
                }
            }
        }
    }
}

/// Whether the square one step away is on the map and walkable.
fn can_move(arena: &Arena, position: Vec2, [dx, dy]: [f64; 2]) -> bool {
    let (x, y) = (f64::from(position.x) + dx, f64::from(position.y) + dy);
    arena.terrain.is_walkable(floor(x), floor(y))
}
