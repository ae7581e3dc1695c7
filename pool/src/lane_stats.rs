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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn returns_lengths_and_wins_are_those_of_episodes_that_ended() {
        let goes_on = Step::default();
        let lost = Step { terminated: true, ..Step::default() };
        let won = Step { battle_won: true, ..lost };
        let too_long = Step { truncated: true, ..Step::default() };
        let mut of_thread = LaneStats::default();
        for (step, episode_return, length) in [(goes_on, 1.0, 1), (lost, 2.0, 2), (won, 20.0, 7)] {
            of_thread.count(&step, episode_return, length);
        }
        of_thread.count(&too_long, 3.5, 60);
        let counted =
            LaneStats { steps: 4, episodes: 3, wins: 1, returns: 25.5, lengths: 69, ..LaneStats::default() };
        assert_eq!(of_thread, counted);

        let mut of_lane = LaneStats { frames: 5, rejected: 6, accepted: 7, waited_ns: 8, ..counted };
        of_lane.add(&of_thread);
        let sum = LaneStats { steps: 8, episodes: 6, wins: 2, returns: 51.0, lengths: 138, ..of_lane };
        assert_eq!(of_lane, sum);
        assert_eq!((of_lane.frames, of_lane.rejected, of_lane.accepted, of_lane.waited_ns), (5, 6, 7, 8));
    }
}
