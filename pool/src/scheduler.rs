//! The scheduler: worker threads, and learners' threads that work in their place, take environments from the
//! lanes and carry out their orders. Which environments are left is in `work`, where idle workers wait in
//! `parking`; ARCHITECTURE.md, "Scheduling", has the picture.

use crate::lane::{Accepted, Lane, panic_text};
use crate::lane_settings::LaneSpec;
use crate::parking::{Parking, Searching, Source};
use crate::pool_options::PoolOptions;
use crate::transport::{Doorbell, SessionId, Transport, TransportError};
use crate::wait_strategy::Polling;
use crate::work::CHUNK;
use smaclite_engine::Scratch;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Weak};
use std::thread::JoinHandle;
use std::time::Duration;

/// A worker at the doorbell polls the lanes at least this often, even without a ring.
const CHECK_INTERVAL: Duration = Duration::from_millis(100);

/// At how many lanes a busy worker looks between two chunks.
const LOOKS: usize = 4;

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

/// Whose turn it is, as a worker sees it.
struct Turns {
    /// The lane whose environments it looks for first.
    serve: usize,
    /// The lane whose requests it accepts next between two chunks.
    poll: usize,
    /// Environments that it served since it last did.
    served: usize,
}

struct Shared<T: Transport> {
    lanes: Vec<Lane<T>>,
    parking: Parking,
    doorbell: T::Doorbell,
    /// How idle workers poll before they park.
    polling: Polling,
}

impl<T: Transport> Pool<T> {
    /// Builds the lanes and starts the threads.
    pub fn start(
        lanes: Vec<(LaneSpec, T::Inlet, T::Outlet)>,
        doorbell: T::Doorbell,
        options: PoolOptions,
    ) -> Result<Pool<T>, PoolStartError> {
        let threads = options.threads.max(1);
        let lanes = lanes.into_iter().map(|(spec, inlet, outlet)| Lane::new(&spec, inlet, outlet, threads));
        let lanes = lanes.collect::<Result<Vec<_>, _>>()?;
        let (parking, polling) = (Parking::new(threads), options.wait.polling(threads));
        // Nothing else keeps it: where a thread is refused, the pool is dropped, which waits for all others.
        let shared = Some(Arc::new(Shared { lanes, parking, doorbell, polling }));
        let mut pool = Pool { shared, threads: Vec::new() };
        for worker in 0..threads {
            let shared = Arc::clone(pool.shared());
            let thread = std::thread::Builder::new().name(format!("smaclite-{worker}"));
            pool.threads.push(thread.spawn(move || shared.work(worker)).map_err(PoolStartError::Thread)?);
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
        shared.parking.stop(&**shared);
        for thread in self.threads.drain(..) {
            // A worker catches the panics of its lanes. If it panics all the same, its pool ends here anyway.
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
    /// What a worker does.
    fn work(&self, worker: usize) {
        let mut scratch = Scratch::new();
        let mut turns = Turns { serve: worker, poll: worker, served: 0 };
        while let Some(searching) = self.parking.search(worker, self, self.polling) {
            let mut searching = Some(searching);
            while self.parking.may_work(worker)
                && self.serve_any(worker, &mut turns, &mut searching, &mut scratch)
            {}
        }
    }

    /// Serves some environments of the next lane that has any; `false` if none has.
    fn serve_any<'a>(
        &'a self,
        worker: usize,
        turns: &mut Turns,
        searching: &mut Option<Searching<'a>>,
        scratch: &mut Scratch,
    ) -> bool {
        for lane in self.lanes_from(turns.serve) {
            let served = self.serve(lane, worker, scratch, || {
                if let Some(searching) = searching.take() {
                    self.parking.found(searching, self);
                }
            });
            if served > 0 {
                turns.serve = lane + 1;
                self.poll_between(turns, served);
                return true;
            }
        }
        false
    }

    /// All lanes, beginning with this one.
    fn lanes_from(&self, lane: usize) -> impl Iterator<Item = usize> + use<T> {
        let lanes = self.lanes.len();
        (0..lanes).map(move |i| (lane + i) % lanes)
    }

    /// Takes some environments of a lane and serves them. Returns how many; 0 if none are left to take.
    fn serve(&self, lane: usize, thread: usize, scratch: &mut Scratch, taken: impl FnOnce()) -> usize {
        // Lanes begin at different threads, so that the only environments of several small lanes do not all
        // belong to the first one.
        let threads = self.parking.threads();
        let own = (thread + threads - lane % threads) % threads;
        let Some(envs) = self.lanes[lane].work().take(own) else { return 0 };
        taken();
        let count = envs.len();
        if self.lanes[lane].serve(envs, scratch) {
            self.accept(lane, 1); // the reset that waited for the last of them
        }
        count
    }

    /// Accepts, between two chunks, what was sent to a lane that is idle: otherwise it would wait until all
    /// other lanes have nothing left to take. Not needed while an idle worker polls. It looks at few lanes,
    /// and accepts for one, so that a step does not take longer in a pool of many lanes.
    fn poll_between(&self, turns: &mut Turns, served: usize) {
        turns.served += served;
        if turns.served < CHUNK || self.parking.is_polled() {
            return;
        }
        turns.served = 0;
        for lane in self.lanes_from(turns.poll).take(LOOKS) {
            turns.poll = lane + 1;
            if self.must_poll(lane) && self.lanes[lane].is_idle() {
                self.accept(lane, 1);
                break;
            }
        }
    }

    /// Accepts the next request of a lane, and wakes the workers for it, but for `present` threads, which
    /// serve it anyway. Returns whether there was one.
    fn accept(&self, index: usize, present: usize) -> bool {
        let lane = &self.lanes[index];
        match catch_unwind(AssertUnwindSafe(|| lane.accept())) {
            Ok(Accepted::Nothing) => return false,
            Ok(Accepted::Refused) => {}
            Ok(Accepted::Work(threads)) => self.parking.published(threads.saturating_sub(present), self),
            Err(panic) => {
                lane.fail(panic_text(panic.as_ref()));
                return false;
            }
        }
        true
    }

    /// Whether workers accept the requests of a lane: its learner does not.
    fn must_poll(&self, lane: usize) -> bool {
        !self.lanes[lane].accepts_itself()
    }

    /// The lanes whose requests workers accept.
    fn polled_lanes(&self) -> impl Iterator<Item = usize> {
        (0..self.lanes.len()).filter(|lane| self.must_poll(*lane))
    }
}

impl<T: Transport> Source for Shared<T> {
    fn has_work(&self) -> bool {
        self.lanes.iter().any(|lane| !lane.work().is_empty())
    }

    fn needs_polling(&self) -> bool {
        self.polled_lanes().next().is_some()
    }

    fn poll(&self) -> bool {
        self.polled_lanes().fold(false, |any, lane| self.accept(lane, 0) | any)
    }

    fn wait_at_doorbell(&self) {
        self.doorbell.wait(CHECK_INTERVAL);
    }

    fn ring(&self) {
        self.doorbell.ring();
    }
}

/// By which learners of the process take part in a pool, for as long as it runs.
pub struct PoolHandle<T: Transport>(Weak<Shared<T>>);

impl<T: Transport> PoolHandle<T> {
    /// What a learner of lane `lane` needs to take part. From now on, and until it is dropped or its session
    /// ends, only the participant accepts the lane's requests. `None` if the session is not the lane's or the
    /// pool ends.
    pub fn participant(&self, lane: usize, session: SessionId) -> Option<Participant<T>> {
        let shared = self.0.upgrade()?;
        let is_current = shared.lanes.get(lane)?.set_accepts_itself(session, true);
        is_current.then(|| Participant {
            pool: Weak::clone(&self.0),
            lane,
            session,
            scratch: Scratch::new(),
            turn: lane,
            place: None,
        })
    }
}

/// A learner's thread that works in the pool of its process while it waits (caller runs): it accepts the
/// requests of its lane, and steps environments in the place of a worker: those of its own lane, by turns
/// with those of lanes whose learners are in other processes.
pub struct Participant<T: Transport> {
    pool: Weak<Shared<T>>,
    lane: usize,
    session: SessionId,
    scratch: Scratch,
    /// The other lane that it looks at first.
    turn: usize,
    /// The pool and the worker that it substitutes, between [`join`](Participant::join) and
    /// [`leave`](Participant::leave).
    place: Option<(Arc<Shared<T>>, usize)>,
}

impl<T: Transport> Participant<T> {
    /// Substitutes a worker. Without effect if learners have the places of all, or the pool ends. A pool
    /// waits until its participants have left before it ends.
    pub fn join(&mut self) {
        if self.place.is_none()
            && let Some(shared) = self.pool.upgrade()
            // The lane's first environments, and so all of a small lane, are this worker's.
            && let Some(worker) = shared.parking.substitute(self.lane % shared.parking.threads())
        {
            self.place = Some((shared, worker));
        }
    }

    /// Gives the place back.
    pub fn leave(&mut self) {
        if let Some((shared, worker)) = self.place.take() {
            shared.parking.reinstate(worker, &*shared);
        }
    }

    /// Accepts the requests that the learner sent.
    pub fn accept(&self) {
        let accept = |shared: &Shared<T>, present| {
            while !shared.parking.is_stopped() && shared.accept(self.lane, present) {}
        };
        match &self.place {
            Some((shared, _)) => accept(shared, 1),
            None => drop(self.pool.upgrade().map(|shared| accept(&shared, 0))),
        }
    }

    /// Joins, if it can, and serves some environments of the learner's lane, and then some of another lane
    /// whose turn it is. `false` if none of its own are left to take, or the pool ends.
    pub fn serve(&mut self) -> bool {
        self.join();
        let Some((shared, worker)) = &self.place else { return false };
        let serve = |lane, scratch: &mut Scratch| shared.serve(lane, *worker, scratch, || {}) > 0;
        if shared.parking.is_stopped() || !serve(self.lane, &mut self.scratch) {
            return false;
        }
        // It may have the place of the only worker. Learners of this process have threads of their own.
        let mut others = shared.lanes_from(self.turn).filter(|lane| shared.must_poll(*lane));
        if let Some(lane) = others.find(|lane| serve(*lane, &mut self.scratch)) {
            self.turn = lane + 1;
        }
        true
    }
}

impl<T: Transport> Drop for Participant<T> {
    fn drop(&mut self) {
        self.leave();
        if let Some(shared) = self.pool.upgrade() {
            shared.lanes[self.lane].set_accepts_itself(self.session, false);
            shared.parking.hand_over(&*shared); // there is a lane more to poll
        }
    }
}
