//! What a lane must append to observations, computed from the list of all actions of an episode.

use crate::LanePlan;

/// The actions of an environment's episode so far.
#[derive(Clone)]
pub(crate) struct OwnFeatures {
    last_actions: usize,
    agent_id: bool,
    episode: Vec<Vec<i32>>,
}

impl OwnFeatures {
    pub fn new(plan: &LanePlan) -> OwnFeatures {
        let (last_actions, agent_id) = (plan.obs_last_actions, plan.obs_agent_id);
        OwnFeatures { last_actions, agent_id, episode: Vec::new() }
    }

    /// The joint actions that a lane keeps, the newest first.
    pub fn past_actions(&self) -> Vec<i32> {
        self.episode.iter().rev().take(self.last_actions).flatten().copied().collect()
    }

    /// How many joint actions a lane keeps.
    pub fn n_past(&self) -> usize {
        self.last_actions
    }

    pub fn reset(&mut self) {
        self.episode.clear();
    }

    pub fn step(&mut self, actions: &[i32]) {
        self.episode.push(actions.to_vec());
    }

    /// The observations of all units of a side with what is appended to them; the actions of the first are at
    /// this place of joint actions.
    pub fn append_to(&self, obs: &[f32], alive: &[u8], n_actions: usize, first: usize) -> Vec<f32> {
        let n_agents = alive.len();
        let mut out = Vec::new();
        for (agent, features) in obs.chunks(obs.len() / n_agents).enumerate() {
            out.extend(features);
            let is_alive = alive[agent] == 1;
            for steps_ago in 1..=self.last_actions {
                let step = self.episode.len().checked_sub(steps_ago);
                let action = step.map(|step| self.episode[step][first + agent]).filter(|_| is_alive);
                out.extend((0..n_actions as i32).map(|i| f32::from(u8::from(action == Some(i)))));
            }
            if self.agent_id {
                out.extend((0..n_agents).map(|i| f32::from(u8::from(is_alive && i == agent))));
            }
        }
        out
    }
}
