//! What battles keep for the interface, as the words of a snapshot: how many there are, and which are
//! possible.

use std::{fmt, iter};

use smaclite_scenarios::Capability;

use super::{GREATEST_LEVEL, Interface};
use crate::extent::Extent;

/// The greatest return is the sum of what all units are worth, over at most 2^64 resets.
const MAX_RETURN: f64 = 1e30;

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

    /// Checks words, of which there are as many as there must be.
    ///
    /// # Errors
    /// The first word that a battle cannot have.
    pub(crate) fn check_words(&self, words: &[u64]) -> Result<(), WrongWord> {
        let is_wrong = |(word, (_, allowed)): &(&u64, (&str, Allowed))| !allowed.contains(**word);
        let allowed = words.iter().zip(self.allowed_words());
        match allowed.enumerate().find(|(_, word)| is_wrong(word)) {
            Some((index, (&value, (meaning, allowed)))) => {
                Err(WrongWord { index, value, meaning, expected: allowed.to_string() })
            }
            None => Ok(()),
        }
    }

    /// What each word says, and what it can be. The flags behind them can be anything.
    fn allowed_words(&self) -> impl Iterator<Item = (&'static str, Allowed)> {
        let WordCounts { attack, health, looks, seers, commands, .. } = self.word_counts();
        let o = &self.options;
        let drawn = |capability: Option<Capability>, greatest: f64| {
            let bounds = capability.map_or([0.0; 2], |of| [of.lower_bound, of.upper_bound]);
            Allowed::Number { min: bounds[0].min(greatest), max: bounds[1].min(greatest) }
        };
        let n_units = (self.n_agents + self.n_enemies) as u64;
        // Points to go to are a move away from a position.
        let (Extent { low, high }, amount) = (Extent::of(&self.terrain), o.move_amount);
        let [x, y] = [(low.x, high.x), (low.y, high.y)].map(|(low, high)| Allowed::Number {
            min: f64::from(low) - amount,
            max: f64::from(high) + amount,
        });
        let command = [
            ("the order of an agent", Allowed::Whole { max: n_units, or: POINT }),
            ("x of where it goes", x),
            ("y of where it goes", y),
        ];
        let all = |meaning, allowed: Allowed, n: usize| iter::repeat_n((meaning, allowed), n);
        all("the greatest return", Allowed::Number { min: -MAX_RETURN, max: MAX_RETURN }, 1)
            .chain(all("the step", Allowed::Whole { max: (1 << 33) - 1, or: 0 }, 1))
            .chain(all("an attack probability", drawn(o.attack, 1.0), attack))
            .chain(all("a health level", drawn(o.health, GREATEST_LEVEL), health))
            .chain(all("a look", Allowed::Number { min: -1.0, max: 1.0 }, looks))
            .chain(all("a seer", Allowed::Whole { max: self.n_agents as u64 - 1, or: NO_SEER }, seers))
            .chain(command.into_iter().cycle().take(commands))
    }
}

/// A word that no battle has.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("the impossible word {value:#018x} at {index}: {meaning} must be {expected}")]
pub struct WrongWord {
    /// Its place.
    pub index: usize,
    /// The word.
    pub value: u64,
    /// What the word says.
    pub meaning: &'static str,
    /// What is possible.
    pub expected: String,
}

/// What a word can be.
#[derive(Clone, Copy, Debug)]
enum Allowed {
    /// The bits of a number.
    Number { min: f64, max: f64 },
    /// A whole number, or a special one.
    Whole { max: u64, or: u64 },
}

impl Allowed {
    fn contains(self, word: u64) -> bool {
        match self {
            Allowed::Number { min, max } => (min..=max).contains(&f64::from_bits(word)),
            Allowed::Whole { max, or } => word <= max || word == or,
        }
    }
}

impl fmt::Display for Allowed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Allowed::Number { min, max } => write!(f, "the bits of a number between {min} and {max}"),
            Allowed::Whole { max, or: 0 } => write!(f, "at most {max}"),
            Allowed::Whole { max, or } => write!(f, "at most {max}, or {or:#x}"),
        }
    }
}
