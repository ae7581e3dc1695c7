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
            // The high bits of word * count are uniform in 0..count, to within count / 2^64.
            let (word, count) = (self.generator.next_u64(), situation.n_available(agent));
            let n = ((u128::from(word) * u128::from(count)) >> 64) as u32;
            *action = situation.nth_available(agent, n) as i32;
        }
    }
}
