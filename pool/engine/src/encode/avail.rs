//! The available actions of each agent, as bits; computed once after each step, reset or restore.

use glam::Vec2;

use super::gathered::{Gathered, TARGETING_SQUARED, at_most, distances_squared};
use crate::arena::{Arena, Sizes};
use crate::command::{DIRECTIONS, action};
use crate::fast_math::floor;
use crate::simd::{MASK_BITS, Vec2x4, WIDTH, mask};
use crate::units::Units;

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
        for (agent, row) in self.bits.chunks_exact(self.words).enumerate() {
            let mut begin = agent * self.n_actions;
            let end = begin + self.n_actions;
            for word in row {
                let mut bits = *word;
                // Eight at a time. The last eight of a row may end in the next one, which is written later.
                for _ in 0..(end - begin).min(64).div_ceil(8) {
                    let bytes = spread(bits as u8);
                    match out.get_mut(begin..begin + 8) {
                        Some(eight) => eight.copy_from_slice(&bytes),
                        None => out[begin..].iter_mut().zip(bytes).for_each(|(out, byte)| *out = byte),
                    }
                    bits >>= 8;
                    begin += 8;
                }
            }
        }
    }

    /// Computes all rows.
    #[inline(never)]
    pub fn update(&mut self, arena: &Arena, units: &Units, gathered: &Gathered) {
        for (row, &id) in self.bits.chunks_exact_mut(self.words).zip(&arena.agents) {
            row.fill(0);
            // No-op is the only action of the dead, and not available to the living.
            if !units.alive[id as usize] {
                row[0] = 1 << action::NO_OP;
                continue;
            }
            let position = units.pos[id as usize];
            row[0] = 1 << action::STOP | moves(arena, position) << action::NORTH;
            let is_healer = arena.stats(id).is_healer;
            let targets = if is_healer { &gathered.allies } else { &gathered.enemies };
            // Planes do not matter here: a target that the unit cannot attack is available, too.
            let is_in_range = |four: &Vec2x4| at_most(distances_squared(position, four), TARGETING_SQUARED);
            for (i, fours) in targets.positions.chunks(MASK_BITS / WIDTH).take(self.words).enumerate() {
                let mut in_range = mask(fours, is_in_range);
                if is_healer {
                    // Healers heal neither themselves nor other healers.
                    for (bit, &target) in arena.agents[i * MASK_BITS..].iter().take(MASK_BITS).enumerate() {
                        in_range &= !(u64::from(arena.stats(target).is_healer) << bit);
                    }
                }
                row[i] |= in_range << action::FIRST_TARGET;
                if let Some(next) = row.get_mut(i + 1) {
                    *next = in_range >> (MASK_BITS - action::FIRST_TARGET);
                }
            }
        }
    }
}

/// Eight bits as bytes, lowest bit first.
fn spread(bits: u8) -> [u8; 8] {
    // The product has the bits in each of its bytes, of which each keeps another one. Adding 127 carries that
    // into the highest bit of the byte.
    let one_each = u64::from(bits) * 0x0101_0101_0101_0101 & 0x8040_2010_0804_0201;
    ((one_each + 0x7f7f_7f7f_7f7f_7f7f) >> 7 & 0x0101_0101_0101_0101).to_le_bytes()
}

/// Whether each of the moves is available, as bits.
fn moves(arena: &Arena, position: Vec2) -> u64 {
    let bit = |(i, &direction)| u64::from(can_move(arena, position, direction)) << i;
    DIRECTIONS.iter().enumerate().map(bit).sum()
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
