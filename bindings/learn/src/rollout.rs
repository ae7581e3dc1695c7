//! The data of one update: `horizon` steps of every environment, step after step, in one array per field.

use crate::config::{Algorithm, Config};
use crate::math::WIDTH;
use serde::Serialize;
use smaclite_engine::Sizes;

/// An episode that ended.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Episode {
    /// The sum of its rewards.
    pub episode_return: f32,
    /// Its steps.
    pub length: i32,
    /// Whether the agents won.
    pub won: bool,
}

/// What happened in `horizon` steps; a sample is an environment in one of them.
#[derive(Debug)]
pub(crate) struct Rollout {
    pub horizon: usize,
    pub num_envs: usize,
    pub sizes: Sizes,
    /// `n_actions`, padded.
    pub padded_actions: usize,
    /// `[horizon + 1, num_envs, n_agents, obs_size]`.
    pub obs: Vec<f32>,
    /// `[horizon + 1, num_envs, state_size]`; empty if the critic does not see the state.
    pub state: Vec<f32>,
    /// `[horizon, num_envs, n_agents, padded_actions]`.
    pub masks: Vec<u8>,
    /// `[horizon, num_envs, n_agents]`.
    pub actions: Vec<u16>,
    /// `[horizon, num_envs, n_agents]`.
    pub log_probs: Vec<f32>,
    /// `[horizon, num_envs]`, as the following three.
    pub rewards: Vec<f32>,
    pub terminated: Vec<bool>,
    pub truncated: Vec<bool>,
    /// The step only reset the environment: next-step autoreset ignores its actions.
    pub is_reset: Vec<bool>,
    /// The episodes that ended, by step and environment.
    pub episodes: Vec<Episode>,
}

impl Rollout {
    pub fn new(config: &Config, sizes: Sizes) -> Rollout {
        let Config { horizon, num_envs, .. } = *config;
        let padded_actions = sizes.n_actions.next_multiple_of(WIDTH);
        let samples = horizon * num_envs;
        let rows = samples * sizes.n_agents;
        let sees_state = config.algorithm == Algorithm::Mappo;
        Rollout {
            horizon,
            num_envs,
            sizes,
            padded_actions,
            obs: vec![0.0; (horizon + 1) * num_envs * sizes.n_agents * sizes.obs_size],
            state: vec![0.0; if sees_state { (horizon + 1) * num_envs * sizes.state_size } else { 0 }],
            masks: vec![0; rows * padded_actions],
            actions: vec![0; rows],
            log_probs: vec![0.0; rows],
            rewards: vec![0.0; samples],
            terminated: vec![false; samples],
            truncated: vec![false; samples],
            is_reset: vec![false; samples],
            episodes: Vec::new(),
        }
    }

    /// Steps that were not resets.
    pub fn steps(&self) -> u64 {
        self.is_reset.iter().filter(|is_reset| !**is_reset).count() as u64
    }

    /// The samples from which something can be learnt: those that are not resets.
    pub fn samples(&self) -> Vec<u32> {
        let samples = 0..self.rewards.len();
        samples.filter(|sample| !self.is_reset[*sample]).map(|sample| sample as u32).collect()
    }

    /// The rows, agents in samples, from which the policy learns: those with a choice. Dead agents have only
    /// the action no-op, so their rows are not among these.
    pub fn policy_rows(&self, samples: &[u32]) -> Vec<u32> {
        let has_choice = |row: &u32| {
            let mask = &self.masks[*row as usize * self.padded_actions..][..self.padded_actions];
            mask.iter().map(|available| u32::from(*available)).sum::<u32>() > 1
        };
        rows(samples, self.sizes.n_agents).filter(has_choice).collect()
    }
}

/// All rows of samples that have `width` rows each.
pub(crate) fn rows(samples: &[u32], width: usize) -> impl Iterator<Item = u32> {
    let width = width as u32;
    samples.iter().flat_map(move |sample| sample * width..(sample + 1) * width)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resets_and_agents_without_a_choice_are_not_learnt() {
        let sizes = Sizes { n_agents: 2, n_enemies: 1, n_actions: 7, obs_size: 1, state_size: 1 };
        let config = Config { horizon: 2, num_envs: 1, ..Config::default() };
        let mut rollout = Rollout::new(&config, sizes);
        rollout.masks[..5].fill(1); // step 0, agent 0
        rollout.masks[8] = 1; // step 0, agent 1: one action
        rollout.masks[16..].fill(1); // step 1, both
        assert_eq!(rollout.policy_rows(&rollout.samples()), [0, 2, 3]);
        assert!(rows(&rollout.samples(), 2).eq(0..4));
        rollout.is_reset[1] = true;
        assert_eq!((rollout.samples(), rollout.steps()), (vec![0], 1));
        assert_eq!(rollout.policy_rows(&rollout.samples()), [0]);
    }
}
