//! What a lane can append to the observations of its agents: their own last actions and their own number.
//!
//! A row of `obs` then has the features of the environment, the last K actions as one-hot vectors of
//! `n_actions`, the newest first, and the number as a one-hot vector of `n_agents`. Actions from before the
//! episode are zeros, and so is the whole row of a dead agent.

use crate::environment::JointAction;
use crate::lane_settings::LaneSettings;
use smaclite_engine::{Faction, Sizes};

/// What is appended to the observations of one environment.
pub(crate) struct OwnFeatures {
    /// Of the environment, without what is appended.
    sizes: Sizes,
    /// The joint actions of the last steps, `[last_actions, n_actors]`, the newest first.
    history: Vec<i32>,
    /// How many of them are of this episode, from the first on.
    known: usize,
    last_actions: usize,
    agent_id: bool,
}

impl OwnFeatures {
    /// `None` if the lane appends nothing.
    pub(crate) fn new(settings: &LaneSettings, sizes: Sizes) -> Option<Box<OwnFeatures>> {
        let LaneSettings { obs_last_actions: last_actions, obs_agent_id: agent_id, .. } = *settings;
        (last_actions > 0 || agent_id).then(|| {
            let history = vec![0; last_actions * sizes.n_actors()];
            Box::new(OwnFeatures { sizes, history, known: 0, last_actions, agent_id })
        })
    }

    /// Begins an episode.
    pub(crate) fn reset(&mut self) {
        self.known = 0;
    }

    /// A step was made with this joint action.
    pub(crate) fn step(&mut self, actions: JointAction<'_>) {
        if self.last_actions > 0 {
            self.history.rotate_right(self.sizes.n_actors());
            self.history.iter_mut().zip(actions.iter()).for_each(|(newest, action)| *newest = action);
            self.known = (self.known + 1).min(self.last_actions);
        }
    }

    /// The joint actions of this episode that are kept, `[known, n_actors]`, the newest first.
    pub(crate) fn past_actions(&self) -> &[i32] {
        &self.history[..self.known * self.sizes.n_actors()]
    }

    /// Replaces them by at most as many as are kept.
    pub(crate) fn set_past_actions(&mut self, past: &[i32]) {
        self.history[..past.len()].copy_from_slice(past);
        self.known = past.len() / self.sizes.n_actors();
    }

    /// Completes the rows of a side's observations, in which the environment left zeros after its own
    /// features; `alive` are its units that are in the battle.
    pub(crate) fn write(&self, side: Faction, alive: &[u8], obs: &mut [f32]) {
        let Some(Sizes { n_agents, n_actions, obs_size, .. }) = self.sizes.of(side) else { return };
        let first = if side == Faction::Ally { 0 } else { self.sizes.n_agents };
        for (unit, row) in obs.chunks_exact_mut(obs.len() / n_agents).enumerate() {
            if alive[unit] == 0 {
                continue;
            }
            let (past, id) = row[obs_size..].split_at_mut(self.last_actions * n_actions);
            let joint_actions = self.history.chunks_exact(self.sizes.n_actors()).take(self.known);
            for (one_hot, actions) in past.chunks_exact_mut(n_actions).zip(joint_actions) {
                one_hot[actions[first + unit] as usize] = 1.0;
            }
            if self.agent_id {
                id[unit] = 1.0;
            }
        }
    }
}
