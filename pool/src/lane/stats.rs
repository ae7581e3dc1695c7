//! Statistics of a lane.

use serde::{Deserialize, Serialize};
use smaclite_engine::Step;
use std::sync::atomic::{AtomicI64, AtomicU64, Ordering};
use std::time::Duration;

/// Counts of a lane since its pool started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LaneStats {
    /// Steps of single environments, without resets.
    pub steps: u64,
    /// Episodes that ended.
    pub episodes: u64,
    /// Episodes that the agents won.
    pub wins: u64,
    /// Sum of the returns of the episodes that ended, to the millionth.
    pub returns: f64,
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
    pub(crate) returns: f64,
}

impl StepCounts {
    /// Counts a step, after which the return of the episode is `episode_return`.
    #[inline]
    pub(crate) fn count(&mut self, step: &Step, episode_return: f64) {
        self.steps += 1;
        if step.terminated || step.truncated {
            self.episodes += 1;
            self.wins += u64::from(step.battle_won);
            self.returns += episode_return;
        }
    }
}

const MILLION: f64 = 1e6;

/// The counts while workers add to them.
#[derive(Default)]
pub(super) struct Counters {
    steps: AtomicU64,
    episodes: AtomicU64,
    wins: AtomicU64,
    /// In millionths: atomic sums are of whole numbers.
    returns: AtomicI64,
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
            returns: self.returns.load(Ordering::Relaxed) as f64 / MILLION,
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
        if counts.episodes > 0 {
            self.returns.fetch_add((counts.returns * MILLION).round() as i64, Ordering::Relaxed);
        }
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
