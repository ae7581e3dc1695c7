//! Numbers that look random and follow from what they are drawn for, so that a battle can be played again.

/// Mixes words into one (splitmix64 over each).
pub fn mix(words: &[u64]) -> u64 {
    words.iter().fold(0x9e37_79b9_7f4a_7c15, |state, word| {
        let mut z = (state ^ word).wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    })
}

/// A row of numbers from a seed.
pub struct Dice {
    seed: u64,
    drawn: u64,
}

impl Dice {
    /// Numbers of this seed.
    pub fn new(seed: u64) -> Dice {
        Dice { seed, drawn: 0 }
    }

    /// A number below `limit`.
    pub fn below(&mut self, limit: u64) -> u64 {
        self.drawn += 1;
        mix(&[self.seed, self.drawn]) % limit
    }

    /// One of these.
    pub fn pick<'a, T>(&mut self, choices: &'a [T]) -> &'a T {
        &choices[self.below(choices.len() as u64) as usize]
    }
}

/// A legal joint action from the masks `[n_agents, n_actions]` of an environment: drawn anew for every step
/// `step` of every environment `env`, the same whoever asks.
pub fn joint_action(masks: &[u8], n_actions: usize, env: usize, step: u64, out: &mut [i32]) {
    for (agent, (mask, action)) in masks.chunks_exact(n_actions).zip(out).enumerate() {
        let validator = mask.iter().filter(|a| **a != 0).count() as u64;
        let nth = mix(&[env as u64, step, agent as u64]) % validator.max(1);
        let found = mask.iter().enumerate().filter(|(_, a)| **a != 0).nth(nth as usize);
        *action = found.map_or(0, |(action, _)| action as i32);
    }
}
