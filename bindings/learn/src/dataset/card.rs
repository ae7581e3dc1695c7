//! The card of a dataset: what was played, how well, and how much of it is different.

use super::arrays::{ArrayName, N_ARRAYS};
use super::chunk::Chunk;
use super::{Dataset, DatasetError, Episode};
use serde::{Deserialize, Serialize};
use smaclite_engine::Sizes;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};
use xxhash_rust::xxh3::Xxh3;

/// The card of a dataset. Its file has it, so that reading it takes no battle.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Card {
    /// The scenario's name.
    pub scenario: String,
    /// The rules of its battles.
    pub rules: String,
    /// Who played the enemies.
    pub opponents: String,
    /// Numbers of units and actions, and the sizes of observations and state.
    pub sizes: CardSizes,
    /// Number of episodes.
    pub episodes: usize,
    /// Number of steps.
    pub steps: usize,
    /// Share of won episodes.
    pub win_rate: f64,
    /// Share of episodes that ended by the episode limit.
    pub truncated_rate: f64,
    /// Sums of the episodes' rewards.
    pub returns: Distribution,
    /// Steps of the episodes.
    pub lengths: Distribution,
    /// Different pairs of state and joint action.
    pub unique_pairs: u64,
    /// Their share of all steps (SACo).
    pub coverage: f64,
    /// Who chose the actions.
    pub policies: Vec<PolicyCard>,
}

/// Sizes of the arrays of a dataset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)] // as in `Sizes`
pub struct CardSizes {
    pub n_agents: usize,
    pub n_enemies: usize,
    pub n_actions: usize,
    pub obs_size: usize,
    pub state_size: usize,
}

/// How numbers are distributed. Quantiles are values that occur, without interpolation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)]
pub struct Distribution {
    pub mean: f64,
    pub deviation: f64,
    pub min: f64,
    pub quantile_25: f64,
    pub median: f64,
    pub quantile_75: f64,
    pub max: f64,
}

/// What one policy played.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PolicyCard {
    /// Its name.
    pub name: String,
    /// Number of its episodes.
    pub episodes: usize,
    /// Number of its steps.
    pub steps: usize,
    /// Share of them that it won.
    pub win_rate: f64,
    /// Mean of their returns.
    pub mean_return: f64,
}

/// What is counted of some episodes.
struct Counted {
    first: usize,
    returns: Vec<f64>,
    /// Hashes of their pairs of state and joint action.
    pairs: Vec<u64>,
}

impl Dataset {
    /// Plays all episodes, and notes the hashes of their arrays and the card.
    pub(super) fn measure(
        &mut self,
        threads: usize,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<(), DatasetError> {
        let counted = Mutex::new(Vec::new());
        let count = |chunk: Chunk<'_>| {
            let counts = Counted::of(self, &chunk);
            counted.lock().unwrap_or_else(PoisonError::into_inner).push(counts);
            Ok(())
        };
        let hashes = self.play([true; N_ARRAYS], None, threads, interrupted, count)?;
        let mut counted = counted.into_inner().unwrap_or_else(PoisonError::into_inner);
        counted.sort_unstable_by_key(|counted| counted.first);
        let returns: Vec<f64> = counted.iter().flat_map(|counted| &counted.returns).copied().collect();
        let mut pairs: Vec<u64> = counted.into_iter().flat_map(|counted| counted.pairs).collect();
        pairs.sort_unstable();
        pairs.dedup();
        self.card = self.card_of(&returns, pairs.len() as u64);
        self.hashes = hashes.to_vec();
        Ok(())
    }

    fn card_of(&self, returns: &[f64], unique_pairs: u64) -> Card {
        let (episodes, steps) = (self.episodes.len(), self.n_steps());
        let share = |has: &dyn Fn(&Episode) -> bool| {
            self.episodes.iter().filter(|episode| has(episode)).count() as f64 / episodes.max(1) as f64
        };
        let lengths: Vec<f64> = self.episodes.iter().map(|episode| f64::from(episode.length)).collect();
        Card {
            // Its texts are valid: the arena was made of them.
            scenario: self.setup.files.scenario().map_or(String::new(), |scenario| scenario.name),
            rules: self.setup.rules.to_string(),
            opponents: self.setup.opponents.to_string(),
            sizes: self.sizes().into(),
            episodes,
            steps,
            win_rate: share(&|episode| episode.end.battle_won),
            truncated_rate: share(&|episode| episode.end.truncated),
            returns: Distribution::of(returns),
            lengths: Distribution::of(&lengths),
            unique_pairs,
            coverage: unique_pairs as f64 / steps.max(1) as f64,
            policies: (0..self.policies.len()).map(|policy| self.policy_card(policy, returns)).collect(),
        }
    }

    fn policy_card(&self, policy: usize, returns: &[f64]) -> PolicyCard {
        let of_policy = self.episodes.iter().zip(returns);
        let own: Vec<_> = of_policy.filter(|(episode, _)| usize::from(episode.policy) == policy).collect();
        let episodes = own.len();
        let won = own.iter().filter(|(episode, _)| episode.end.battle_won).count();
        PolicyCard {
            name: self.policies[policy].name.clone(),
            episodes,
            steps: own.iter().map(|(episode, _)| episode.length as usize).sum(),
            win_rate: won as f64 / episodes.max(1) as f64,
            mean_return: own.iter().map(|(_, value)| **value).sum::<f64>() / episodes.max(1) as f64,
        }
    }
}

impl Counted {
    fn of(dataset: &Dataset, chunk: &Chunk<'_>) -> Counted {
        let first_step = dataset.steps_of_all(&chunk.episodes).start;
        let rewards: &[f32] = bytemuck::cast_slice(chunk.bytes(dataset, ArrayName::Reward));
        let rows = |episode| {
            let Range { start, end } = dataset.steps_of(episode);
            start - first_step..end - first_step
        };
        let returned = |episode| rewards[rows(episode)].iter().map(|reward| f64::from(*reward)).sum();
        let states: &[f32] = bytemuck::cast_slice(chunk.bytes(dataset, ArrayName::State));
        let actions: &[i32] = bytemuck::cast_slice(chunk.bytes(dataset, ArrayName::Actions));
        let Sizes { n_agents, state_size, .. } = dataset.sizes();
        let rows = states.chunks_exact(state_size).zip(actions.chunks_exact(n_agents));
        Counted {
            first: chunk.episodes.start,
            returns: chunk.episodes.clone().map(returned).collect(),
            pairs: rows.map(|(state, actions)| pair(state, actions)).collect(),
        }
    }
}

/// The hash of a state and a joint action. As in OG-MARL's SACo, states are equal that are so after four
/// decimals.
fn pair(state: &[f32], actions: &[i32]) -> u64 {
    let mut hasher = Xxh3::new();
    for value in state {
        let rounded = (f64::from(*value) * 1e4).round_ties_even() as i32;
        hasher.update(&rounded.to_le_bytes());
    }
    hasher.update(bytemuck::cast_slice(actions));
    hasher.digest()
}

impl Distribution {
    fn of(values: &[f64]) -> Distribution {
        let mut sorted = values.to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        let (Some(first), Some(last)) = (sorted.first(), sorted.last()) else {
            return Distribution::default();
        };
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let square = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / n;
        let quantile = |share: f64| sorted[((sorted.len() - 1) as f64 * share).round() as usize];
        Distribution {
            mean,
            deviation: square.sqrt(),
            min: *first,
            quantile_25: quantile(0.25),
            median: quantile(0.5),
            quantile_75: quantile(0.75),
            max: *last,
        }
    }
}

impl From<Sizes> for CardSizes {
    fn from(sizes: Sizes) -> CardSizes {
        let Sizes { n_agents, n_enemies, n_actions, obs_size, state_size, .. } = sizes;
        CardSizes { n_agents, n_enemies, n_actions, obs_size, state_size }
    }
}
