//! Datasets for offline learning, as recipes: a file has the scenario, and the seed and the actions of every
//! episode, a few bytes per step. Observations, states, rewards and all else are computed again, with the
//! same bits on every machine, and compared with the hashes in the file.
//!
//! `record` plays the policies whose actions are kept (`quality` chooses among those of a training run);
//! `file` is the recipe as bytes; `arrays` declares what it is expanded to, `expand` plays the episodes again
//! on several threads, into memory or (`folder`) files of NumPy; `card` describes what was played, for which
//! `counter` counts.

mod arrays;
mod card;
mod chunk;
mod counter;
mod error;
mod expand;
mod file;
mod folder;
mod quality;
mod record;

pub use arrays::{ARRAYS, ArrayName, ArraySpec, PerRow, UnknownArray, Values};
pub use card::{Card, Distribution, PolicyCard};
pub use error::DatasetError;
pub use file::SUFFIX;
pub use quality::Quality;
pub use record::{Amount, Recording, Source};

use serde::{Deserialize, Serialize};
use smaclite_engine::{Arena, BattleSetup, Sizes};
use std::ops::Range;
use std::sync::Arc;

/// A dataset: what is played, and the actions of its episodes.
///
/// ```
/// use smaclite_engine::{Rules, policy};
/// use smaclite_lab::{Amount, ArrayName, Dataset, Recording, Source};
/// use smaclite_learn::resolve_scenario;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let source = Source::Script {
///     setup: resolve_scenario("3m", Rules::Smaclite)?,
///     tactic: policy::Tactic::FocusFire,
/// };
/// let recording = Recording { source, amount: Amount::Episodes(4), seed: 1, greedy: false, threads: 2 };
/// let dataset = Dataset::record(&recording, &mut || false)?;
/// let arrays = dataset.expand(&[ArrayName::Obs, ArrayName::Reward], 2, &mut || false)?;
/// let (_, rewards) = &arrays[1];
/// assert_eq!(rewards.bytes().len(), 4 * dataset.n_steps());
/// # Ok(())
/// # }
/// ```
///
/// # At the edges
///
/// - Every episode is whole: it begins with a reset that is seeded with its own seed, and ends by itself
///   or at the episode limit, without which nothing is recorded.
/// - The actions are those of the agents; a script plays the enemies, so there is no dataset of both sides.
/// - A release whose rules differ cannot expand the file; the error names the first episode or array that
///   differs, and the release that recorded it.
#[derive(Clone, Debug)]
pub struct Dataset {
    /// What errors call it: its file.
    source: String,
    program: String,
    setup: BattleSetup,
    arena: Arc<Arena>,
    policies: Vec<Policy>,
    episodes: Vec<Episode>,
    /// Of episode `i` those from row `starts[i]` on; one more than there are episodes.
    starts: Vec<usize>,
    /// `[steps, n_agents]`.
    actions: Vec<u16>,
    /// By array.
    hashes: Vec<u128>,
    card: Card,
}

/// Who chose the actions of some episodes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Policy {
    /// The name of a scripted policy, or that of the file in the folder of the run.
    pub name: String,
    /// Environment steps that it had been trained for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub training_steps: Option<u64>,
    /// Its win rate in the evaluation of the training run, with drawn actions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sampled_win_rate: Option<f64>,
}

/// An episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Episode {
    /// The seed of its battle.
    pub seed: u64,
    /// Number of steps.
    pub length: u32,
    /// The policy that played it, an index.
    pub policy: u16,
    /// How it ended.
    pub end: End,
}

/// How an episode ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct End {
    /// All units of a side are dead.
    pub terminated: bool,
    /// The episode limit was reached.
    pub truncated: bool,
    /// All enemies are dead.
    pub battle_won: bool,
}

impl Dataset {
    /// The program that recorded it, with its version.
    pub fn program(&self) -> &str {
        &self.program
    }

    /// What is played.
    pub fn setup(&self) -> &BattleSetup {
        &self.setup
    }

    /// Numbers of units and actions, and the sizes of observations and state.
    pub fn sizes(&self) -> Sizes {
        self.arena.sizes()
    }

    /// Steps after which an episode is truncated.
    pub fn episode_limit(&self) -> Option<u32> {
        self.arena.episode_limit()
    }

    /// Who chose the actions.
    pub fn policies(&self) -> &[Policy] {
        &self.policies
    }

    /// The episodes, in order.
    pub fn episodes(&self) -> &[Episode] {
        &self.episodes
    }

    /// Steps of all episodes.
    pub fn n_steps(&self) -> usize {
        self.starts.last().copied().unwrap_or(0)
    }

    /// What was played.
    pub fn card(&self) -> &Card {
        &self.card
    }

    /// The card with the keys `program` and `hash`, as `card.json` has it.
    ///
    /// # Errors
    /// Those of `serde_json`.
    pub fn card_json(&self) -> serde_json::Result<serde_json::Value> {
        #[derive(Serialize)]
        struct Described<'a> {
            #[serde(flatten)]
            card: &'a Card,
            program: &'a str,
            hash: String,
        }
        serde_json::to_value(Described { card: &self.card, program: &self.program, hash: self.hash() })
    }

    /// The hash of all arrays, 32 hexadecimal digits: equal hashes are equal data.
    pub fn hash(&self) -> String {
        let bytes: Vec<u8> = self.hashes.iter().flat_map(|hash| hash.to_le_bytes()).collect();
        format!("{:032x}", xxhash_rust::xxh3::xxh3_128(&bytes))
    }

    /// The rows of an episode in the arrays that have one per step.
    pub fn steps_of(&self, episode: usize) -> Range<usize> {
        self.starts[episode]..self.starts[episode + 1]
    }

    fn actions_of(&self, step: usize) -> &[u16] {
        let n_agents = self.sizes().n_agents;
        &self.actions[step * n_agents..][..n_agents]
    }
}

/// The rows at which episodes of these lengths begin, and the number of rows.
fn starts(episodes: &[Episode]) -> Vec<usize> {
    let mut start = 0;
    let ends = episodes.iter().map(|episode| {
        start += episode.length as usize;
        start
    });
    std::iter::once(0).chain(ends).collect()
}

#[cfg(test)]
mod tests;
