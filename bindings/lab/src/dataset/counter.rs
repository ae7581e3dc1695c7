//! What is counted while episodes are played again, for the card: the return of every episode, and the
//! different pairs of state and joint action.

use super::Dataset;
use super::arrays::ArrayName;
use super::chunk::{Chunk, Wanted};
use smaclite_engine::Sizes;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};
use xxhash_rust::xxh3::Xxh3;

/// Counts what some of the arrays tell, chunk by chunk, on several threads.
pub(super) struct Counter<'a> {
    dataset: &'a Dataset,
    wanted: Wanted,
    parts: Mutex<Vec<Part>>,
}

/// What is counted of all episodes; `None` without the arrays for it.
pub(super) struct Counted {
    /// By episode.
    pub returns: Option<Vec<f64>>,
    pub unique_pairs: Option<u64>,
}

/// The same of the episodes of a chunk.
struct Part {
    first: usize,
    returns: Vec<f64>,
    /// Hashes of their pairs of state and joint action.
    pairs: Vec<u64>,
}

impl<'a> Counter<'a> {
    pub fn new(dataset: &'a Dataset, wanted: Wanted) -> Counter<'a> {
        Counter { dataset, wanted, parts: Mutex::default() }
    }

    pub fn add(&self, chunk: &Chunk<'_>) {
        let first = chunk.episodes.start;
        let returns = if self.has_rewards() { returns(self.dataset, chunk) } else { Vec::new() };
        let pairs = if self.has_pairs() { pairs(self.dataset, chunk) } else { Vec::new() };
        let mut parts = self.parts.lock().unwrap_or_else(PoisonError::into_inner);
        parts.push(Part { first, returns, pairs });
    }

    pub fn finish(self) -> Counted {
        let (has_rewards, has_pairs) = (self.has_rewards(), self.has_pairs());
        let mut parts = self.parts.into_inner().unwrap_or_else(PoisonError::into_inner);
        parts.sort_unstable_by_key(|part| part.first);
        let returns = parts.iter().flat_map(|part| &part.returns).copied().collect();
        let mut pairs: Vec<u64> = parts.into_iter().flat_map(|part| part.pairs).collect();
        pairs.sort_unstable();
        pairs.dedup();
        Counted {
            returns: has_rewards.then_some(returns),
            unique_pairs: has_pairs.then_some(pairs.len() as u64),
        }
    }

    fn has_rewards(&self) -> bool {
        self.wanted[ArrayName::Reward as usize]
    }

    fn has_pairs(&self) -> bool {
        self.wanted[ArrayName::State as usize] && self.wanted[ArrayName::Actions as usize]
    }
}

/// Sums of the rewards of each episode.
fn returns(dataset: &Dataset, chunk: &Chunk<'_>) -> Vec<f64> {
    let first_step = dataset.steps_of_all(&chunk.episodes).start;
    let rewards: &[f32] = bytemuck::cast_slice(chunk.bytes(dataset, ArrayName::Reward));
    let returned = |episode| {
        let Range { start, end } = dataset.steps_of(episode);
        rewards[start - first_step..end - first_step].iter().map(|reward| f64::from(*reward)).sum()
    };
    chunk.episodes.clone().map(returned).collect()
}

fn pairs(dataset: &Dataset, chunk: &Chunk<'_>) -> Vec<u64> {
    let states: &[f32] = bytemuck::cast_slice(chunk.bytes(dataset, ArrayName::State));
    let actions: &[i32] = bytemuck::cast_slice(chunk.bytes(dataset, ArrayName::Actions));
    let Sizes { n_agents, state_size, .. } = dataset.sizes();
    let rows = states.chunks_exact(state_size).zip(actions.chunks_exact(n_agents));
    rows.map(|(state, actions)| pair(state, actions)).collect()
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
