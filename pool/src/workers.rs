//! The worker threads: lead or follow, take a run of environments, serve it. See `leader_followers` for who waits where.

use crate::lane::{Entry, Lane, LaneSpec, LaneStats, panic_text};
use crate::leader_followers::{Leadership, WaitStrategy, Wakeup, WorkQueues};
use crate::transport::{Doorbell, Transport};
use smaclite_engine::Scratch;
use std::io::Error;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Environments a worker takes at a time: enough that queueing costs nothing, few enough that lanes take turns.
const RUN: usize = 16;

/// A blocked leader looks around this often even if nobody rings.
const CHECK_INTERVAL: Duration = Duration::from_millis(100);

/// How a pool runs.
#[derive(Clone, Copy, Debug)]
pub struct PoolOptions {
    /// Worker threads, at least 1.
    pub threads: usize,
    /// How idle workers wait.
    pub wait: WaitStrategy,
}

impl Default for PoolOptions {
    /// As many threads as this process may use, less one for the learner.
    fn default() -> Self {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        PoolOptions { threads: (cores - 1).max(1), wait: WaitStrategy::default() }
    }
}

/// Lanes and the threads that serve them. Dropping it stops the threads.
pub struct Pool<T: Transport> {
    shared: Arc<Shared<T>>,
    threads: Vec<JoinHandle<()>>,
}

struct Shared<T: Transport> {
    lanes: Vec<Lane<T>>,
    queues: WorkQueues<Entry>,
    doorbell: T::Doorbell,
    /// For how long idle workers look for work before they block.
    spin: Option<Duration>,
}

impl<T: Transport> Pool<T> {
    /// Builds the lanes and starts the threads; an error is the operating system's refusal of a thread, or
    /// the transport's of a lane's first frame.
    pub fn start(
        lanes: Vec<(LaneSpec, T::Inlet, T::Outlet)>,
        doorbell: T::Doorbell,
        options: PoolOptions,
    ) -> std::io::Result<Pool<T>> {
        let lanes = lanes.into_iter().map(|(spec, i, o)| Lane::new(&spec, i, o).map_err(Error::other));
        let lanes = lanes.collect::<std::io::Result<Vec<_>>>()?;
        let threads = options.threads.max(1);
        let queues = WorkQueues::new(threads, lanes.len());
        let spin = options.wait.spin_time(threads);
        let shared = Arc::new(Shared { lanes, queues, doorbell, spin });
        let mut pool = Pool { shared, threads: Vec::new() };
        for worker in 0..threads {
            let shared = Arc::clone(&pool.shared);
            let thread = std::thread::Builder::new().name(format!("smaclite-{worker}"));
            pool.threads.push(thread.spawn(move || shared.work(worker))?);
        }
        Ok(pool)
    }

    /// From now on lane `lane` serves requests of `session` (or nobody's), beginning with a reset.
    pub fn set_session(&self, lane: usize, session: Option<u64>) {
        self.shared.lanes[lane].set_session(session);
    }

    /// A lane's figures.
    pub fn stats(&self, lane: usize) -> LaneStats {
        self.shared.lanes[lane].stats()
    }

    /// Why a lane is out of service, if it is.
    pub fn failure(&self, lane: usize) -> Option<&str> {
        self.shared.lanes[lane].failure()
    }

    /// Ends the threads after the runs they are at.
    pub fn stop(&mut self) {
        self.shared.queues.stop();
        self.shared.doorbell.ring();
        for thread in self.threads.drain(..) {
            // A worker catches panics of its lanes; should one die all the same there is nobody left to tell.
            let _ = thread.join();
        }
    }
}

impl<T: Transport> Drop for Pool<T> {
    fn drop(&mut self) {
        self.stop();
    }
}

impl<T: Transport> Shared<T> {
    fn work(&self, worker: usize) {
        let mut scratch = Scratch::new();
        let mut run = Vec::with_capacity(RUN);
        while !self.queues.is_stopped() {
            run.clear();
            if let Some(lane) = self.queues.take(worker, RUN, &mut run) {
                self.lanes[lane].serve(&run, &mut scratch);
                continue;
            }
            match self.queues.wait_for_work(worker, self.spin) {
                Wakeup::Work => {}
                Wakeup::Leading(leadership) => self.lead(worker, leadership),
            }
        }
    }

    /// Polls the lanes and shares requests out until this worker has work itself.
    fn lead(&self, worker: usize, leadership: Leadership<'_>) {
        let spin_until = || self.spin.map(|time| Instant::now() + time);
        let mut end = spin_until();
        while !self.queues.has_work(worker) && !self.queues.is_stopped() {
            if self.accept_all() {
                end = spin_until();
            } else if end.is_some_and(|end| Instant::now() >= end) {
                self.doorbell.wait(CHECK_INTERVAL);
                end = spin_until();
            } else {
                std::thread::yield_now();
            }
        }
        self.queues.release(leadership);
    }

    /// Accepts every request that waits; was there one?
    fn accept_all(&self) -> bool {
        let mut any = false;
        for (index, lane) in self.lanes.iter().enumerate() {
            let accepted =
                catch_unwind(AssertUnwindSafe(|| lane.accept(|entries| self.share_out(index, entries))));
            any |= accepted.unwrap_or_else(|panic| {
                lane.fail(panic_text(panic.as_ref()));
                false
            });
        }
        any
    }

    /// Every environment has a worker it stays with, by its number: neighbours share one, so a batch is one run of
    /// entries a worker. Lanes begin at different workers, so that small ones do not all meet at the first.
    fn share_out(&self, lane: usize, entries: &[Entry]) {
        let workers = self.queues.workers();
        let num_envs = self.lanes[lane].num_envs();
        let owner = |entry: &Entry| (entry.env as usize * workers / num_envs + lane) % workers;
        for worker in 0..workers {
            self.queues.push(worker, lane, entries.iter().filter(|e| owner(e) == worker).copied());
        }
    }
}
