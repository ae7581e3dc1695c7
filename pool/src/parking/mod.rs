//! The one place where workers park, and how they are woken.
//!
//! An idle worker *searches*: it polls for work and, if no other worker does, for requests. When its time to
//! poll is over it *parks*: the worker that polls the lanes parks at the doorbell, which other processes
//! ring, every other one at a condition variable. A learner's thread of this process that waits for its batch
//! runs environments itself (caller runs); in that time it *substitutes* a worker, so that a pool of N
//! threads never has more than N at work.
//!
//! No wake-up is lost, by handshakes in which each side writes first and then reads what the other side
//! writes, with sequentially consistent fences between:
//!
//! | who | writes | then reads |
//! | --- | --- | --- |
//! | a worker that parks | that it is parked, not searching | whether there is work, who polls, if to stop |
//! | who publishes work | the work | how many search and who is parked |
//! | a worker that found work | that it searches no more | whether work or polls are left, who is parked |
//! | a learner that ends its substitution | that it substitutes no more | the same |

use crate::sync::{AtomicBool, AtomicUsize, Condvar, Mutex, Ordering, fence, lock};
use crate::wait_strategy::Polling;
use crossbeam::utils::CachePadded;

/// What searching workers look at.
pub(crate) trait Source {
    /// Whether there are environments to take.
    fn has_work(&self) -> bool;
    /// Whether there are lanes whose requests a worker must accept.
    fn needs_polling(&self) -> bool;
    /// Accepts the requests of these lanes. Returns whether there were any.
    fn poll(&self) -> bool;
    /// Blocks until the doorbell rings, or for a while. A ring that comes before ends it at once.
    fn wait_at_doorbell(&self);
    /// Rings the doorbell.
    fn ring(&self);
}

/// What a worker does. Changed only under its mutex.
///
/// ```text
/// Running ──park──► Parked or AtDoorbell ──unpark──► Notified ──► Running
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Running,
    Parked,
    AtDoorbell,
    Notified,
}

struct Worker {
    state: Mutex<State>,
    unparked: Condvar,
    /// A learner's thread works in its place.
    substituted: AtomicBool,
}

/// The workers of a pool while they are idle.
pub(crate) struct Parking {
    workers: Vec<CachePadded<Worker>>,
    /// How many workers search.
    searching: AtomicUsize,
    /// How many workers are parked; only a hint that there are any.
    parked: AtomicUsize,
    /// A worker has the right to poll the lanes.
    polled: AtomicBool,
    stopped: AtomicBool,
}

/// A worker is searching; ends with [`found`](Searching::found) or its drop.
pub(crate) struct Searching<'a>(&'a AtomicUsize);

impl Drop for Searching<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::SeqCst);
    }
}

/// The right to poll the lanes, which one worker at a time has.
struct Poller<'a>(&'a AtomicBool);

impl Drop for Poller<'_> {
    fn drop(&mut self) {
        self.0.store(false, Ordering::SeqCst);
    }
}

/// Sets a flag; `false` if it is set already. The load spares the other threads a write to their cache lines.
fn set(flag: &AtomicBool) -> bool {
    !flag.load(Ordering::Relaxed)
        && flag.compare_exchange(false, true, Ordering::SeqCst, Ordering::Relaxed).is_ok()
}

impl Parking {
    pub(crate) fn new(threads: usize) -> Parking {
        let worker = || Worker {
            state: Mutex::new(State::Running),
            unparked: Condvar::new(),
            substituted: AtomicBool::new(false),
        };
        Parking {
            workers: (0..threads).map(|_| CachePadded::new(worker())).collect(),
            searching: AtomicUsize::new(0),
            parked: AtomicUsize::new(0),
            polled: AtomicBool::new(false),
            stopped: AtomicBool::new(false),
        }
    }

    pub(crate) fn threads(&self) -> usize {
        self.workers.len()
    }

    pub(crate) fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Acquire)
    }

    /// Whether a worker has the right to poll. Only a hint: it may have ended meanwhile.
    pub(crate) fn is_polled(&self) -> bool {
        self.polled.load(Ordering::Relaxed)
    }

    /// Whether a worker may take work: not if a learner does in its place, or the pool stops.
    pub(crate) fn may_work(&self, worker: usize) -> bool {
        !self.workers[worker].substituted.load(Ordering::Relaxed) && !self.is_stopped()
    }

    /// Polls, then parks, until there is work for this worker. `None` if the pool stops.
    pub(crate) fn search(
        &self,
        worker: usize,
        source: &impl Source,
        polling: Polling,
    ) -> Option<Searching<'_>> {
        let mut searching = self.begin_search();
        let mut poller = None;
        let mut polls = polling.begin();
        while !self.is_stopped() {
            let may_work = self.may_work(worker);
            if may_work && source.has_work() {
                return Some(searching); // and no poller any more
            }
            poller = poller.filter(|_| source.needs_polling()).or_else(|| self.try_poll(source));
            if poller.is_some() && source.poll() {
                polls = polling.begin();
            } else if !may_work || !polls.pause() {
                self.park(worker, searching, poller.is_some(), source);
                searching = self.begin_search();
                polls = polling.begin();
            }
        }
        None
    }

    fn begin_search(&self) -> Searching<'_> {
        self.searching.fetch_add(1, Ordering::SeqCst);
        Searching(&self.searching)
    }

    fn try_poll(&self, source: &impl Source) -> Option<Poller<'_>> {
        (source.needs_polling() && set(&self.polled)).then(|| Poller(&self.polled))
    }

    fn park(&self, worker: usize, searching: Searching<'_>, is_poller: bool, source: &impl Source) {
        let me = &self.workers[worker];
        *lock(&me.state) = if is_poller { State::AtDoorbell } else { State::Parked };
        self.parked.fetch_add(1, Ordering::SeqCst);
        drop(searching);
        fence(Ordering::SeqCst);
        let is_substituted = me.substituted.load(Ordering::SeqCst);
        if is_substituted {
            self.hand_over(source); // who published work may have counted on this worker
        }
        let has_work = !is_substituted && source.has_work();
        if !has_work && !self.is_stopped() && (is_poller || !self.must_poll(source)) {
            if is_poller {
                source.wait_at_doorbell();
            } else {
                let mut state = lock(&me.state);
                while *state == State::Parked {
                    state = me.unparked.wait(state).unwrap_or_else(|poisoned| poisoned.into_inner());
                }
            }
        }
        self.parked.fetch_sub(1, Ordering::SeqCst);
        *lock(&me.state) = State::Running;
    }

    /// Whether there are requests to poll for and no worker does.
    fn must_poll(&self, source: &impl Source) -> bool {
        source.needs_polling() && !self.polled.load(Ordering::SeqCst)
    }

    /// Work for this many more threads was published. Wakes as many, less those that search.
    pub(crate) fn published(&self, threads: usize, source: &impl Source) {
        fence(Ordering::SeqCst);
        self.unpark(threads.saturating_sub(self.searching.load(Ordering::SeqCst)), source);
    }

    /// A searching worker has taken work. If it was the last to search, another takes over what is left.
    pub(crate) fn found(&self, searching: Searching<'_>, source: &impl Source) {
        drop(searching);
        self.hand_over(source);
    }

    /// Unparks a worker if there is work or polling to do and no worker searches.
    pub(crate) fn hand_over(&self, source: &impl Source) {
        fence(Ordering::SeqCst);
        let is_last = self.searching.load(Ordering::SeqCst) == 0;
        if is_last && (source.has_work() || self.must_poll(source)) {
            self.unpark(1, source);
        }
    }

    /// Unparks workers, those that poll for requests last. One whose place a learner has stays parked.
    fn unpark(&self, mut count: usize, source: &impl Source) {
        if count == 0 || self.parked.load(Ordering::SeqCst) == 0 {
            return;
        }
        for kind in [State::Parked, State::AtDoorbell] {
            for worker in &self.workers {
                let mut state = lock(&worker.state);
                if *state == kind && !worker.substituted.load(Ordering::SeqCst) {
                    *state = State::Notified;
                    match kind {
                        State::AtDoorbell => source.ring(),
                        _ => worker.unparked.notify_one(),
                    }
                    count -= 1;
                    if count == 0 {
                        return;
                    }
                }
            }
        }
    }

    /// A learner's thread takes the place of a worker: of this one, or of the next that no other learner
    /// substitutes. `None` if there is none.
    pub(crate) fn substitute(&self, worker: usize) -> Option<usize> {
        let threads = self.threads();
        (0..threads).map(|i| (worker + i) % threads).find(|worker| set(&self.workers[*worker].substituted))
    }

    /// Gives a worker its place back.
    pub(crate) fn reinstate(&self, worker: usize, source: &impl Source) {
        self.workers[worker].substituted.store(false, Ordering::SeqCst);
        self.hand_over(source);
    }

    /// Makes every worker end.
    pub(crate) fn stop(&self, source: &impl Source) {
        self.stopped.store(true, Ordering::SeqCst);
        for worker in &self.workers {
            *lock(&worker.state) = State::Notified; // a worker that parks later sees `stopped`
            worker.unparked.notify_one();
        }
        source.ring();
    }
}

#[cfg(all(test, loom))]
mod loom_tests;
