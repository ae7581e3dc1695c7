//! What an update has of one map.

use crate::config::{Algorithm, Config};
use crate::gae::{Steps, advantages};
use crate::gradient::{Data, Share, ThreadMemory, values};
use crate::parallel::Interrupted;
use crate::random::{Purpose, generator};
use crate::rollout::{Rollout, rows};
use crate::team::{OnScenario, Team};
use rand::seq::SliceRandom;

/// What was played on a map, and what the team is there.
pub(crate) struct Played<'a> {
    pub rollout: &'a Rollout,
    /// `None` if the networks are those of this scenario.
    pub on_scenario: Option<&'a mut OnScenario>,
    /// Of the order of its samples.
    pub seed: u64,
}

impl Played<'_> {
    /// Has the networks of the scenario take over the present parameters.
    pub fn specialise(&mut self, team: &Team) {
        if let Some(on_scenario) = &mut self.on_scenario {
            on_scenario.specialise(team);
        }
    }

    /// What acts on the map.
    fn team<'t>(&'t self, team: &'t Team) -> &'t Team {
        self.on_scenario.as_ref().map_or(team, |on_scenario| on_scenario.team())
    }
}

/// The rows of a map.
pub(super) struct Part<'a> {
    pub played: Played<'a>,
    pub data: Data<'a>,
    samples: Vec<u32>,
    pub policy_rows: Vec<u32>,
    value_rows: Vec<u32>,
}

impl<'a> Part<'a> {
    pub fn new(
        mut played: Played<'a>,
        team: &Team,
        config: &Config,
        threads: &mut [ThreadMemory],
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<Part<'a>, Interrupted> {
        let rollout = played.rollout;
        let (critic_inputs, critic_size, values_per_env) = match config.algorithm {
            Algorithm::Mappo => (&rollout.state, rollout.sizes.state_size, 1),
            Algorithm::Ippo => (&rollout.obs, rollout.sizes.obs_size, rollout.sizes.n_agents),
        };
        let samples = rollout.samples();
        let policy_rows = rollout.policy_rows(&samples);
        let value_rows: Vec<u32> = rows(&samples, values_per_env).collect();
        played.specialise(team);
        let critic = &played.team(team).critic;
        let old_values = values(critic, critic_inputs, critic_size, values_per_env, threads, interrupted)?;
        let (returns, advantages) = (Vec::new(), Vec::new());
        let data =
            Data { rollout, critic_inputs, critic_size, values_per_env, advantages, old_values, returns };
        Ok(Part { played, data, samples, policy_rows, value_rows })
    }

    /// Samples are shuffled and not rows, because the rows of a sample lie side by side in memory.
    pub fn shuffle(&mut self, update: u64, epoch: u64) {
        self.samples.shuffle(&mut generator(self.played.seed, Purpose::Minibatches, [update, epoch]));
        self.policy_rows = self.played.rollout.policy_rows(&self.samples);
        self.value_rows = rows(&self.samples, self.data.values_per_env).collect();
    }

    /// Estimates advantages and returns from the critic's values.
    pub fn estimate(&mut self, mean: f64, deviation: f64, config: &Config) {
        let Rollout { rewards, terminated, truncated, num_seats, horizon, .. } = self.played.rollout;
        let values = &mut self.data.old_values;
        values.iter_mut().for_each(|value| *value = (f64::from(*value) * deviation + mean) as f32);
        let steps = Steps { rewards, terminated, truncated, num_envs: *num_seats };
        let mut estimated = vec![0.0; values.len() / (horizon + 1) * horizon];
        advantages(&steps, values, config.gamma, config.lambda, &mut estimated);
        self.data.returns =
            estimated.iter().zip(&*values).map(|(advantage, value)| advantage + value).collect();
        self.data.advantages = estimated;
    }

    /// The values of the learnt rows.
    pub fn learnt<'v>(&'v self, values: &'v [f32]) -> impl Iterator<Item = f32> + Clone + 'v {
        self.value_rows.iter().map(|row| values[*row as usize])
    }

    /// What this map has in minibatch `i` of `n`.
    pub fn share<'s>(&'s self, team: &'s Team, i: usize, n: usize) -> Share<'s> {
        Share {
            team: self.played.team(team),
            specialisations: self.played.on_scenario.as_ref().map(|on| on.specialisations()),
            data: &self.data,
            policy_rows: nth(&self.policy_rows, i, n),
            value_rows: nth(&self.value_rows, i, n),
        }
    }
}

/// Part `i` of `n` parts, as equal as can be.
fn nth(rows: &[u32], i: usize, n: usize) -> &[u32] {
    &rows[rows.len() * i / n..rows.len() * (i + 1) / n]
}
