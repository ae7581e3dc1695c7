//! The available actions of each agent, as bits; computed once after each step, reset or restore.

use super::unit_tables::{UNITS_PER_WORD, UnitTables, within_targeting_range};
use crate::arena::{Arena, Sizes};
use crate::command::action;
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

    /// All rows.
    pub fn all(&self) -> &[u64] {
        &self.bits
    }

    /// The row of an agent.
    pub fn of(&self, agent: usize) -> &[u64] {
        &self.bits[agent * self.words..(agent + 1) * self.words]
    }

    /// The first word of the row of an agent.
    pub fn first_bits(&self, agent: usize) -> u64 {
        self.bits[agent * self.words]
    }

    /// Whether an action is available to an agent.
    pub fn has(&self, agent: usize, action: usize) -> bool {
        action < self.n_actions && self.of(agent)[action / 64] >> (action % 64) & 1 == 1
    }

    /// Writes all rows as bytes of 0 or 1.
    #[inline(never)]
    pub fn write(&self, out: &mut [u8]) {
        assert_eq!(out.len() * self.words, self.bits.len() * self.n_actions, "one byte per agent and action");
        let mut rest = out;
        for row in self.bits.chunks_exact(self.words) {
            let mut n_left = self.n_actions;
            for &word in row {
                let mut bits = word;
                let n_here = n_left.min(64);
                for begin in (0..n_here).step_by(16) {
                    let bytes = spread(bits as u16);
                    // The last sixteen of a row may end in the next one, which is written later.
                    match rest.get_mut(begin..begin + 16) {
                        Some(out) => out.copy_from_slice(&bytes),
                        None => rest[begin..].iter_mut().zip(bytes).for_each(|(out, byte)| *out = byte),
                    }
                    bits >>= 16;
                }
                rest = &mut rest[n_here..];
                n_left -= n_here;
            }
        }
    }

    /// Computes all rows.
    #[inline(never)]
    pub fn update(&mut self, arena: &Arena, units: &Units, tables: &UnitTables) {
        for (row, &id) in self.bits.chunks_exact_mut(self.words).zip(&arena.agents) {
            // No-op is the only action of the dead, and not available to the living.
            if !units.alive[id as usize] {
                row.iter_mut().for_each(|word| *word = 0);
                row[0] = 1 << action::NO_OP;
                continue;
            }
            let position = units.pos[id as usize];
            let is_healer = arena.stats(id).is_healer;
            // Planes do not matter here: a target that the unit cannot attack is available, too.
            let targets = if is_healer { &tables.allies } else { &tables.enemies };
            // Bits of the next word, which precede those of the next targets.
            let mut first_bits = 1 << action::STOP | u64::from(arena.moves(position)) << action::NORTH;
            for (i, word) in row.iter_mut().enumerate() {
                let mut in_range = within_targeting_range(position, targets, i * UNITS_PER_WORD);
                if is_healer {
                    in_range &= !healers(arena, i * UNITS_PER_WORD);
                }
                *word = first_bits | in_range << action::FIRST_TARGET;
                first_bits = in_range >> (UNITS_PER_WORD - action::FIRST_TARGET);
            }
        }
    }
}

/// Sixteen bits as bytes of 0 or 1, lowest bit first.
fn spread(bits: u16) -> [u8; 16] {
    bytemuck::cast(bits.to_le_bytes().map(|eight| {
        // Each byte gets all eight bits and keeps one. Adding 0x7f moves it, whichever it is, to the highest
        // bit, and nothing into the next byte.
        let each = (u64::from(eight) * 0x0101_0101_0101_0101) & 0x8040_2010_0804_0201;
        ((each + 0x7f7f_7f7f_7f7f_7f7f) >> 7 & 0x0101_0101_0101_0101).to_le_bytes()
    }))
}

/// Which of [`UNITS_PER_WORD`] agents, from this one on, are healers. Healers heal neither themselves nor
/// other healers.
#[inline(never)]
fn healers(arena: &Arena, first: usize) -> u64 {
    let bit = |(bit, &id): (usize, &u32)| u64::from(arena.stats(id).is_healer) << bit;
    arena.agents.iter().skip(first).take(UNITS_PER_WORD).enumerate().map(bit).sum()
}
