//! The card of a dataset: what was played, how well, and how much of it is different.
//!
//! A file's card is compared with the rest of the file when it is read, and the part that only the arrays
//! tell when they are expanded. Both compute it as `measure` did, in the same order, so it must be equal to
//! the bit.

use super::arrays::N_ARRAYS;
use super::counter::{Counted, Counter};
use super::{Dataset, DatasetError, Episode, Policy};
use crate::statistics::quantile;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use smaclite_engine::Sizes;
use smaclite_units::file::shortened;

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

/// How numbers are distributed. Quantiles are interpolated linearly, as NumPy's are.
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

impl Dataset {
    /// Plays all episodes, and notes the hashes of their arrays and the card.
    pub(super) fn measure(
        &mut self,
        threads: usize,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<(), DatasetError> {
        let counter = Counter::new(self, [true; N_ARRAYS]);
        let hashes = self.play([true; N_ARRAYS], None, threads, interrupted, |chunk| {
            counter.add(&chunk);
            Ok(())
        })?;
        let counted = counter.finish();
        let mut card = self.card_of_episodes();
        self.complete(&mut card, &counted);
        self.card = card;
        self.hashes = hashes.to_vec();
        Ok(())
    }

    /// Compares the card with what setup, policies and episodes say. Returns and different pairs are those of
    /// [`check_counted`](Self::check_counted).
    pub(super) fn check_card(&self) -> Result<(), DatasetError> {
        let mut expected = self.card_of_episodes();
        expected.returns = self.card.returns;
        for (expected, given) in expected.policies.iter_mut().zip(&self.card.policies) {
            expected.mean_return = given.mean_return;
        }
        self.complete(&mut expected, &Counted { returns: None, unique_pairs: Some(self.card.unique_pairs) });
        self.compare_card(&expected)
    }

    /// Compares the card with what was counted when the episodes were played again.
    pub(super) fn check_counted(&self, counted: &Counted) -> Result<(), DatasetError> {
        let mut expected = self.card.clone();
        self.complete(&mut expected, counted);
        self.compare_card(&expected)
    }

    fn compare_card(&self, expected: &Card) -> Result<(), DatasetError> {
        if *expected == self.card {
            return Ok(());
        }
        let json = |card: &Card| serde_json::to_value(card).unwrap_or_default();
        let difference = difference("card", &json(expected), &json(&self.card));
        let (key, expected, given) = difference.unwrap_or_default();
        let [expected, given] = [expected, given].map(|text| shortened(&text));
        Err(DatasetError::Invalid { file: self.source.clone(), key, expected, given })
    }

    /// The card without returns and different pairs.
    fn card_of_episodes(&self) -> Card {
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
            lengths: Distribution::of(&lengths),
            policies: self.policy_cards(),
            ..Card::default()
        }
    }

    fn policy_cards(&self) -> Vec<PolicyCard> {
        let named = |policy: &Policy| PolicyCard { name: policy.name.clone(), ..PolicyCard::default() };
        let mut cards: Vec<PolicyCard> = self.policies.iter().map(named).collect();
        for episode in &self.episodes {
            let card = &mut cards[usize::from(episode.policy)];
            card.episodes += 1;
            card.steps += episode.length as usize;
            card.win_rate += f64::from(u8::from(episode.end.battle_won)); // a number until it is divided
        }
        for card in &mut cards {
            card.win_rate /= card.episodes.max(1) as f64;
        }
        cards
    }

    /// Writes what was counted into a card.
    fn complete(&self, card: &mut Card, counted: &Counted) {
        if let Some(returns) = &counted.returns {
            card.returns = Distribution::of(returns);
            let mut sums = vec![0.0; card.policies.len()];
            for (episode, value) in self.episodes.iter().zip(returns) {
                sums[usize::from(episode.policy)] += value;
            }
            for (card, sum) in card.policies.iter_mut().zip(sums) {
                card.mean_return = sum / card.episodes.max(1) as f64;
            }
        }
        if let Some(unique_pairs) = counted.unique_pairs {
            card.unique_pairs = unique_pairs;
            card.coverage = unique_pairs as f64 / self.n_steps().max(1) as f64;
        }
    }
}

/// The first key whose values differ, and both.
fn difference(key: &str, expected: &Value, given: &Value) -> Option<(String, String, String)> {
    match (expected, given) {
        _ if expected == given => None,
        (Value::Object(expected), Value::Object(given)) => expected
            .iter()
            .find_map(|(name, value)| difference(&format!("{key}.{name}"), value, given.get(name)?)),
        (Value::Array(expected), Value::Array(given)) if expected.len() == given.len() => {
            let pairs = expected.iter().zip(given).enumerate();
            pairs
                .into_iter()
                .find_map(|(i, (expected, given))| difference(&format!("{key}[{i}]"), expected, given))
        }
        (Value::Array(expected), Value::Array(given)) => {
            Some((key.to_owned(), format!("a list of {}", expected.len()), given.len().to_string()))
        }
        _ => Some((key.to_owned(), expected.to_string(), given.to_string())),
    }
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
        let quantile = |share: f64| quantile(&sorted, share).unwrap_or_default();
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
