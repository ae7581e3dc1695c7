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
        random(situation, actions, || self.next());
    }

    pub(super) fn next(&mut self) -> u64 {
        self.generator.next_u64()
    }
}

/// Writes a uniformly random available action for each agent; `draw` gives 64 random bits.
pub(super) fn random(situation: &impl Situation, actions: &mut [i32], mut draw: impl FnMut() -> u64) {
    for (agent, action) in actions.iter_mut().enumerate() {
        let n = uniform_below(situation.n_available(agent), draw());
        *action = situation.nth_available(agent, n) as i32;
    }
}

/// A number below `count`, or 0 if `count` is 0, as uniform as the 64 random bits, to within count / 2^64:
/// the high bits of their product (D. Lemire, "Fast random integer generation in an interval", 2019,
/// without the rejection).
pub fn uniform_below(count: u32, random: u64) -> u32 {
    ((u128::from(random) * u128::from(count)) >> 64) as u32
}
