//! What a lane counts.

use crate::hosted_env::StepCounts;
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// A lane's figures since it began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LaneStats {
    /// Steps of single environments; resets do not count.
    pub steps: u64,
    /// Episodes that ended.
    pub episodes: u64,
    /// Episodes that the agents won.
    pub wins: u64,
    /// Frames sent.
    pub frames: u64,
    /// Requests refused.
    pub rejected: u64,
    /// Requests accepted.
    pub accepted: u64,
    /// Nanoseconds that the accepted requests waited for a worker, summed.
    pub waited_ns: u64,
}

/// The figures while workers add to them.
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

    pub(super) fn sent(&self) {
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
