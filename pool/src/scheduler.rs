//! The threads of a pool at work: the server, the helpers, and learners' threads that work on their own lane
//! while they wait. Which environments are left is in `work`, who may work and how the others wait in `crew`;
//! ARCHITECTURE.md, "Scheduling", has the picture.

use crate::crew::{Crew, Source};
use crate::lane::{Lane, panic_text};
use crate::lane_settings::LaneSpec;
use crate::pool_options::PoolOptions;
use crate::rejection::Rejection;
use crate::sync::{AtomicBool, Mutex, MutexGuard, Ordering, lock, yield_now};
use crate::transport::{Doorbell, Request, SessionId, Transport, TransportError};
use crate::wait_strategy::Polling;
use crate::work::CHUNK;
use smaclite_engine::Scratch;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Weak};
use std::thread::JoinHandle;
use std::time::Duration;

/// The server looks for requests at least this often, even without a ring.
const CHECK_INTERVAL: Duration = Duration::from_millis(100);

/// How often a pool that stops looks whether learners still work in it.
const LEAVING_INTERVAL: Duration = Duration::from_micros(50);

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

struct Shared<T: Transport> {
    lanes: Vec<Lane<T>>,
    crew: Crew,
    doorbell: T::Doorbell,
    /// Held by the thread that accepts requests of other processes.
    receiving: Mutex<()>,
    /// The server has environments to serve.
    server_serves: AtomicBool,
    /// How idle threads poll before they block.
    polling: Polling,
}

impl<T: Transport> Pool<T> {
    /// Builds the lanes and starts the threads.
    ///
    /// # Errors
    /// If the transport of a lane has no frame, or a thread cannot be started.
    pub fn start(
        lanes: Vec<(LaneSpec, T::Inlet, T::Outlet)>,
        doorbell: T::Doorbell,
        options: PoolOptions,
    ) -> Result<Pool<T>, PoolStartError> {
        let threads = options.threads.max(1);
        let lanes = lanes.into_iter().map(|(spec, inlet, outlet)| Lane::new(&spec, inlet, outlet, threads));
        let lanes = lanes.collect::<Result<Vec<_>, _>>()?;
        let (crew, polling) = (Crew::new(threads), options.wait.polling(threads));
        // Nothing else keeps it: where a thread is refused, the pool is dropped, which waits for all others.
        let (receiving, server_serves) = (Mutex::new(()), AtomicBool::new(false));
        let shared = Some(Arc::new(Shared { lanes, crew, doorbell, receiving, server_serves, polling }));
        let mut pool = Pool { shared, threads: Vec::new() };
        for index in 0..threads {
            let shared = Arc::clone(pool.shared());
            let thread = std::thread::Builder::new().name(format!("smaclite-{index}"));
            let work =
                move || if index == shared.crew.server() { shared.be_server() } else { shared.help(index) };
            pool.threads.push(thread.spawn(work).map_err(PoolStartError::Thread)?);
        }
        Ok(pool)
    }

    fn shared(&self) -> &Arc<Shared<T>> {
        self.shared.as_ref().expect("only the drop takes it")
    }

    /// A lane.
    ///
    /// # Panics
    /// If there is no such lane.
    pub fn lane(&self, lane: usize) -> &Lane<T> {
        &self.shared().lanes[lane]
    }

    /// By which learners of this process take part.
    pub fn handle(&self) -> PoolHandle<T> {
        PoolHandle(Arc::downgrade(self.shared()))
    }

    /// Ends the threads after their present environments.
    pub fn stop(&mut self) {
        let shared = self.shared();
        shared.crew.stop();
        shared.doorbell.ring();
        for thread in self.threads.drain(..) {
            // A thread catches the panics of its lanes. If it panics all the same, its pool ends here anyway.
            let _ = thread.join();
        }
    }
}

impl<T: Transport> Drop for Pool<T> {
    fn drop(&mut self) {
        self.stop();
        // The lanes end here and not on a learner's thread: their ports must be closed before their node.
        let mut left = self.shared.take();
        while let Some(shared) = left {
            left = Arc::try_unwrap(shared).err();
            if left.is_some() {
                std::thread::sleep(LEAVING_INTERVAL); // a learner leaves after its present environments
            }
        }
    }
}

impl<T: Transport> Shared<T> {
    /// What a helper does.
    fn help(&self, helper: usize) {
        let mut scratch = Scratch::new();
        self.crew.help(helper, self.polling, self, |(lane, envs)| self.lanes[lane].serve(envs, &mut scratch));
    }

    /// What the server does: it looks for requests, serves environments of all lanes by turns, not too many,
    /// and looks again, so that a small lane does not wait for the step of a big one.
    fn be_server(&self) {
        let server = self.crew.server();
        let (mut scratch, mut turn) = (Scratch::new(), 0);
        let mut polls = self.polling.begin();
        while !self.crew.is_stopped() {
            let mut is_busy = self.receive_all(lock(&self.receiving));
            let may_serve = |lane: &Lane<T>| !lane.is_local() || !self.crew.has_callers();
            let mut served = 0;
            while served < CHUNK
                && let Some((lane, envs)) = self.take_where(server, &mut turn, may_serve)
            {
                is_busy = true;
                self.server_serves.store(true, Ordering::Relaxed);
                served += envs.len();
                self.lanes[lane].serve(envs, &mut scratch);
            }
            self.server_serves.store(false, Ordering::Relaxed);
            if is_busy {
                polls = self.polling.begin();
            } else if self.lanes.iter().all(Lane::is_local) || !polls.pause() {
                self.doorbell.wait(CHECK_INTERVAL);
                polls = self.polling.begin();
            }
        }
    }

    /// Accepts or refuses the next request of every lane. Returns whether there were any.
    fn receive_all(&self, _receiving: MutexGuard<'_, ()>) -> bool {
        let mut any = false;
        for lane in (0..self.lanes.len()).filter(|lane| !self.lanes[*lane].is_local()) {
            let received = self.contained(lane, || self.lanes[lane].receive()).flatten();
            if let Some(threads) = received {
                any = true;
                self.crew.wake(threads.saturating_sub(1));
            }
        }
        any
    }

    /// A panic ends the lane, not the thread.
    fn contained<R>(&self, lane: usize, action: impl FnOnce() -> R) -> Option<R> {
        let done = catch_unwind(AssertUnwindSafe(action));
        done.map_err(|panic| self.lanes[lane].fail(panic_text(panic.as_ref()))).ok()
    }

    /// Carries out what a request must wait for, with the threads that have some of it already.
    fn finish(&self, lane: usize, request: &Request<'_, i32>, scratch: &mut Scratch) {
        while self.lanes[lane].must_wait(request) && !self.crew.is_stopped() {
            if !self.serve(lane, scratch) {
                yield_now();
            }
        }
    }

    /// Serves some environments of a lane, on the thread of the server or of a learner; `false` if none are
    /// left to take.
    fn serve(&self, lane: usize, scratch: &mut Scratch) -> bool {
        let taken = self.lanes[lane].work().take(self.own_range(lane, self.crew.server()));
        taken.map(|envs| self.lanes[lane].serve(envs, scratch)).is_some()
    }

    /// Lanes begin at different threads, so that the only environments of several small lanes do not all
    /// belong to the same one.
    fn own_range(&self, lane: usize, thread: usize) -> usize {
        let threads = self.crew.threads();
        (thread + threads - lane % threads) % threads
    }

    /// [`Source::take`] from lanes of a kind.
    fn take_where(
        &self,
        thread: usize,
        turn: &mut usize,
        is_meant: impl Fn(&Lane<T>) -> bool,
    ) -> Option<(usize, Range<usize>)> {
        let lanes = self.lanes.len();
        for lane in (0..lanes).map(|i| (*turn + i) % lanes).filter(|lane| is_meant(&self.lanes[*lane])) {
            if let Some(envs) = self.lanes[lane].work().take(self.own_range(lane, thread)) {
                *turn = lane + 1;
                return Some((lane, envs));
            }
        }
        None
    }
}

impl<T: Transport> Source for Shared<T> {
    /// A lane and some of its environments.
    type Chunk = (usize, Range<usize>);

    fn has_work(&self) -> bool {
        self.lanes.iter().any(|lane| !lane.work().is_empty())
    }

    fn receive(&self) -> bool {
        self.server_serves.load(Ordering::Relaxed)
            && self.receiving.try_lock().is_ok_and(|receiving| self.receive_all(receiving))
    }

    fn take(&self, thread: usize, turn: &mut usize) -> Option<(usize, Range<usize>)> {
        self.take_where(thread, turn, |_| true)
    }
}

/// By which learners of the process take part in a pool, for as long as it runs.
pub struct PoolHandle<T: Transport>(Weak<Shared<T>>);

impl<T: Transport> PoolHandle<T> {
    /// The learner of lane `lane`, whose requests from now on, and until it is dropped or its session ends,
    /// are orders of its thread. `None` if the session is not the lane's or the pool ends.
    pub fn local_learner(&self, lane: usize, session: SessionId) -> Option<LocalLearner<T>> {
        let shared = self.0.upgrade()?;
        let is_current = shared.lanes.get(lane)?.set_local(session, true);
        let (pool, scratch) = (Weak::clone(&self.0), Scratch::new());
        is_current.then(|| LocalLearner { pool, lane, session, scratch, entered: None })
    }
}

/// A learner's thread in the process of its pool (caller runs): it checks its requests itself, as the server
/// does those of others, and works on its lane while it waits.
pub struct LocalLearner<T: Transport> {
    pool: Weak<Shared<T>>,
    lane: usize,
    session: SessionId,
    scratch: Scratch,
    /// The pool, while this thread works in it.
    entered: Option<Arc<Shared<T>>>,
}

impl<T: Transport> LocalLearner<T> {
    /// Orders what a request of this learner says, all of it or nothing, and stays at work: then
    /// [`serve`](LocalLearner::serve) or [`leave`](LocalLearner::leave) should follow. Without effect if the
    /// pool ends, which waits until its learners have left.
    ///
    /// # Errors
    /// Why the lane refuses it.
    pub fn order(&mut self, request: &Request<'_, i32>) -> Result<(), Rejection> {
        let lane = self.lane;
        let Some(shared) = enter(&mut self.entered, &self.pool) else { return Ok(()) };
        shared.finish(lane, request, &mut self.scratch);
        let ordered = shared.contained(lane, || shared.lanes[lane].order(request, Duration::ZERO));
        let threads = ordered.unwrap_or(Ok(0))?; // a lane that failed has reported it
        shared.crew.wake(threads.saturating_sub(1));
        Ok(())
    }

    /// Serves some environments of its lane. `false` if none are left to take, or the pool ends.
    pub fn serve(&mut self) -> bool {
        let Some(shared) = enter(&mut self.entered, &self.pool) else { return false };
        !shared.crew.is_stopped() && shared.serve(self.lane, &mut self.scratch)
    }

    /// Works no more until the next order or [`serve`](LocalLearner::serve).
    pub fn leave(&mut self) {
        if let Some(shared) = self.entered.take()
            && shared.crew.leave(&*shared)
        {
            shared.doorbell.ring();
        }
    }
}

/// The pool, in which this thread is at work from now on; `None` if it ends.
fn enter<'a, T: Transport>(
    entered: &'a mut Option<Arc<Shared<T>>>,
    pool: &Weak<Shared<T>>,
) -> Option<&'a Shared<T>> {
    if entered.is_none() {
        *entered = pool.upgrade();
        entered.as_ref().inspect(|shared| shared.crew.enter());
    }
    entered.as_deref()
}

impl<T: Transport> Drop for LocalLearner<T> {
    fn drop(&mut self) {
        self.leave();
        if let Some(shared) = self.pool.upgrade() {
            shared.lanes[self.lane].set_local(self.session, false);
        }
    }
}
