//! The hand-off of work between the worker threads: who waits for requests, and how the others get their share.
//!
//! Every worker has an inbox. At any time at most one idle worker *leads*: it polls the lanes for requests and shares
//! them out; the other idle ones follow: they wait at their inboxes. A leader that gets work of its own gives the lead
//! up and calls a sleeping follower, so that requests never wait while a worker is idle. There is no dispatcher
//! thread: with one worker a request is received, stepped and answered by that worker without a hop.
//!
//! What synchronises: an inbox's mutex publishes the entries in it from leader to follower; `WorkQueues::led` orders one
//! leader's look at the lanes before the next one's. `Inbox::ready` is only a hint that lets a spinning follower look
//! without locking; it publishes nothing.

use crate::sync::{AtomicBool, AtomicUsize, Condvar, Mutex, Ordering, lock, yield_now};
use crossbeam::utils::CachePadded;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// How an idle thread waits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WaitStrategy {
    /// Looks again and again for a while, yielding the core between looks, then blocks.
    #[default]
    Adaptive,
    /// Looks again and again, yielding, and never blocks. For machines with a core to spare for every waiting thread.
    Spin,
    /// Blocks at once. Costs a wake-up of the operating system a batch, and no processor time.
    Block,
}

impl WaitStrategy {
    /// The word used in options and Python.
    pub fn name(self) -> &'static str {
        match self {
            WaitStrategy::Adaptive => "adaptive",
            WaitStrategy::Spin => "spin",
            WaitStrategy::Block => "block",
        }
    }

    /// For how long to look before blocking, in and around a pool of so many worker threads; `None` is for ever.
    ///
    /// A sleeper takes some 50 us to wake, so that is the least to look for. Where there is a core that no worker needs,
    /// it is long enough for most batches; where there is none, who looks for long keeps a worker from its work.
    pub fn spin_time(self, threads: usize) -> Option<Duration> {
        let cores = || std::thread::available_parallelism().map_or(1, |n| n.get());
        match self {
            WaitStrategy::Adaptive if cores() > threads => Some(Duration::from_micros(500)),
            WaitStrategy::Adaptive => Some(Duration::from_micros(50)),
            WaitStrategy::Spin => None,
            WaitStrategy::Block => Some(Duration::ZERO),
        }
    }
}

impl std::str::FromStr for WaitStrategy {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, String> {
        match word {
            "adaptive" => Ok(WaitStrategy::Adaptive),
            "spin" => Ok(WaitStrategy::Spin),
            "block" => Ok(WaitStrategy::Block),
            _ => Err(format!("waiting is `adaptive`, `spin` or `block`, not `{word}`")),
        }
    }
}

/// Work for one worker, in one queue a lane so that no lane waits behind another's batch.
struct Inbox<E> {
    state: Mutex<InboxState<E>>,
    bell: Condvar,
    ready: AtomicUsize,
}

struct InboxState<E> {
    queues: Vec<VecDeque<E>>,
    next_queue: usize,
    /// The owner sleeps, or is about to: it looked at the lead after setting this.
    asleep: bool,
    /// The owner is called to look for the lead.
    called: bool,
}

/// The inboxes of all workers and the lead.
pub(crate) struct WorkQueues<E> {
    inboxes: Vec<CachePadded<Inbox<E>>>,
    /// Somebody leads. Not a mutex: nobody ever waits for it, and loom does not see what a failed `try_lock` races with.
    led: AtomicBool,
    stop: AtomicBool,
}

/// The right to poll the lanes; given up by [`WorkQueues::resign`].
pub(crate) struct Leadership<'a>(&'a AtomicBool);

impl Drop for Leadership<'_> {
    fn drop(&mut self) {
        // Publishes what this leader did to the next one, which acquires it in `try_lead`.
        self.0.store(false, Ordering::Release);
    }
}

/// What ended a follower's wait.
pub(crate) enum Wakeup<'a> {
    /// There may be work in the inbox, or the pool stops.
    Work,
    /// Nobody leads; now this worker does.
    Leading(Leadership<'a>),
}

impl<E> WorkQueues<E> {
    pub(crate) fn new(workers: usize, lanes: usize) -> Self {
        let inbox = || {
            let queues = (0..lanes).map(|_| VecDeque::new()).collect();
            CachePadded::new(Inbox {
                state: Mutex::new(InboxState { queues, next_queue: 0, asleep: false, called: false }),
                bell: Condvar::new(),
                ready: AtomicUsize::new(0),
            })
        };
        WorkQueues {
            inboxes: (0..workers).map(|_| inbox()).collect(),
            led: AtomicBool::new(false),
            stop: AtomicBool::new(false),
        }
    }

    pub(crate) fn workers(&self) -> usize {
        self.inboxes.len()
    }

    /// Puts entries of one lane into a worker's inbox and wakes it if it sleeps. Keeps their order.
    pub(crate) fn push(&self, worker: usize, lane: usize, entries: impl Iterator<Item = E>) {
        let inbox = &self.inboxes[worker];
        let mut state = lock(&inbox.state);
        let before = state.queues[lane].len();
        state.queues[lane].extend(entries);
        let added = state.queues[lane].len() - before;
        inbox.ready.fetch_add(added, Ordering::Relaxed);
        if added > 0 && state.asleep {
            inbox.bell.notify_one();
        }
    }

    /// Moves up to `most` entries of the next lane in turn into `run`; returns the lane.
    pub(crate) fn take(&self, worker: usize, most: usize, run: &mut Vec<E>) -> Option<usize> {
        let inbox = &self.inboxes[worker];
        if inbox.ready.load(Ordering::Relaxed) == 0 {
            return None; // `follow` looks again under the lock before it sleeps
        }
        let mut state = lock(&inbox.state);
        let lanes = state.queues.len();
        let lane =
            (0..lanes).map(|i| (state.next_queue + i) % lanes).find(|l| !state.queues[*l].is_empty())?;
        state.next_queue = (lane + 1) % lanes;
        let queue = &mut state.queues[lane];
        let count = most.min(queue.len());
        run.extend(queue.drain(..count));
        inbox.ready.fetch_sub(count, Ordering::Relaxed);
        Some(lane)
    }

    /// Is there work in the worker's inbox? A leader asks this after it shared out a request.
    pub(crate) fn has_work(&self, worker: usize) -> bool {
        self.inboxes[worker].ready.load(Ordering::Relaxed) > 0
    }

    /// Waits at the inbox until there is work or nobody leads; blocks when it has looked for so long.
    pub(crate) fn wait_for_work(&self, worker: usize, spin: Option<Duration>) -> Wakeup<'_> {
        let spin_until = spin.map(|time| Instant::now() + time);
        loop {
            if self.has_work(worker) || self.is_stopped() {
                return Wakeup::Work;
            }
            if let Some(leadership) = self.try_lead() {
                return Wakeup::Leading(leadership);
            }
            if spin_until.is_some_and(|end| Instant::now() >= end) {
                break;
            }
            yield_now();
        }
        self.sleep(worker)
    }

    fn try_lead(&self) -> Option<Leadership<'_>> {
        // Acquires what the last leader did. A failed look publishes nothing: somebody leads.
        let led = self.led.compare_exchange(false, true, Ordering::Acquire, Ordering::Relaxed);
        led.is_ok().then(|| Leadership(&self.led))
    }

    /// `asleep` is set before the last look at the lead, and `resign` gives the lead up before it looks at `asleep`:
    /// one of the two sees the other, so requests are never left without a leader while a worker sleeps.
    fn sleep(&self, worker: usize) -> Wakeup<'_> {
        let inbox = &self.inboxes[worker];
        lock(&inbox.state).asleep = true;
        let leadership = self.try_lead();
        let mut state = lock(&inbox.state);
        if leadership.is_none() {
            while !state.called && !self.is_stopped() && state.queues.iter().all(VecDeque::is_empty) {
                state = inbox.bell.wait(state).unwrap_or_else(|poisoned| poisoned.into_inner());
            }
        }
        state.asleep = false;
        state.called = false;
        leadership.map_or(Wakeup::Work, Wakeup::Leading)
    }

    /// Gives the lead up and calls a sleeping worker without work to it.
    pub(crate) fn release(&self, leadership: Leadership<'_>) {
        drop(leadership);
        for inbox in &self.inboxes {
            let mut state = lock(&inbox.state);
            if state.asleep && !state.called && state.queues.iter().all(VecDeque::is_empty) {
                state.called = true;
                inbox.bell.notify_one();
                return;
            }
        }
    }

    /// Tells every worker to end; a leader also needs its doorbell rung.
    pub(crate) fn stop(&self) {
        self.stop.store(true, Ordering::Release);
        for inbox in &self.inboxes {
            let _state = lock(&inbox.state); // a worker between its look at `stop` and its sleep holds this
            inbox.bell.notify_one();
        }
    }

    pub(crate) fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Acquire)
    }
}

/// `RUSTFLAGS="--cfg loom" cargo test --release -p smaclite-pool leader_followers`: every interleaving. A wake-up that is lost
/// shows as a deadlock.
#[cfg(all(test, loom))]
mod loom_tests {
    use super::*;
    use loom::thread;
    use std::sync::Arc;

    fn leadership<'a>(queues: &'a WorkQueues<u32>, worker: usize) -> Option<Leadership<'a>> {
        match queues.wait_for_work(worker, Some(Duration::ZERO)) {
            Wakeup::Leading(leadership) => Some(leadership),
            Wakeup::Work => None,
        }
    }

    /// Nobody is marked as asleep or called who is neither: a call to one who is awake could be one too few for another.
    fn assert_all_awake(queues: &WorkQueues<u32>) {
        for inbox in &queues.inboxes {
            let state = lock(&inbox.state);
            assert!(!state.asleep && !state.called);
        }
    }

    #[test]
    fn work_for_a_follower_that_goes_to_sleep_reaches_it() {
        loom::model(|| {
            let queues = Arc::new(WorkQueues::<u32>::new(2, 1));
            let leading = leadership(&queues, 0).expect("nobody else leads");
            let follower = {
                let queues = Arc::clone(&queues);
                thread::spawn(move || {
                    let mut run = Vec::new();
                    while queues.take(1, 8, &mut run).is_none() {
                        assert!(leadership(&queues, 1).is_none(), "worker 0 still leads");
                    }
                    assert_eq!(run, [7]);
                })
            };
            queues.push(1, 0, [7].into_iter());
            follower.join().unwrap();
            assert_all_awake(&queues);
            queues.release(leading);
        });
    }

    #[test]
    fn the_lead_passes_to_a_follower_that_goes_to_sleep() {
        loom::model(|| {
            let queues = Arc::new(WorkQueues::<u32>::new(2, 1));
            let leading = leadership(&queues, 0).expect("nobody else leads");
            let follower = {
                let queues = Arc::clone(&queues);
                thread::spawn(move || {
                    let leadership = loop {
                        if let Some(leadership) = leadership(&queues, 1) {
                            break leadership;
                        }
                    };
                    queues.release(leadership);
                })
            };
            queues.release(leading);
            follower.join().unwrap(); // worker 0 is busy elsewhere and never leads again
            assert_all_awake(&queues);
        });
    }

    #[test]
    fn the_lead_passes_by_a_sleeper_that_has_work() {
        let mut model = loom::model::Builder::new();
        model.preemption_bound = Some(3); // three threads have too many interleavings to see them all
        model.check(|| {
            let queues = Arc::new(WorkQueues::<u32>::new(3, 1));
            let leading = leadership(&queues, 0).expect("nobody else leads");
            let busy = {
                let queues = Arc::clone(&queues);
                thread::spawn(move || {
                    let mut run = Vec::new();
                    while queues.take(1, 8, &mut run).is_none() {
                        if let Some(leadership) = leadership(&queues, 1) {
                            queues.release(leadership);
                        }
                    } // and is at work for the rest of the test
                })
            };
            let idle = {
                let queues = Arc::clone(&queues);
                thread::spawn(move || while leadership(&queues, 2).is_none() {})
            };
            queues.push(1, 0, [7].into_iter());
            queues.release(leading);
            busy.join().unwrap();
            idle.join().unwrap();
        });
    }

    #[test]
    fn a_follower_that_goes_to_sleep_hears_the_stop() {
        loom::model(|| {
            let queues = Arc::new(WorkQueues::<u32>::new(2, 1));
            let leading = leadership(&queues, 0).expect("nobody else leads");
            let follower = {
                let queues = Arc::clone(&queues);
                thread::spawn(move || {
                    while !queues.is_stopped() {
                        drop(leadership(&queues, 1));
                    }
                })
            };
            queues.stop();
            follower.join().unwrap();
            queues.release(leading);
        });
    }
}
