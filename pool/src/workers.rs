//! The worker threads. A worker takes a run of its environments and serves it; an idle one leads or follows
//! (`leader_followers`).

use crate::episode_log::{EpisodePart, LogCursor};
use crate::lane::{Entry, Lane, LaneSpec, LaneStats, Received, panic_text};
use crate::leader_followers::{Leadership, Wakeup, WorkQueues};
use crate::transport::{Doorbell, SessionId, Transport, TransportError};
use crate::wait_strategy::WaitStrategy;
use smaclite_engine::Scratch;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Environments that a worker takes at a time: enough to make queueing cheap, few enough that lanes take
/// turns.
const RUN: usize = 16;

/// A blocked leader polls the lanes at least this often, even without a ring.
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
    /// One thread per core that this process may use, less one for the learner.
    fn default() -> Self {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        PoolOptions { threads: (cores - 1).max(1), wait: WaitStrategy::default() }
    }
}

/// Why a pool did not start.
#[derive(Debug, thiserror::Error)]
pub enum PoolStartError {
    /// A lane's transport has no frame.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// The operating system refused a thread.
    #[error("cannot start a worker thread: {0}")]
    Thread(#[source] std::io::Error),
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
    /// How long idle workers poll for work before they block; `None` is without end.
    spin: Option<Duration>,
}

impl<T: Transport> Pool<T> {
    /// Builds the lanes and starts the threads.
    pub fn start(
        lanes: Vec<(LaneSpec, T::Inlet, T::Outlet)>,
        doorbell: T::Doorbell,
        options: PoolOptions,
    ) -> Result<Pool<T>, PoolStartError> {
        let lanes = lanes.into_iter().map(|(spec, inlet, outlet)| Lane::new(&spec, inlet, outlet));
        let lanes = lanes.collect::<Result<Vec<_>, _>>()?;
        let threads = options.threads.max(1);
        let queues = WorkQueues::new(threads, lanes.len());
        let spin = options.wait.spin_time(threads);
        let shared = Arc::new(Shared { lanes, queues, doorbell, spin });
        let mut pool = Pool { shared, threads: Vec::new() };
        for worker in 0..threads {
            let shared = Arc::clone(&pool.shared);
            let thread = std::thread::Builder::new().name(format!("smaclite-{worker}"));
            pool.threads.push(thread.spawn(move || shared.work(worker)).map_err(PoolStartError::Thread)?);
        }
        Ok(pool)
    }

    /// Makes lane `lane` serve the requests of `session`, beginning with a reset; `None` is no learner.
    pub fn set_session(&self, lane: usize, session: Option<SessionId>) {
        self.shared.lanes[lane].set_session(session);
    }

    /// Adds a follower to an environment, which from now on keeps a log of its episodes; `false` if the
    /// environment cannot be followed.
    ///
    /// # Panics
    /// If there is no such lane or environment.
    pub fn follow(&self, lane: usize, env: usize) -> bool {
        self.shared.lanes[lane].follow(env)
    }

    /// Removes a follower of an environment.
    ///
    /// # Panics
    /// As [`follow`](Pool::follow).
    pub fn unfollow(&self, lane: usize, env: usize) {
        self.shared.lanes[lane].unfollow(env);
    }

    /// What a followed environment did since `cursor`, which moves on.
    ///
    /// # Panics
    /// As [`follow`](Pool::follow).
    pub fn read_log(&self, lane: usize, env: usize, cursor: &mut LogCursor) -> Vec<EpisodePart> {
        self.shared.lanes[lane].read_log(env, cursor)
    }

    /// A lane's statistics.
    pub fn stats(&self, lane: usize) -> LaneStats {
        self.shared.lanes[lane].stats()
    }

    /// Why lane `lane` failed, if it did.
    pub fn failure(&self, lane: usize) -> Option<&str> {
        self.shared.lanes[lane].failure()
    }

    /// Ends the threads after their present runs.
    pub fn stop(&mut self) {
        self.shared.queues.stop();
        self.shared.doorbell.ring();
        for thread in self.threads.drain(..) {
            // A worker catches the panics of its lanes. If it panics all the same, its pool ends here anyway.
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

    /// Accepts the next request of every lane. Returns whether there was one.
    fn accept_all(&self) -> bool {
        let mut any = false;
        for (index, lane) in self.lanes.iter().enumerate() {
            match catch_unwind(AssertUnwindSafe(|| lane.accept())) {
                Ok(Received::Nothing) => {}
                Ok(Received::Refused) => any = true,
                Ok(Received::Accepted(entries)) => {
                    any = true;
                    self.share_out(index, &entries);
                }
                Err(panic) => lane.fail(panic_text(panic.as_ref())),
            }
        }
        any
    }

    /// Puts each entry into the queue of its environment's worker. Neighbouring environments share a worker,
    /// so a request in order is one run of entries per worker. Lanes begin at different workers, so that the
    /// only environments of several small lanes do not all belong to the first one.
    fn share_out(&self, lane: usize, entries: &[Entry]) {
        let workers = self.queues.workers();
        let num_envs = self.lanes[lane].num_envs();
        let worker_of = |entry: &Entry| (entry.env as usize * workers / num_envs + lane) % workers;
        for run in entries.chunk_by(|a, b| worker_of(a) == worker_of(b)) {
            self.queues.push(worker_of(&run[0]), lane, run);
        }
    }
}
