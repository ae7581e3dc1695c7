//! What a lane can append to the observations of its agents: their own last actions and their own number.
//!
//! A row of `obs` then has the features of the environment, the last K actions as one-hot vectors of
//! `n_actions`, the newest first, and the number as a one-hot vector of `n_agents`. Actions from before the
//! episode are zeros, and so is the whole row of a dead agent.

use crate::environment::{Environment, JointAction};
use crate::lane_settings::LaneSettings;
use smaclite_engine::Sizes;

/// What is appended to the observations of one environment.
pub(crate) struct OwnFeatures {
    /// Of the environment, without what is appended.
    sizes: Sizes,
    /// The joint actions of the last steps, `[last_actions, n_agents]`, the newest first.
    history: Vec<i32>,
    /// How many of them are of this episode, from the first on.
    known: usize,
    last_actions: usize,
    agent_id: bool,
    /// Of the last row that was written: `[n_agents]`.
    alive: Vec<u8>,
}

impl OwnFeatures {
    /// `None` if the lane appends nothing.
    pub(crate) fn new(settings: &LaneSettings, sizes: Sizes) -> Option<Box<OwnFeatures>> {
        let LaneSettings { obs_last_actions: last_actions, obs_agent_id: agent_id, .. } = *settings;
        (last_actions > 0 || agent_id).then(|| {
            let (history, alive) = (vec![0; last_actions * sizes.n_agents], vec![0; sizes.n_agents]);
            Box::new(OwnFeatures { sizes, history, known: 0, last_actions, agent_id, alive })
        })
    }

    /// Begins an episode.
    pub(crate) fn reset(&mut self) {
        self.known = 0;
    }

    /// A step was made with this joint action.
    pub(crate) fn step(&mut self, actions: JointAction<'_>) {
        if self.last_actions > 0 {
            self.history.rotate_right(self.sizes.n_agents);
            self.history.iter_mut().zip(actions.iter()).for_each(|(newest, action)| *newest = action);
            self.known = (self.known + 1).min(self.last_actions);
        }
    }

    /// The joint actions of this episode that are kept, `[known, n_agents]`, the newest first.
    pub(crate) fn past_actions(&self) -> &[i32] {
        &self.history[..self.known * self.sizes.n_agents]
    }

    /// Replaces them by at most as many as are kept.
    pub(crate) fn set_past_actions(&mut self, past: &[i32]) {
        self.history[..past.len()].copy_from_slice(past);
        self.known = past.len() / self.sizes.n_agents;
    }

    /// Completes the rows of `obs`, in which the environment left zeros after its own features.
    pub(crate) fn write(&mut self, env: &dyn Environment, obs: &mut [f32]) {
        let Sizes { n_agents, n_actions, obs_size, .. } = self.sizes;
        env.write_alive(&mut self.alive);
        for (agent, row) in obs.chunks_exact_mut(obs.len() / n_agents).enumerate() {
            if self.alive[agent] == 0 {
                continue;
            }
            let (past, id) = row[obs_size..].split_at_mut(self.last_actions * n_actions);
            let joint_actions = self.history.chunks_exact(n_agents).take(self.known);
            for (one_hot, actions) in past.chunks_exact_mut(n_actions).zip(joint_actions) {
                one_hot[actions[agent] as usize] = 1.0;
            }
            if self.agent_id {
                id[agent] = 1.0;
            }
        }
    }
}
