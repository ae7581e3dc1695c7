//! The worker threads. A worker takes a run of environments and serves it; an idle one leads or follows
//! (`leader_followers`). A learner's thread of this process works among them while it waits (`Helper`).

use crate::episode_log::{EpisodePart, LogCursor};
use crate::lane::{Entry, Lane, LaneSpec, LaneStats, RUN, Received, panic_text};
use crate::leader_followers::{Leadership, Ring, Wakeup, WorkQueues};
use crate::transport::{Doorbell, SessionId, Transport, TransportError};
use crate::wait_strategy::{Polling, WaitStrategy};
use smaclite_engine::Scratch;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Weak};
use std::thread::JoinHandle;
use std::time::Duration;

/// As [`RUN`], for a learner's thread while it serves another lane: its own batch may be ready meanwhile.
const GUEST_RUN: usize = 1;

/// A blocked leader polls the lanes at least this often, even without a ring.
const CHECK_INTERVAL: Duration = Duration::from_millis(100);

/// How often a pool that stops looks whether learners still help.
const LEAVING_INTERVAL: Duration = Duration::from_micros(50);

/// How a pool runs.
#[derive(Clone, Copy, Debug)]
pub struct PoolOptions {
    /// Threads that step environments, at least 1. While a learner of this process waits for a batch, its
    /// thread is one of them.
    pub threads: usize,
    /// How idle workers wait.
    pub wait: WaitStrategy,
}

impl Default for PoolOptions {
    /// One thread per core that this process may use, for learners of the process.
    fn default() -> Self {
        PoolOptions { threads: cores(), wait: WaitStrategy::default() }
    }
}

impl PoolOptions {
    /// One thread per core that this process may use, less one for a learner in another process.
    pub fn for_other_processes() -> PoolOptions {
        PoolOptions { threads: (cores() - 1).max(1), wait: WaitStrategy::default() }
    }
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
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
    /// `None` at the end of its drop.
    shared: Option<Arc<Shared<T>>>,
    threads: Vec<JoinHandle<()>>,
}

/// Learners of the process can help a pool by it, for as long as the pool runs.
pub struct PoolHandle<T: Transport>(Weak<Shared<T>>);

struct Shared<T: Transport> {
    lanes: Vec<Lane<T>>,
    /// The seat of each environment of each lane.
    seats: Vec<Vec<usize>>,
    queues: WorkQueues<Entry>,
    doorbell: T::Doorbell,
    /// How idle workers poll for work before they block.
    polling: Polling,
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
        let polling = options.wait.polling(threads);
        let seats = lanes.iter().enumerate().map(|(i, lane)| seats(i, lane.num_envs(), threads)).collect();
        let shared = Arc::new(Shared { lanes, seats, queues, doorbell, polling });
        let mut pool = Pool { shared: Some(Arc::clone(&shared)), threads: Vec::new() };
        for worker in 0..threads {
            let shared = Arc::clone(&shared);
            let thread = std::thread::Builder::new().name(format!("smaclite-{worker}"));
            pool.threads.push(thread.spawn(move || shared.work(worker)).map_err(PoolStartError::Thread)?);
        }
        Ok(pool)
    }

    fn shared(&self) -> &Arc<Shared<T>> {
        self.shared.as_ref().expect("only the drop takes it")
    }

    fn lane(&self, lane: usize) -> &Lane<T> {
        &self.shared().lanes[lane]
    }

    /// By which learners of this process help.
    pub fn handle(&self) -> PoolHandle<T> {
        PoolHandle(Arc::downgrade(self.shared()))
    }

    /// Makes lane `lane` serve the requests of `session`, beginning with a reset; `None` is no learner.
    pub fn set_session(&self, lane: usize, session: Option<SessionId>) {
        self.lane(lane).set_session(session);
    }

    /// Adds a follower to an environment, which from now on keeps a log of its episodes; `false` if the
    /// environment cannot be followed.
    ///
    /// # Panics
    /// If there is no such lane or environment.
    pub fn follow(&self, lane: usize, env: usize) -> bool {
        self.lane(lane).follow(env)
    }

    /// Removes a follower of an environment.
    ///
    /// # Panics
    /// As [`follow`](Pool::follow).
    pub fn unfollow(&self, lane: usize, env: usize) {
        self.lane(lane).unfollow(env);
    }

    /// What a followed environment did since `cursor`, which moves on.
    ///
    /// # Panics
    /// As [`follow`](Pool::follow).
    pub fn read_log(&self, lane: usize, env: usize, cursor: &mut LogCursor) -> Vec<EpisodePart> {
        self.lane(lane).read_log(env, cursor)
    }

    /// A lane's statistics.
    pub fn stats(&self, lane: usize) -> LaneStats {
        self.lane(lane).stats()
    }

    /// Why lane `lane` failed, if it did.
    pub fn failure(&self, lane: usize) -> Option<&str> {
        self.lane(lane).failure()
    }

    /// Ends the threads after their present runs.
    pub fn stop(&mut self) {
        let shared = self.shared();
        shared.queues.stop();
        shared.doorbell.ring();
        for thread in self.threads.drain(..) {
            // A worker catches the panics of its lanes. If it panics all the same, its pool ends here anyway.
            let _ = thread.join();
        }
    }
}

/// The seat of each environment of a lane. Neighbouring environments share a seat. Lanes begin at different
/// seats, so that the only environments of several small lanes do not all belong to the first one.
fn seats(lane: usize, num_envs: usize, threads: usize) -> Vec<usize> {
    (0..num_envs).map(|env| (env * threads / num_envs + lane) % threads).collect()
}

impl<T: Transport> Drop for Pool<T> {
    fn drop(&mut self) {
        self.stop();
        // The lanes end here and not on a thread that helps: their ports must be closed before their node.
        let mut left = self.shared.take();
        while let Some(shared) = left {
            left = Arc::try_unwrap(shared).err();
            if left.is_some() {
                std::thread::sleep(LEAVING_INTERVAL); // a helper leaves after its present run
            }
        }
    }
}

impl<T: Transport> Shared<T> {
    fn work(&self, seat: usize) {
        let mut worker = Worker { seat, scratch: Scratch::new(), run: Vec::with_capacity(RUN) };
        while !self.queues.is_stopped() {
            if !self.queues.stands_down(seat) && self.serve_run(&mut worker, seat, None, RUN) {
                continue;
            }
            match self.queues.wait_for_work(seat, self.polling) {
                Wakeup::Work => {}
                Wakeup::Leading(leadership) => self.lead(seat, leadership),
            }
        }
    }

    /// Serves up to `most` environments of `lane`, or of any, from the inbox of `seat` or else of another;
    /// `false` if none are waiting.
    fn serve_run(&self, worker: &mut Worker, seat: usize, lane: Option<usize>, most: usize) -> bool {
        let Worker { scratch, run, .. } = worker;
        run.clear();
        let Some(lane) = self.queues.take(seat, lane, most, run) else { return false };
        self.lanes[lane].serve(run, scratch);
        true
    }

    /// Polls the lanes and shares requests out until this worker has work itself.
    fn lead(&self, worker: usize, leadership: Leadership<'_>) {
        let mut polls = self.polling.begin();
        while !self.queues.has_work_for(worker) && !self.queues.is_stopped() {
            if self.accept_all() {
                polls = self.polling.begin();
            } else if self.queues.stands_down(worker) || !polls.pause() {
                self.queues.sleep_at_the_door(worker, || self.doorbell.wait(CHECK_INTERVAL));
                polls = self.polling.begin();
            }
        }
        self.queues.release(leadership);
    }

    /// Accepts the next request of every lane that has no helper, which accepts its requests itself. Returns
    /// whether there was one.
    fn accept_all(&self) -> bool {
        let polled = (0..self.lanes.len()).filter(|lane| !self.lanes[*lane].has_helper());
        polled.fold(false, |any, lane| self.accept(lane) | any)
    }

    /// Accepts the next request of a lane. Returns whether there was one.
    fn accept(&self, index: usize) -> bool {
        let lane = &self.lanes[index];
        match catch_unwind(AssertUnwindSafe(|| lane.accept())) {
            Ok(Received::Nothing) => return false,
            Ok(Received::Refused) => {}
            Ok(Received::Accepted(entries)) => self.share_out(index, &entries),
            Err(panic) => {
                lane.fail(panic_text(panic.as_ref()));
                return false;
            }
        }
        true
    }

    /// Puts each entry into the inbox of its environment's seat; a request in order is one run of entries per
    /// seat.
    fn share_out(&self, lane: usize, entries: &[Entry]) {
        let seats = &self.seats[lane];
        let seat_of = |entry: &Entry| seats[entry.env as usize];
        for run in entries.chunk_by(|a, b| seat_of(a) == seat_of(b)) {
            self.ring(self.queues.push(seat_of(&run[0]), lane, run));
        }
    }

    fn ring(&self, ring: Ring) {
        if ring.0 {
            self.doorbell.ring();
        }
    }
}

/// A thread that serves runs of environments.
struct Worker {
    seat: usize,
    scratch: Scratch,
    run: Vec<Entry>,
}

impl<T: Transport> PoolHandle<T> {
    /// What a learner of lane `lane` needs to help. From now on, and until it is dropped or its session ends,
    /// only the helper accepts the lane's requests. `None` if the session is not the lane's or the pool ends.
    pub fn helper(&self, lane: usize, session: SessionId) -> Option<Helper<T>> {
        let shared = self.0.upgrade()?;
        let is_current = shared.lanes.get(lane)?.begin_help(session);
        is_current.then(|| {
            let worker = Worker { seat: 0, scratch: Scratch::new(), run: Vec::with_capacity(RUN) };
            Helper { pool: Weak::clone(&self.0), lane, session, worker, turn: 0, seated: None }
        })
    }
}

/// By which a learner's thread works in the pool of its process while it waits.
pub struct Helper<T: Transport> {
    pool: Weak<Shared<T>>,
    lane: usize,
    session: SessionId,
    worker: Worker,
    /// The seat from which the next run of an asynchronous lane is taken.
    turn: usize,
    /// The pool, while the learner's thread has the seat of a worker.
    seated: Option<Arc<Shared<T>>>,
}

impl<T: Transport> Helper<T> {
    /// Accepts the requests that the learner sent.
    pub fn accept(&self) {
        let accept = |shared: &Shared<T>| while !shared.queues.is_stopped() && shared.accept(self.lane) {};
        match &self.seated {
            Some(shared) => accept(shared),
            None => drop(self.pool.upgrade().map(|shared| accept(&shared))),
        }
    }

    /// Takes the seat of a worker, who stands down until [`stand_up`](Helper::stand_up). Without effect if
    /// learners have all seats, or the pool ends. A pool waits for its guests to stand up before it ends.
    pub fn sit_down(&mut self) {
        if self.seated.is_none()
            && let Some(shared) = self.pool.upgrade()
            // A lane's first environments, and so all of a small lane, belong to this seat.
            && let Some(seat) = shared.queues.sit(self.lane % shared.queues.workers())
        {
            self.worker.seat = seat;
            self.seated = Some(shared);
        }
    }

    /// Gives the seat back.
    pub fn stand_up(&mut self) {
        if let Some(shared) = self.seated.take() {
            let must_lead = shared.lanes.iter().any(|lane| !lane.has_helper());
            shared.ring(shared.queues.stand_up(self.worker.seat, must_lead));
        }
    }

    /// Serves some environments, if it has a seat: of the learner's own lane, or else a few of another.
    /// `false` if none are waiting, or the pool ends.
    pub fn serve(&mut self) -> bool {
        let Some(shared) = self.seated.as_ref().filter(|shared| !shared.queues.is_stopped()) else {
            return false;
        };
        let own = self.worker.seat;
        // In an asynchronous lane, any environment may complete the learner's batch. The seats take turns:
        // with its own always first, the learner would step the same environments again and again while the
        // other threads get no core.
        let (seat, most) = if shared.lanes[self.lane].is_synchronous() {
            (own, RUN)
        } else {
            self.turn = (self.turn + 1) % shared.queues.workers();
            (self.turn, GUEST_RUN)
        };
        shared.serve_run(&mut self.worker, seat, Some(self.lane), most)
            || shared.serve_run(&mut self.worker, own, None, GUEST_RUN)
    }
}

impl<T: Transport> Drop for Helper<T> {
    fn drop(&mut self) {
        self.stand_up();
        if let Some(shared) = self.pool.upgrade() {
            shared.lanes[self.lane].end_help(self.session);
            shared.doorbell.ring(); // the leader has a lane more to poll
        }
    }
}
