//! What battles keep for the interface, as the words of a snapshot: how many there are, and which are
//! possible.

use super::Interface;

/// The word of an enemy that nobody has seen.
pub(crate) const NO_SEER: u64 = u64::MAX;
/// The first word of the command to go to a point.
pub(crate) const POINT: u64 = u64::MAX;

/// How many numbers of each kind a battle keeps, in the order of the words.
pub(crate) struct WordCounts {
    pub attack: usize,
    pub health: usize,
    pub looks: usize,
    pub seers: usize,
    pub commands: usize,
    pub flags: usize,
    pub mask: usize,
}

impl Interface {
    pub(crate) fn word_counts(&self) -> WordCounts {
        let when = |is_there: bool, n: usize| if is_there { n } else { 0 };
        let (n_agents, n_pairs) = (self.n_agents, self.n_agents * self.n_enemies);
        WordCounts {
            attack: when(self.options.attack.is_some(), n_agents),
            health: when(self.options.health.is_some(), n_agents),
            looks: 2 * n_agents,
            seers: self.n_enemies,
            commands: 3 * n_agents,
            flags: n_pairs,
            mask: when(self.options.enemy_mask.is_some(), n_pairs),
        }
    }

    /// Words of a snapshot's column `perception`.
    pub(crate) fn perception_size(&self) -> usize {
        let WordCounts { attack, health, looks, seers, commands, flags, mask } = self.word_counts();
        2 + attack + health + looks + seers + commands + 2 * flags.div_ceil(64) + mask.div_ceil(64)
    }

    /// The first word that a battle cannot have, of as many as there must be.
    pub(crate) fn invalid_word(&self, words: &[u64]) -> Option<usize> {
        let WordCounts { attack, health, looks, seers, commands, .. } = self.word_counts();
        let is_number = |word: u64| f64::from_bits(word).is_finite();
        let first_level = 2 + attack;
        let first_seer = first_level + health + looks;
        let first_command = first_seer + seers;
        let n_units = (self.n_agents + self.n_enemies) as u64;
        let is_valid = |i: usize, word: u64| match i {
            // The greatest return, which may be negative; rewards are divided by it if they are scaled.
            0 => is_number(word) && (!self.options.rewards.scale || f64::from_bits(word) != 0.0),
            1 => word >> 33 == 0,
            i if first_level <= i && i < first_level + health => (0.0..1.0).contains(&f64::from_bits(word)),
            i if i < first_seer => is_number(word),
            i if i < first_command => word == NO_SEER || word < self.n_agents as u64,
            i if i < first_command + commands => match (i - first_command) % 3 {
                0 => word == POINT || word <= n_units,
                _ => is_number(word),
            },
            _ => true,
        };
        words.iter().enumerate().find(|(i, word)| !is_valid(*i, **word)).map(|(i, _)| i)
    }
}
