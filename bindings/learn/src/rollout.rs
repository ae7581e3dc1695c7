//! The data of one update: `horizon` steps of every environment, step after step, in one array per field.
//!
//! A *seat* is a side of an environment that is learnt from. The allies of all environments come first; if
//! the team plays both sides, the enemies of all environments follow.

use crate::config::{Algorithm, Config, Enemies, SelfPlay};
use crate::math::WIDTH;
use serde::{Deserialize, Serialize};
use smaclite_engine::{Faction, Sizes};
use std::ops::Range;

/// An episode that ended.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Episode {
    /// The sum of its rewards.
    pub episode_return: f32,
    /// Its steps.
    pub length: i32,
    /// Whether the agents won.
    pub won: bool,
}

/// Who played the enemies of an episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Against {
    Script = 0,
    /// The team that is trained.
    Own = 1,
    /// A team that does not learn.
    Rival = 2,
}

/// An episode of a run that ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ended {
    pub episode: Episode,
    pub against: Against,
}

/// One of the newest episodes of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Recent {
    pub ended: Ended,
    /// The number of its map.
    pub map: u64,
}

/// What happened in `horizon` steps; a sample is a seat in one of them.
#[derive(Debug)]
pub(crate) struct Rollout {
    pub horizon: usize,
    pub num_envs: usize,
    /// The sides that are learnt from.
    pub sides: &'static [Faction],
    /// A side learns from what it earns less what the other side earns.
    is_zero_sum: bool,
    pub num_seats: usize,
    /// As the units of either side have them.
    pub sizes: Sizes,
    /// `n_actions`, padded.
    pub padded_actions: usize,
    /// `[horizon + 1, num_seats, n_agents, obs_size]`.
    pub obs: Vec<f32>,
    /// `[horizon + 1, num_seats, state_size]`; empty if the critic does not see the state.
    pub state: Vec<f32>,
    /// `[horizon, num_seats, n_agents, padded_actions]`.
    pub masks: Vec<u8>,
    /// `[horizon, num_seats, n_agents]`.
    pub actions: Vec<u16>,
    /// `[horizon, num_seats, n_agents]`.
    pub log_probs: Vec<f32>,
    /// `[horizon, num_seats]`, as the following three.
    pub rewards: Vec<f32>,
    pub terminated: Vec<bool>,
    pub truncated: Vec<bool>,
    /// Nothing is learnt from the sample: the step only reset the environment, as next-step autoreset ignores
    /// its actions, or others played the seat.
    pub is_skipped: Vec<bool>,
    /// The episodes that ended, by step and environment.
    pub episodes: Vec<Ended>,
}

impl Rollout {
    pub fn new(config: &Config, sizes: Sizes) -> Rollout {
        let Config { horizon, num_envs, .. } = *config;
        let (sides, is_zero_sum): (&[Faction], bool) = match config.enemies {
            Enemies::SelfPlay(SelfPlay { zero_sum, .. }) => (&[Faction::Ally, Faction::Enemy], zero_sum),
            Enemies::Scripts | Enemies::Team { .. } => (&[Faction::Ally], false),
        };
        let num_seats = num_envs * sides.len();
        let padded_actions = sizes.n_actions.next_multiple_of(WIDTH);
        let samples = horizon * num_seats;
        let rows = samples * sizes.n_agents;
        let sees_state = config.algorithm == Algorithm::Mappo;
        Rollout {
            horizon,
            num_envs,
            sides,
            is_zero_sum,
            num_seats,
            sizes,
            padded_actions,
            obs: vec![0.0; (horizon + 1) * num_seats * sizes.n_agents * sizes.obs_size],
            state: vec![0.0; if sees_state { (horizon + 1) * num_seats * sizes.state_size } else { 0 }],
            masks: vec![0; rows * padded_actions],
            actions: vec![0; rows],
            log_probs: vec![0.0; rows],
            rewards: vec![0.0; samples],
            terminated: vec![false; samples],
            truncated: vec![false; samples],
            is_skipped: vec![false; samples],
            episodes: Vec::new(),
        }
    }

    /// The number of the sample of a side of an environment.
    pub fn sample(&self, t: usize, side: Faction, env: usize) -> usize {
        t * self.num_seats + env + if side == Faction::Enemy { self.num_envs } else { 0 }
    }

    /// Where rewards are zero-sum: takes from each side's at time `t`, of these environments, the other's.
    pub fn balance_rewards(&mut self, t: usize, envs: Range<usize>) {
        if !self.is_zero_sum {
            return;
        }
        for env in envs {
            let [allies, enemies] = [Faction::Ally, Faction::Enemy].map(|side| self.sample(t, side, env));
            let balance = self.rewards[allies] - self.rewards[enemies];
            (self.rewards[allies], self.rewards[enemies]) = (balance, -balance);
        }
    }

    /// The sides that are learnt from, with their sizes in an environment with these.
    pub fn views(&self, sizes: Sizes) -> impl Iterator<Item = (Faction, Sizes)> + use<> {
        self.sides.iter().filter_map(move |side| Some((*side, sizes.of(*side)?)))
    }

    /// Environment steps that were not resets.
    pub fn steps(&self) -> u64 {
        let of_allies = self.is_skipped.chunks(self.num_seats).flat_map(|step| &step[..self.num_envs]);
        of_allies.filter(|is_skipped| !**is_skipped).count() as u64
    }

    /// The samples from which something can be learnt.
    pub fn samples(&self) -> Vec<u32> {
        let samples = 0..self.rewards.len();
        samples.filter(|sample| !self.is_skipped[*sample]).map(|sample| sample as u32).collect()
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
    use crate::config::SelfPlay;
    use smaclite_engine::EnemySizes;

    #[test]
    fn resets_and_agents_without_a_choice_are_not_learnt() {
        let sizes = Sizes { n_agents: 2, n_actions: 7, obs_size: 1, state_size: 1, ..Sizes::default() };
        let config = Config { horizon: 2, num_envs: 1, ..Config::for_agents(3) };
        let mut rollout = Rollout::new(&config, sizes);
        rollout.masks[..5].fill(1); // step 0, agent 0
        rollout.masks[8] = 1; // step 0, agent 1: one action
        rollout.masks[16..].fill(1); // step 1, both
        assert_eq!(rollout.policy_rows(&rollout.samples()), [0, 2, 3]);
        assert!(rows(&rollout.samples(), 2).eq(0..4));
        rollout.is_skipped[1] = true;
        assert_eq!((rollout.samples(), rollout.steps()), (vec![0], 1));
        assert_eq!(rollout.policy_rows(&rollout.samples()), [0]);
    }

    /// In each step the rewards of the allies of all environments precede those of their enemies.
    #[test]
    fn zero_sum_rewards_are_what_a_side_earned_less_what_the_other_did() {
        for zero_sum in [false, true] {
            let enemies = Enemies::SelfPlay(SelfPlay { zero_sum, ..SelfPlay::ALONE });
            let config = Config { horizon: 2, num_envs: 3, enemies, ..Config::for_agents(3) };
            let mut rollout = Rollout::new(&config, Sizes { n_agents: 1, ..Sizes::default() });
            let earned = [9., 9., 9., 9., 9., 9., 1., 2., 3., 4., 8., 2.5];
            rollout.rewards.copy_from_slice(&earned);
            rollout.balance_rewards(1, 0..2);
            let mut expected = earned;
            if zero_sum {
                (expected[6], expected[9], expected[7], expected[10]) = (-3., 3., -6., 6.);
            }
            assert_eq!(rollout.rewards, expected);
        }
    }

    /// The steps of an environment count once, whoever learns from them.
    #[test]
    fn enemies_have_seats_behind_those_of_allies() {
        let enemies = Some(EnemySizes { n_actions: 7, obs_size: 1, state_size: 1 });
        let sizes = Sizes { n_agents: 1, n_actions: 7, obs_size: 1, state_size: 1, ..Sizes::default() };
        let sizes = Sizes { n_enemies: 1, enemies, ..sizes };
        let enemies = Enemies::SelfPlay(SelfPlay::LEAGUE);
        let config = Config { horizon: 2, num_envs: 3, enemies, ..Config::for_agents(3) };
        let mut rollout = Rollout::new(&config, sizes);
        assert_eq!(rollout.views(sizes).map(|(side, _)| side).collect::<Vec<_>>(), rollout.sides);
        assert_eq!((rollout.sample(1, Faction::Ally, 2), rollout.sample(1, Faction::Enemy, 2)), (8, 11));
        rollout.is_skipped[8] = true; // a reset: both sides
        rollout.is_skipped[11] = true;
        rollout.is_skipped[4] = true; // others play these enemies
        assert_eq!((rollout.steps(), rollout.samples()), (5, vec![0, 1, 2, 3, 5, 6, 7, 9, 10]));
    }
}
