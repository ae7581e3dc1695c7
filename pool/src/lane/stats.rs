//! Statistics of a lane.

use serde::{Deserialize, Serialize};
use smaclite_engine::Step;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Counts of a lane since its pool started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LaneStats {
    /// Steps of single environments, without resets.
    pub steps: u64,
    /// Episodes that ended.
    pub episodes: u64,
    /// Episodes that the agents won.
    pub wins: u64,
    /// Frames published with a batch.
    pub frames: u64,
    /// Refused requests.
    pub rejected: u64,
    /// Accepted requests.
    pub accepted: u64,
    /// Total time in nanoseconds that accepted requests waited for a worker.
    pub waited_ns: u64,
}

/// What a worker's run of environments adds to a lane's statistics.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct StepCounts {
    pub(crate) steps: u64,
    pub(crate) episodes: u64,
    pub(crate) wins: u64,
}

impl StepCounts {
    pub(crate) fn count(&mut self, step: Option<Step>) {
        if let Some(step) = step {
            self.steps += 1;
            self.episodes += u64::from(step.terminated || step.truncated);
            self.wins += u64::from(step.battle_won);
        }
    }
}

/// The counts while workers add to them.
#[derive(Default)]
pub(super) struct Counters {
    steps: AtomicU64,
    episodes: AtomicU64,
    wins: AtomicU64,
    frames: AtomicU64,
    rejected: AtomicU64,
    accepted: AtomicU64,
    waited_ns: AtomicU64,
}

impl Counters {
    pub(super) fn read(&self) -> LaneStats {
        let read = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        LaneStats {
            steps: read(&self.steps),
            episodes: read(&self.episodes),
            wins: read(&self.wins),
            frames: read(&self.frames),
            rejected: read(&self.rejected),
            accepted: read(&self.accepted),
            waited_ns: read(&self.waited_ns),
        }
    }

    pub(super) fn stepped(&self, counts: &StepCounts) {
        add(&self.steps, counts.steps);
        add(&self.episodes, counts.episodes);
        add(&self.wins, counts.wins);
    }

    pub(super) fn published(&self) {
        add(&self.frames, 1);
    }

    pub(super) fn rejected(&self) {
        add(&self.rejected, 1);
    }

    pub(super) fn accepted(&self, waited: Duration) {
        add(&self.accepted, 1);
        add(&self.waited_ns, waited.as_nanos() as u64);
    }
}

fn add(counter: &AtomicU64, n: u64) {
    counter.fetch_add(n, Ordering::Relaxed);
}
