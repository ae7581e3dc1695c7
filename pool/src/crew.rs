//! The threads of a pool: which of them may work, and how those that have nothing to do wait.
//!
//! One of a pool's N threads is the *server*, which receives the requests of learners in other processes; the
//! others are *helpers*, numbered from 0. A *caller* is the thread of a learner of this process, which works
//! on its own lane while it waits for its batch (caller runs). Helper k works only while k and the callers
//! are fewer than N, and the server works on lanes of callers only if there is none; so callers take the
//! places of the server and then of the last helpers. A helper that finds nothing to take receives requests
//! while the server works.
//!
//! Who publishes work takes part in it until nothing is left to take, so helpers are needed for speed alone;
//! only a caller that leaves work behind depends on them, and on the server.
//!
//! A helper that finds no work *searches*, and then sleeps until it is woken. No wake-up is lost, because
//! each side writes first and then reads what the other side writes, with sequentially consistent fences
//! between:
//!
//! | who | writes | then reads |
//! | --- | --- | --- |
//! | a helper that goes to sleep | that it sleeps | whether there is work for it, and if to stop |
//! | who publishes work | the work | which helpers search and which sleep |
//! | a searching helper that took work | that it searches no more | whether work is left, and the same |
//! | a caller that leaves | that there is one less | the same |

use crate::sync::{AtomicBool, AtomicU8, AtomicUsize, Ordering, Thread, current, fence, park};
use crate::wait_strategy::Polling;
use crossbeam::utils::CachePadded;
use std::sync::OnceLock;

/// What helpers work on.
pub(crate) trait Source {
    /// Some environments of a lane.
    type Chunk;
    /// Whether there is something to take.
    fn has_work(&self) -> bool;
    /// Accepts requests while the server has no time. Returns whether there were any.
    fn receive(&self) -> bool;
    /// Takes some environments, by preference of the lane whose `turn` it is, and there by preference those
    /// of the thread with this number.
    fn take(&self, thread: usize, turn: &mut usize) -> Option<Self::Chunk>;
}

const SEARCHES: u8 = 0;
const WORKS: u8 = 1;
const SLEEPS: u8 = 2;

struct Helper {
    state: AtomicU8,
    /// To wake it; known before it sleeps.
    thread: OnceLock<Thread>,
}

/// The threads of a pool.
pub(crate) struct Crew {
    /// All of them, with the server.
    threads: usize,
    helpers: Vec<CachePadded<Helper>>,
    callers: AtomicUsize,
    stopped: AtomicBool,
}

impl Crew {
    pub(crate) fn new(threads: usize) -> Crew {
        let helper = || Helper { state: AtomicU8::new(SEARCHES), thread: OnceLock::new() };
        Crew {
            threads,
            helpers: (1..threads).map(|_| CachePadded::new(helper())).collect(),
            callers: AtomicUsize::new(0),
            stopped: AtomicBool::new(false),
        }
    }

    pub(crate) fn threads(&self) -> usize {
        self.threads
    }

    /// The number of the server, and of every caller, among the threads that take work.
    pub(crate) fn server(&self) -> usize {
        self.threads - 1
    }

    pub(crate) fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Acquire)
    }

    pub(crate) fn has_callers(&self) -> bool {
        self.callers.load(Ordering::SeqCst) > 0
    }

    /// This thread works from now on.
    pub(crate) fn enter(&self) {
        self.callers.fetch_add(1, Ordering::SeqCst);
    }

    /// This thread works no more. Returns whether the server must be woken: there is work, and no caller has
    /// its place.
    pub(crate) fn leave(&self, source: &impl Source) -> bool {
        self.callers.fetch_sub(1, Ordering::SeqCst);
        fence(Ordering::SeqCst);
        let is_left = source.has_work();
        if is_left {
            self.wake(1);
        }
        is_left && !self.has_callers()
    }

    fn may_help(&self, helper: usize) -> bool {
        helper + self.callers.load(Ordering::SeqCst) < self.threads
    }

    /// There is work for so many helpers: those that search take part, and others are woken.
    pub(crate) fn wake(&self, mut count: usize) {
        fence(Ordering::SeqCst);
        for (index, helper) in self.helpers.iter().enumerate() {
            if count == 0 || !self.may_help(index) {
                break;
            }
            // One that sleeps searches from now on; the others stay as they are.
            match helper.state.compare_exchange(SLEEPS, SEARCHES, Ordering::SeqCst, Ordering::SeqCst) {
                Ok(_) => helper.unpark(),
                Err(WORKS) => continue,
                Err(_) => {}
            }
            count -= 1;
        }
    }

    /// What a helper does until the pool stops.
    pub(crate) fn help<S: Source>(
        &self,
        index: usize,
        polling: Polling,
        source: &S,
        mut serve: impl FnMut(S::Chunk),
    ) {
        let state = &self.helpers[index].state;
        let _ = self.helpers[index].thread.set(current());
        let mut turn = index;
        while let Some(chunk) = self.search(index, polling, source, &mut turn) {
            state.store(WORKS, Ordering::SeqCst);
            fence(Ordering::SeqCst);
            // Who published it may have counted on this helper for something else.
            if source.has_work() {
                self.wake(1);
            }
            serve(chunk);
            while self.may_help(index)
                && !self.is_stopped()
                && let Some(chunk) = source.take(index, &mut turn)
            {
                serve(chunk);
            }
            state.store(SEARCHES, Ordering::SeqCst);
        }
    }

    /// Looks for work, and sleeps if none comes. `None` if the pool stops.
    fn search<S: Source>(
        &self,
        index: usize,
        polling: Polling,
        source: &S,
        turn: &mut usize,
    ) -> Option<S::Chunk> {
        let mut polls = polling.begin();
        while !self.is_stopped() {
            if self.may_help(index) {
                if let Some(chunk) = source.take(index, turn) {
                    return Some(chunk);
                }
                if source.receive() || polls.pause() {
                    continue;
                }
            }
            self.sleep(index, source);
            polls = polling.begin();
        }
        None
    }

    fn sleep(&self, index: usize, source: &impl Source) {
        let state = &self.helpers[index].state;
        state.store(SLEEPS, Ordering::SeqCst);
        fence(Ordering::SeqCst);
        let is_needed = self.is_stopped() || self.may_help(index) && source.has_work();
        while !is_needed && state.load(Ordering::SeqCst) == SLEEPS {
            park();
        }
        state.store(SEARCHES, Ordering::SeqCst);
    }

    /// Makes every helper end.
    pub(crate) fn stop(&self) {
        self.stopped.store(true, Ordering::SeqCst);
        fence(Ordering::SeqCst);
        for helper in &self.helpers {
            helper.state.store(SEARCHES, Ordering::SeqCst); // one that goes to sleep later sees `stopped`
            helper.unpark();
        }
    }
}

impl Helper {
    fn unpark(&self) {
        if let Some(thread) = self.thread.get() {
            thread.unpark();
        }
    }
}

#[cfg(all(test, loom))]
mod loom_tests;
