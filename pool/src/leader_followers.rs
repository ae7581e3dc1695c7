//! The Leader/Followers pattern (Schmidt et al., POSA volume 2): how worker threads share the work without a
//! dispatcher.
//!
//! Every worker has an inbox. At any time at most one idle worker is the *leader*: it polls the lanes for
//! requests and shares them out. The other idle workers are *followers*: they wait at their inboxes. A leader
//! that receives work releases the leadership and wakes a sleeping follower to take it, so that
//! requests never wait while a worker is idle. With one worker a request is received, stepped and answered on
//! the same thread.
//!
//! Synchronisation: an inbox's mutex publishes its entries from the leader to the follower. `WorkQueues::led`
//! orders one leader's accesses to the lanes before the next leader's. `Inbox::ready` is only a hint that
//! lets a spinning follower poll without the lock; it publishes nothing.

use crate::sync::{AtomicBool, AtomicUsize, Condvar, Mutex, Ordering, lock, yield_now};
use crossbeam::utils::CachePadded;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Work for one worker, in one queue per lane, so that no lane waits behind another lane's batch.
struct Inbox<E> {
    state: Mutex<InboxState<E>>,
    bell: Condvar,
    ready: AtomicUsize,
}

struct InboxState<E> {
    queues: Vec<VecDeque<E>>,
    next_queue: usize,
    /// The owner sleeps or is about to: it sets this before its last attempt to lead.
    asleep: bool,
    /// The owner should wake up and try to lead.
    called: bool,
}

/// The inboxes of all workers, and whether one of them leads.
pub(crate) struct WorkQueues<E> {
    inboxes: Vec<CachePadded<Inbox<E>>>,
    /// A worker leads. Not a mutex: no thread blocks on it, and loom does not model the races of a failed
    /// `try_lock`.
    led: AtomicBool,
    stop: AtomicBool,
}

/// The right to poll the lanes; ends with [`WorkQueues::release`].
pub(crate) struct Leadership<'a>(&'a AtomicBool);

impl Drop for Leadership<'_> {
    fn drop(&mut self) {
        // Publishes what this leader did to the next one, which acquires it in `try_lead`.
        self.0.store(false, Ordering::Release);
    }
}

/// Why a follower's wait ended.
pub(crate) enum Wakeup<'a> {
    /// There may be work in the inbox, or the pool stops.
    Work,
    /// No worker led; now this one does.
    Leading(Leadership<'a>),
}

impl<E: Copy> WorkQueues<E> {
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
    pub(crate) fn push(&self, worker: usize, lane: usize, entries: &[E]) {
        let inbox = &self.inboxes[worker];
        let mut state = lock(&inbox.state);
        state.queues[lane].extend(entries);
        inbox.ready.fetch_add(entries.len(), Ordering::Relaxed);
        if state.asleep {
            inbox.bell.notify_one();
        }
    }

    /// Moves up to `most` entries of the next lane in turn into `run`; returns the lane.
    pub(crate) fn take(&self, worker: usize, most: usize, run: &mut Vec<E>) -> Option<usize> {
        let inbox = &self.inboxes[worker];
        if inbox.ready.load(Ordering::Relaxed) == 0 {
            return None; // `wait_for_work` checks again under the lock before it sleeps
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

    /// Whether the worker's inbox has work. A leader calls this after it shared out a request.
    pub(crate) fn has_work(&self, worker: usize) -> bool {
        self.inboxes[worker].ready.load(Ordering::Relaxed) > 0
    }

    /// Waits at the inbox until it has work or no worker leads. Polls for the time `spin`, then blocks.
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
        // Acquires what the last leader did. A failed attempt reads nothing of it.
        let led = self.led.compare_exchange(false, true, Ordering::Acquire, Ordering::Relaxed);
        led.is_ok().then(|| Leadership(&self.led))
    }

    /// `asleep` is set before the last attempt to lead, and `release` ends the leadership before it reads
    /// `asleep`. So one of the two notices the other, and requests are never without a leader while a worker
    /// sleeps.
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

    /// Ends the leadership and wakes a sleeping worker without work to take it.
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

    /// Makes every worker end. A leader that waits at the doorbell also needs a ring.
    pub(crate) fn stop(&self) {
        self.stop.store(true, Ordering::Release);
        for inbox in &self.inboxes {
            let _state = lock(&inbox.state); // held by a worker between its check of `stop` and its sleep
            inbox.bell.notify_one();
        }
    }

    pub(crate) fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Acquire)
    }
}

/// Every interleaving, with `just loom`. A lost wake-up shows as a deadlock.
#[cfg(all(test, loom))]
mod loom_tests {
    use super::*;
    use loom::thread;
    use std::sync::Arc;

    fn try_lead<'a>(queues: &'a WorkQueues<u32>, worker: usize) -> Option<Leadership<'a>> {
        match queues.wait_for_work(worker, Some(Duration::ZERO)) {
            Wakeup::Leading(leadership) => Some(leadership),
            Wakeup::Work => None,
        }
    }

    /// No worker that is awake is marked as asleep or called: another worker would miss that call.
    fn assert_all_awake(queues: &WorkQueues<u32>) {
        for inbox in &queues.inboxes {
            let state = lock(&inbox.state);
            assert!(!state.asleep && !state.called);
        }
    }

    fn spawn(
        queues: &Arc<WorkQueues<u32>>,
        work: impl FnOnce(&WorkQueues<u32>) + Send + 'static,
    ) -> thread::JoinHandle<()> {
        let queues = Arc::clone(queues);
        thread::spawn(move || work(&queues))
    }

    #[test]
    fn work_for_a_follower_that_goes_to_sleep_reaches_it() {
        loom::model(|| {
            let queues = Arc::new(WorkQueues::<u32>::new(2, 1));
            let leading = try_lead(&queues, 0).expect("no other worker leads");
            let follower = spawn(&queues, |queues| {
                let mut run = Vec::new();
                while queues.take(1, 8, &mut run).is_none() {
                    assert!(try_lead(queues, 1).is_none(), "worker 0 still leads");
                }
                assert_eq!(run, [7]);
            });
            queues.push(1, 0, &[7]);
            follower.join().unwrap();
            assert_all_awake(&queues);
            queues.release(leading);
        });
    }

    #[test]
    fn leadership_passes_to_a_follower_that_goes_to_sleep() {
        loom::model(|| {
            let queues = Arc::new(WorkQueues::<u32>::new(2, 1));
            let leading = try_lead(&queues, 0).expect("no other worker leads");
            let follower = spawn(&queues, |queues| {
                let leadership = loop {
                    if let Some(leadership) = try_lead(queues, 1) {
                        break leadership;
                    }
                };
                queues.release(leadership);
            });
            queues.release(leading);
            follower.join().unwrap(); // worker 0 works elsewhere and never leads again
            assert_all_awake(&queues);
        });
    }

    #[test]
    fn leadership_does_not_pass_to_a_sleeper_that_has_work() {
        let mut model = loom::model::Builder::new();
        model.preemption_bound = Some(3); // three threads have too many interleavings to explore all
        model.check(|| {
            let queues = Arc::new(WorkQueues::<u32>::new(3, 1));
            let leading = try_lead(&queues, 0).expect("no other worker leads");
            let busy = spawn(&queues, |queues| {
                let mut run = Vec::new();
                while queues.take(1, 8, &mut run).is_none() {
                    if let Some(leadership) = try_lead(queues, 1) {
                        queues.release(leadership);
                    }
                } // and works for the rest of the test
            });
            let idle = spawn(&queues, |queues| while try_lead(queues, 2).is_none() {});
            queues.push(1, 0, &[7]);
            queues.release(leading);
            busy.join().unwrap();
            idle.join().unwrap();
        });
    }

    #[test]
    fn a_follower_that_goes_to_sleep_hears_the_stop() {
        loom::model(|| {
            let queues = Arc::new(WorkQueues::<u32>::new(2, 1));
            let leading = try_lead(&queues, 0).expect("no other worker leads");
            let follower = spawn(&queues, |queues| {
                while !queues.is_stopped() {
                    drop(try_lead(queues, 1));
                }
            });
            queues.stop();
            follower.join().unwrap();
            queues.release(leading);
        });
    }
}
