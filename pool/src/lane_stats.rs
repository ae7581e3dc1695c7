//! Statistics of a lane.

use serde::{Deserialize, Serialize};
use smaclite_engine::Step;

/// Counts of a lane since its pool started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LaneStats {
    /// Steps of single environments, without resets.
    pub steps: u64,
    /// Episodes that ended.
    pub episodes: u64,
    /// Episodes that the agents won.
    pub wins: u64,
    /// Sum of the returns of the episodes that ended.
    pub returns: f64,
    /// Sum of their lengths, in steps.
    pub lengths: u64,
    /// Frames published with a batch.
    pub frames: u64,
    /// Refused requests.
    pub rejected: u64,
    /// Accepted requests.
    pub accepted: u64,
    /// Total time in nanoseconds that accepted requests waited until they were received.
    pub waited_ns: u64,
}

impl LaneStats {
    /// Counts a step, after which the episode has this return and length.
    #[inline]
    pub(crate) fn count(&mut self, step: &Step, episode_return: f64, episode_length: u32) {
        self.steps += 1;
        if step.terminated || step.truncated {
            self.episodes += 1;
            self.wins += u64::from(step.battle_won);
            self.returns += episode_return;
            self.lengths += u64::from(episode_length);
        }
    }

    /// Adds the steps that a thread counted.
    pub(crate) fn add(&mut self, steps: &LaneStats) {
        self.steps += steps.steps;
        self.episodes += steps.episodes;
        self.wins += steps.wins;
        self.returns += steps.returns;
        self.lengths += steps.lengths;
    }
}
