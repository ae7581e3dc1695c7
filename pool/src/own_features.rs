//! What can be appended to the observations of units: their own last actions and their own number. A lane
//! says what its agents see of that, and a team that plays the enemies sees what it saw in its training.
//!
//! A row of `obs` then has the features of the environment, the last K actions as one-hot vectors of
//! `n_actions`, the newest first, and the number as a one-hot vector of `n_agents`. Actions from before the
//! episode are zeros, and so is the whole row of a dead agent.

use crate::joint_action::JointAction;
use crate::lane_settings::LaneSettings;
use smaclite_engine::{Faction, Sizes};

/// What is appended to the observations of one environment.
pub(crate) struct OwnFeatures {
    /// Of the environment, without what is appended.
    sizes: Sizes,
    /// The joint actions of the last steps, `[n_past, n_actors]`, the newest first.
    history: Vec<i32>,
    /// How many of them are of this episode, from the first on.
    known: usize,
    n_past: usize,
    /// What the learner sees.
    pub(crate) appended: Appended,
}

/// What is appended to each row of observations.
#[derive(Clone, Copy)]
pub(crate) struct Appended {
    pub(crate) last_actions: usize,
    pub(crate) agent_id: bool,
}

impl OwnFeatures {
    /// `None` if nothing is appended.
    pub(crate) fn new(settings: &LaneSettings, sizes: Sizes) -> Option<Box<OwnFeatures>> {
        let LaneSettings { obs_last_actions: last_actions, obs_agent_id: agent_id, .. } = *settings;
        let n_past = settings.n_past();
        (n_past > 0 || agent_id).then(|| {
            let history = vec![0; n_past * sizes.n_actors()];
            let appended = Appended { last_actions, agent_id };
            Box::new(OwnFeatures { sizes, history, known: 0, n_past, appended })
        })
    }

    /// Begins an episode.
    pub(crate) fn reset(&mut self) {
        self.known = 0;
    }

    /// A step was made with this joint action.
    pub(crate) fn step(&mut self, actions: JointAction<'_>) {
        if self.n_past > 0 {
            self.history.rotate_right(self.sizes.n_actors());
            self.history.iter_mut().zip(actions.iter()).for_each(|(newest, action)| *newest = action);
            self.known = (self.known + 1).min(self.n_past);
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
    pub(crate) fn write(&self, appended: Appended, side: Faction, alive: &[u8], obs: &mut [f32]) {
        let Some(Sizes { n_agents, n_actions, obs_size, .. }) = self.sizes.of(side) else { return };
        let first = if side == Faction::Ally { 0 } else { self.sizes.n_agents };
        for (unit, row) in obs.chunks_exact_mut(obs.len() / n_agents).enumerate() {
            if alive[unit] == 0 {
                continue;
            }
            let (past, id) = row[obs_size..].split_at_mut(appended.last_actions * n_actions);
            let joint_actions = self.history.chunks_exact(self.sizes.n_actors()).take(self.known);
            for (one_hot, actions) in past.chunks_exact_mut(n_actions).zip(joint_actions) {
                one_hot[actions[first + unit] as usize] = 1.0;
            }
            if appended.agent_id {
                id[unit] = 1.0;
            }
        }
    }
}
