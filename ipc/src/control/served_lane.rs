//! A lane as the control thread sees it: who uses it, and its rates.

use super::protocol::{LaneDescription, LaneStatus};
use smaclite_engine::Faction;
use smaclite_engine::policy::Tactic;
use smaclite_pool::LaneStats;
use smaclite_scenarios::ScenarioFiles;
use std::time::Instant;

/// A learner of a lane, or of one side of it.
pub(super) struct AttachedLearner {
    pub(super) pid: u32,
    pub(super) side: Option<Faction>,
    pub(super) session: u64,
    /// Its ports are connected: from now on the other learner depends on it.
    pub(super) is_connected: bool,
    /// What plays the other side when its learner leaves.
    pub(super) on_leave: Option<Tactic>,
}

/// A lane as the control thread sees it.
pub(crate) struct ServedLane {
    pub(crate) description: LaneDescription,
    /// The scenario of its battles.
    pub(super) files: ScenarioFiles,
    /// Its learner or those of its sides.
    pub(super) learners: Vec<AttachedLearner>,
    /// One of two learners left: the other must leave before a new session begins.
    pub(super) is_session_over: bool,
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
            learners: Vec::new(),
            is_session_over: false,
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
            learner_pid: self.pid_of(None).or(self.pid_of(Some(Faction::Ally))),
            enemy_learner_pid: self.pid_of(Some(Faction::Enemy)),
            missing_side: self.missing_side(),
            spectators: self.spectators,
            stats,
            steps_per_s: self.steps_per_s,
            queue_wait_us: self.queue_wait_us,
            failure: failure.map(str::to_owned),
        }
    }

    fn pid_of(&self, side: Option<Faction>) -> Option<u32> {
        self.learners.iter().find(|learner| learner.side == side).map(|learner| learner.pid)
    }

    /// The side whose learner has not come, while that of the other side waits for it.
    pub(super) fn missing_side(&self) -> Option<Faction> {
        match &self.learners[..] {
            [only] if !self.is_session_over => only.side.map(Faction::opponent),
            _ => None,
        }
    }

    /// The learner that stands in the way of one for this side.
    pub(super) fn rival(&self, side: Option<Faction>) -> Option<u32> {
        let is_rival = |learner: &&AttachedLearner| {
            self.is_session_over || side.is_none() || learner.side.is_none() || learner.side == side
        };
        self.learners.iter().find(is_rival).map(|learner| learner.pid)
    }

    /// Whether it can have a learner for each side.
    pub(super) fn has_sides(&self) -> bool {
        self.description.sides.are_both() && self.description.settings.is_synchronous()
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
