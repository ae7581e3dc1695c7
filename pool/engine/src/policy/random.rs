//! Uniformly random available actions.

use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::Situation;

/// Plays uniformly random available actions. Equal seeds play equally in equal battles.
#[derive(Clone, Debug)]
pub struct Random {
    generator: Pcg64Mcg,
}

impl Random {
    /// A policy with a separate random stream.
    pub fn new(seed: u64) -> Random {
        Random { generator: Pcg64Mcg::seed_from_u64(seed) }
    }

    /// Writes an action for each agent.
    ///
    /// # Panics
    /// If `actions` is longer than there are agents.
    pub fn act(&mut self, situation: &impl Situation, actions: &mut [i32]) {
        for (agent, action) in actions.iter_mut().enumerate() {
            *action = pick(situation.available(agent), self.generator.next_u64()) as i32;
        }
    }
}

/// The position of a random set bit, uniform if the random `word` is; 0 if no bit is set.
///
/// `bits` are those of [`Situation::available`]: bit `i % 64` of element `i / 64` is at position `i`.
fn pick(bits: &[u64], word: u64) -> usize {
    let count: u32 = bits.iter().map(|bits| bits.count_ones()).sum();
    // The high bits of word * count are uniform in 0..count, to within count / 2^64.
    let mut skip = ((u128::from(word) * u128::from(count)) >> 64) as u32;
    for (i, &bits) in bits.iter().enumerate() {
        if skip < bits.count_ones() {
            // Clears the lowest bit `skip` times.
            let rest = (0..skip).fold(bits, |bits, _| bits & (bits - 1));
            return i * 64 + rest.trailing_zeros() as usize;
        }
        skip -= bits.count_ones();
    }
    0
}
