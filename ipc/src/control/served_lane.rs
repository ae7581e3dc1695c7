//! A lane as the control thread sees it: who uses it, and its rates.

use super::protocol::{LaneDescription, LaneStatus};
use smaclite_pool::LaneStats;
use smaclite_scenarios::ScenarioFiles;
use std::time::Instant;

/// A lane as the control thread sees it.
pub(crate) struct ServedLane {
    pub(crate) description: LaneDescription,
    /// The scenario of its battles.
    pub(super) files: ScenarioFiles,
    /// The process of its learner.
    pub(super) learner_pid: Option<u32>,
    pub(super) spectators: usize,
    pub(super) followers: usize,
    /// The number of the next follower.
    pub(super) next_follower: u64,
    /// Statistics and time of the last measurement, for the rates.
    seen: (LaneStats, Instant),
    steps_per_s: f64,
    queue_wait_us: f64,
}

impl ServedLane {
    pub(crate) fn new(description: LaneDescription, files: ScenarioFiles) -> Self {
        ServedLane {
            description,
            files,
            learner_pid: None,
            spectators: 0,
            followers: 0,
            next_follower: 0,
            seen: (LaneStats::default(), Instant::now()),
            steps_per_s: 0.0,
            queue_wait_us: 0.0,
        }
    }

    pub(super) fn status(&self, stats: LaneStats, failure: Option<&str>) -> LaneStatus {
        LaneStatus {
            description: self.description.clone(),
            learner_pid: self.learner_pid,
            spectators: self.spectators,
            stats,
            steps_per_s: self.steps_per_s,
            queue_wait_us: self.queue_wait_us,
            failure: failure.map(str::to_owned),
        }
    }

    /// Refreshes the rates once a second.
    pub(super) fn measure(&mut self, now: LaneStats) {
        let (before, since) = self.seen;
        let seconds = since.elapsed().as_secs_f64();
        if seconds >= 1.0 {
            self.steps_per_s = (now.steps - before.steps) as f64 / seconds;
            let requests = (now.accepted - before.accepted).max(1);
            self.queue_wait_us = (now.waited_ns - before.waited_ns) as f64 / 1e3 / requests as f64;
            self.seen = (now, Instant::now());
        }
    }
}
