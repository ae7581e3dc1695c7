//! The policies whose steps are measured.

use clap::ValueEnum;
use serde::Serialize;
use smaclite_engine::{Arena, policy};
use smaclite_lab::{ActionTrace, AfterEpisode};
use std::sync::Arc;

/// How the agents choose their actions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Policy {
    /// Move to the nearest enemy and attack it; healers heal. Recorded before the measurement
    Nearest,
    /// Uniformly random available actions. Recorded before the measurement
    Random,
    /// Uniformly random available actions, sampled by the learner during the measurement (recorded as
    /// `random` in the mode `engine`, which has no learner)
    Sampled,
}

impl Policy {
    /// The name that is typed on the command line.
    pub fn name(self) -> String {
        self.to_possible_value().map_or(String::new(), |value| value.get_name().to_owned())
    }

    /// The actions of the policy in `length` steps of a battle with this seed.
    pub fn record(
        self,
        arena: &Arc<Arena>,
        seed: u64,
        length: usize,
        after_episode: AfterEpisode,
    ) -> ActionTrace {
        let mut random = policy::Random::new(seed);
        ActionTrace::new(arena, seed, length, after_episode, |battle, actions| match self {
            Policy::Nearest => policy::nearest(battle, actions),
            Policy::Random | Policy::Sampled => random.act(battle, actions),
        })
    }
}
