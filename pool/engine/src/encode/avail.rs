//! The available actions of the units of a faction, as bits: those of units that joint actions play are
//! computed once after each step, reset or restore, those of others where their actions are chosen.

use super::unit_tables::{UNITS_PER_WORD, UnitTables, within_targeting_range};
use crate::arena::Arena;
use crate::command::{IllegalAction, action};
use crate::sides::Actor;
use crate::units::Units;
use smaclite_scenarios::Faction;

/// Moves to the north and to the east; the bits above them are their opposites.
const EVEN_MOVES: u64 = 1 << action::NORTH | 1 << action::EAST;

/// One row of bits per unit of the faction, by in-faction id: bit `a % 64` of word `a / 64` says whether
/// action `a` is available.
#[derive(Clone, Debug)]
pub(crate) struct Available {
    faction: Faction,
    bits: Vec<u64>,
    words: usize,
    n_actions: usize,
}

impl Available {
    /// Rows for all units and actions, without a bit set.
    pub fn new(arena: &Arena, faction: Faction) -> Available {
        let n_actions = arena.n_actions(faction);
        let words = n_actions.div_ceil(64);
        Available { faction, bits: vec![0; words * arena.ids(faction).len()], words, n_actions }
    }

    /// All rows.
    pub fn all(&self) -> &[u64] {
        &self.bits
    }

    /// The row of a unit.
    pub fn of(&self, unit: usize) -> &[u64] {
        &self.bits[unit * self.words..(unit + 1) * self.words]
    }

    /// The first word of the row of a unit.
    pub fn first_bits(&self, unit: usize) -> u64 {
        self.bits[unit * self.words]
    }

    /// Whether an action is available to a unit.
    pub fn has(&self, unit: usize, action: usize) -> bool {
        action < self.n_actions && self.of(unit)[action / 64] >> (action % 64) & 1 == 1
    }

    /// Checks the actions of the units; none is of more units than there are.
    pub fn check(&self, actions: &[i32], actor: fn(usize) -> Actor) -> Result<(), IllegalAction> {
        let n_actions = self.n_actions;
        for (unit, &action) in actions.iter().enumerate() {
            // One look at a bit for a legal action; only for an illegal one is the reason determined.
            match usize::try_from(action) {
                Ok(number) if self.has(unit, number) => {}
                Ok(number) if number < n_actions => {
                    let available = (0..n_actions).filter(|&action| self.has(unit, action)).collect();
                    return Err(IllegalAction::Unavailable { actor: actor(unit), action, available });
                }
                _ => return Err(IllegalAction::OutOfRange { actor: actor(unit), action, n_actions }),
            }
        }
        Ok(())
    }

    /// How many actions are available to a unit.
    pub fn count(&self, unit: usize) -> u32 {
        self.of(unit).iter().map(|bits| bits.count_ones()).sum()
    }

    /// The available action of a unit that has `n` others before it; 0 if there is none.
    pub fn nth(&self, unit: usize, mut n: u32) -> usize {
        for (i, &bits) in self.of(unit).iter().enumerate() {
            if n < bits.count_ones() {
                // Clears the lowest bit `n` times.
                let rest = (0..n).fold(bits, |bits, _| bits & (bits - 1));
                return i * 64 + rest.trailing_zeros() as usize;
            }
            n -= bits.count_ones();
        }
        0
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

    /// Takes all actions but no-op away: somebody else plays the units.
    pub fn withdraw(&mut self) {
        for row in self.bits.chunks_exact_mut(self.words) {
            row.fill(0);
            row[0] = 1 << action::NO_OP;
        }
    }

    /// Exchanges the moves of opposite directions.
    pub fn mirror(&mut self) {
        for row in self.bits.chunks_exact_mut(self.words) {
            // North and east are even, south and west odd.
            let (even, odd) = (row[0] & EVEN_MOVES, row[0] & EVEN_MOVES << 1);
            row[0] = row[0] & !(EVEN_MOVES | EVEN_MOVES << 1) | even << 1 | odd >> 1;
        }
    }

    /// All rows, to be written.
    pub fn all_mut(&mut self) -> &mut [u64] {
        &mut self.bits
    }

    /// Computes all rows.
    #[inline(never)]
    pub fn update(&mut self, arena: &Arena, units: &Units, tables: &UnitTables) {
        let own = arena.ids(self.faction);
        let (own_table, other_table) = (tables.of(self.faction), tables.of(self.faction.opponent()));
        for (row, &id) in self.bits.chunks_exact_mut(self.words).zip(own) {
            // No-op is the only action of the dead, and not available to the living.
            if !units.alive[id as usize] {
                row.iter_mut().for_each(|word| *word = 0);
                row[0] = 1 << action::NO_OP;
                continue;
            }
            let position = units.pos[id as usize];
            let is_healer = arena.stats(id).is_healer;
            // Planes do not matter here: a target that the unit cannot attack is available, too.
            let targets = if is_healer { own_table } else { other_table };
            // Bits of the next word, which precede those of the next targets.
            let mut first_bits = 1 << action::STOP | u64::from(arena.moves(position)) << action::NORTH;
            for (i, word) in row.iter_mut().enumerate() {
                let mut in_range = within_targeting_range(position, targets, i * UNITS_PER_WORD);
                if is_healer {
                    in_range &= !healers(arena, own, i * UNITS_PER_WORD);
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

/// Which of [`UNITS_PER_WORD`] units, from this one on, are healers. Healers heal neither themselves nor
/// other healers.
#[inline(never)]
fn healers(arena: &Arena, ids: &[u32], first: usize) -> u64 {
    let bit = |(bit, &id): (usize, &u32)| u64::from(arena.stats(id).is_healer) << bit;
    ids.iter().skip(first).take(UNITS_PER_WORD).enumerate().map(bit).sum()
}
