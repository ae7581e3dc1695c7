//! The Leader/Followers pattern (Schmidt et al., POSA volume 2): how worker threads share the work without a
//! dispatcher.
//!
//! Every worker has a seat with an inbox. At any time at most one idle worker is the *leader*: it polls the
//! lanes for requests and shares them out. The other idle workers are *followers*: they wait at their
//! inboxes. A leader that receives work releases the leadership and wakes a sleeping follower to take it, so
//! that requests never wait while a worker is idle. With one worker a request is received, stepped and
//! answered on the same thread. A thread whose inbox is empty takes work from the others, so that all end
//! together.
//!
//! A learner's thread of this process that waits for its batch is a *guest*: it takes the seat of a worker,
//! which stands down (sleeps) meanwhile. So a pool of N threads never has more than N at work, and a waiting
//! learner is one of them.
//!
//! Synchronisation: an inbox's mutex publishes its entries to the thread that takes them, and guards its
//! seat. `WorkQueues::led` orders one leader's accesses to the lanes before the next leader's. The atomics of
//! an inbox are only hints that let a spinning thread poll without the lock; they publish nothing.

use crate::sync::{AtomicBool, AtomicUsize, Condvar, Mutex, MutexGuard, Ordering, lock};
use crate::wait_strategy::Polling;
use crossbeam::utils::CachePadded;
use std::collections::VecDeque;

/// Work for one seat, in one queue per lane, so that no lane waits behind another lane's batch.
struct Inbox<E> {
    state: Mutex<InboxState<E>>,
    bell: Condvar,
    /// How many entries there are.
    ready: AtomicUsize,
    /// A guest has the seat.
    taken: AtomicBool,
}

struct InboxState<E> {
    queues: Vec<VecDeque<E>>,
    next_queue: usize,
    /// Where the owner sleeps or is about to: it sets this before its last attempt to lead.
    asleep: Option<Bed>,
    /// The owner should wake up and try to lead.
    called: bool,
    /// A guest has the seat, so the owner is not woken for work.
    guest: bool,
}

/// Where a worker sleeps.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Bed {
    /// At its inbox.
    Inbox,
    /// At the doorbell, as the leader.
    Door,
}

/// Says that a worker sleeps at the doorbell, which must be rung.
#[must_use]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Ring(pub(crate) bool);

/// The inboxes of all seats, and whether a worker leads.
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
    /// There may be work, or the pool stops.
    Work,
    /// No worker led; now this one does.
    Leading(Leadership<'a>),
}

impl<E> InboxState<E> {
    fn has_work(&self) -> bool {
        !self.queues.iter().all(VecDeque::is_empty)
    }

    /// The next lane in turn that has entries.
    fn next_lane(&self) -> Option<usize> {
        let lanes = self.queues.len();
        (0..lanes).map(|i| (self.next_queue + i) % lanes).find(|lane| !self.queues[*lane].is_empty())
    }
}

impl<E> Inbox<E> {
    /// Wakes the owner if it sleeps. It is called, and not only given work: if another thread takes that
    /// first, it must not sleep on, since `release` counts on it to lead.
    fn wake(&self, state: &mut MutexGuard<'_, InboxState<E>>) -> Ring {
        state.called |= state.asleep.is_some();
        match state.asleep {
            Some(Bed::Inbox) => self.bell.notify_one(),
            Some(Bed::Door) => return Ring(true),
            None => {}
        }
        Ring(false)
    }
}

impl<E: Copy> WorkQueues<E> {
    pub(crate) fn new(workers: usize, lanes: usize) -> Self {
        let inbox = || {
            let queues = (0..lanes).map(|_| VecDeque::new()).collect();
            let state = InboxState { queues, next_queue: 0, asleep: None, called: false, guest: false };
            CachePadded::new(Inbox {
                state: Mutex::new(state),
                bell: Condvar::new(),
                ready: AtomicUsize::new(0),
                taken: AtomicBool::new(false),
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

    /// Puts entries of one lane into a seat's inbox and wakes its owner if that sleeps and has the seat to
    /// itself. Keeps their order.
    pub(crate) fn push(&self, seat: usize, lane: usize, entries: &[E]) -> Ring {
        let inbox = &self.inboxes[seat];
        let mut state = lock(&inbox.state);
        state.queues[lane].extend(entries);
        inbox.ready.fetch_add(entries.len(), Ordering::Relaxed);
        if state.guest { Ring(false) } else { inbox.wake(&mut state) }
    }

    /// Moves up to `most` entries of one lane into `run`: of `lane`, if it is given, or of the next in turn;
    /// of this seat, or of another whose owner has not come to them. Returns the lane.
    ///
    /// Entries are taken half by half, so that the threads of a batch end together. They leave an inbox in
    /// order, whichever threads take them.
    pub(crate) fn take(
        &self,
        seat: usize,
        lane: Option<usize>,
        most: usize,
        run: &mut Vec<E>,
    ) -> Option<usize> {
        let seats = self.inboxes.len();
        (0..seats).find_map(|i| self.take_of((seat + i) % seats, lane, most, run))
    }

    fn take_of(&self, seat: usize, lane: Option<usize>, most: usize, run: &mut Vec<E>) -> Option<usize> {
        let inbox = &self.inboxes[seat];
        if inbox.ready.load(Ordering::Relaxed) == 0 {
            return None; // `sleep` checks again under the lock
        }
        let mut state = lock(&inbox.state);
        let lane = match lane {
            Some(lane) => Some(lane).filter(|lane| !state.queues[*lane].is_empty()),
            None => state.next_lane(),
        }?;
        state.next_queue = (lane + 1) % state.queues.len();
        let queue = &mut state.queues[lane];
        let count = queue.len().div_ceil(2).min(most);
        run.extend(queue.drain(..count));
        inbox.ready.fetch_sub(count, Ordering::Relaxed);
        Some(lane)
    }

    /// Whether there is work that this worker may take. One whose seat a guest has may take none.
    pub(crate) fn has_work_for(&self, worker: usize) -> bool {
        !self.stands_down(worker) && self.inboxes.iter().any(|inbox| inbox.ready.load(Ordering::Relaxed) > 0)
    }

    /// Whether a guest has the worker's seat.
    pub(crate) fn stands_down(&self, worker: usize) -> bool {
        self.inboxes[worker].taken.load(Ordering::Relaxed)
    }

    /// A guest takes a seat: this one, or the next one that no other guest has. `None` if all are taken.
    pub(crate) fn sit(&self, seat: usize) -> Option<usize> {
        let seats = self.inboxes.len();
        (0..seats).map(|i| (seat + i) % seats).find(|seat| {
            let inbox = &self.inboxes[*seat];
            let mut state = lock(&inbox.state);
            let is_free = !std::mem::replace(&mut state.guest, true);
            inbox.taken.store(true, Ordering::Relaxed);
            is_free
        })
    }

    /// A guest gives its seat back. The owner is woken if there is work, or if it `must_lead` because lanes
    /// must be polled and no worker does it.
    pub(crate) fn stand_up(&self, seat: usize, must_lead: bool) -> Ring {
        let inbox = &self.inboxes[seat];
        let mut state = lock(&inbox.state);
        state.guest = false;
        inbox.taken.store(false, Ordering::Relaxed);
        // `release` ends the leadership before it looks for a worker that may take it; one of the two
        // notices the other.
        let leaderless = must_lead && !self.led.load(Ordering::SeqCst);
        if leaderless || state.has_work() { inbox.wake(&mut state) } else { Ring(false) }
    }

    /// Waits at the inbox until there is work or no worker leads. Polls, then blocks.
    pub(crate) fn wait_for_work(&self, worker: usize, polling: Polling) -> Wakeup<'_> {
        let mut polls = polling.begin();
        while !self.stands_down(worker) {
            if self.has_work_for(worker) || self.is_stopped() {
                return Wakeup::Work;
            }
            if let Some(leadership) = self.try_lead() {
                return Wakeup::Leading(leadership);
            }
            if !polls.pause() {
                break;
            }
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
        lock(&inbox.state).asleep = Some(Bed::Inbox);
        let leadership = self.try_lead();
        let mut state = lock(&inbox.state);
        if leadership.is_none() {
            while !state.called && !self.is_stopped() && (state.guest || !state.has_work()) {
                state = inbox.bell.wait(state).unwrap_or_else(|poisoned| poisoned.into_inner());
            }
        }
        state.asleep = None;
        state.called = false;
        leadership.map_or(Wakeup::Work, Wakeup::Leading)
    }

    /// The leader sleeps in `wait`, which a ring of the doorbell ends, unless it has work.
    pub(crate) fn sleep_at_the_door(&self, worker: usize, wait: impl FnOnce()) {
        let inbox = &self.inboxes[worker];
        let mut state = lock(&inbox.state);
        if self.is_stopped() || (!state.guest && state.has_work()) {
            return;
        }
        state.asleep = Some(Bed::Door);
        drop(state);
        wait();
        let mut state = lock(&inbox.state);
        state.asleep = None;
        state.called = false;
    }

    /// Ends the leadership and wakes a sleeping worker without work to take it. Sleepers with work wake up
    /// for that, but are called too: if another thread takes their work first, they must not sleep on.
    pub(crate) fn release(&self, leadership: Leadership<'_>) {
        drop(leadership);
        for inbox in &self.inboxes {
            let mut state = lock(&inbox.state);
            if state.asleep.is_some() && !state.called && !state.guest {
                state.called = true;
                inbox.bell.notify_one();
                if !state.has_work() {
                    return;
                }
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
    use crate::wait_strategy::WaitStrategy;
    use loom::thread;
    use std::sync::Arc;

    fn try_lead<'a>(queues: &'a WorkQueues<u32>, worker: usize) -> Option<Leadership<'a>> {
        match queues.wait_for_work(worker, WaitStrategy::Block.polling(1)) {
            Wakeup::Leading(leadership) => Some(leadership),
            Wakeup::Work => None,
        }
    }

    /// No worker that is awake is marked as asleep or called: another worker would miss that call.
    fn assert_all_awake(queues: &WorkQueues<u32>) {
        for inbox in &queues.inboxes {
            let state = lock(&inbox.state);
            assert!(state.asleep.is_none() && !state.called);
        }
    }

    /// What a worker does while it has nothing to do, with the bell `rung` as the doorbell.
    fn wait_for_work(queues: &WorkQueues<u32>, worker: usize, rung: &(Mutex<bool>, Condvar)) {
        if let Some(leadership) = try_lead(queues, worker) {
            queues.sleep_at_the_door(worker, || {
                let mut state = lock(&rung.0);
                while !std::mem::take(&mut *state) {
                    state = rung.1.wait(state).unwrap();
                }
            });
            queues.release(leadership);
        }
    }

    fn ring(rung: &(Mutex<bool>, Condvar), ring: Ring) {
        if ring.0 {
            *lock(&rung.0) = true;
            rung.1.notify_one();
        }
    }

    fn push(queues: &WorkQueues<u32>, seat: usize) {
        assert_eq!(queues.push(seat, 0, &[7]), Ring(false), "no thread sleeps at the door");
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
                while queues.take(1, None, 8, &mut run).is_none() {
                    assert!(try_lead(queues, 1).is_none(), "worker 0 still leads");
                }
                assert_eq!(run, [7]);
            });
            push(&queues, 1);
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
    fn leadership_passes_to_the_worker_that_gets_no_work() {
        let mut model = loom::model::Builder::new();
        model.preemption_bound = Some(3); // three threads have too many interleavings to explore all
        model.check(|| {
            let queues = Arc::new(WorkQueues::<u32>::new(3, 1));
            let leading = try_lead(&queues, 0).expect("no other worker leads");
            // One of the two takes the work and has it for the rest of the test; the other one must lead.
            let worker = |worker: usize| {
                spawn(&queues, move |queues| {
                    while queues.take(worker, None, 8, &mut Vec::new()).is_none() {
                        let Some(leadership) = try_lead(queues, worker) else { continue };
                        if !queues.has_work_for(worker) {
                            return;
                        }
                        queues.release(leadership);
                    }
                })
            };
            let (busy, idle) = (worker(1), worker(2));
            push(&queues, 1);
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

    /// The only worker sleeps at the door or is about to.
    #[test]
    fn what_a_guest_leaves_behind_reaches_the_owner_of_its_seat() {
        loom::model(|| {
            let queues = Arc::new(WorkQueues::<u32>::new(1, 1));
            let rung = Arc::new((Mutex::new(false), Condvar::new()));
            assert_eq!(queues.sit(0), Some(0));
            assert_eq!(queues.sit(0), None, "a seat has one guest");
            let bell = Arc::clone(&rung);
            let owner = spawn(&queues, move |queues| {
                let mut run = Vec::new();
                while queues.stands_down(0) || queues.take(0, None, 8, &mut run).is_none() {
                    wait_for_work(queues, 0, &bell);
                }
                assert_eq!(run, [7]);
            });
            ring(&rung, queues.push(0, 0, &[7]));
            ring(&rung, queues.stand_up(0, false));
            owner.join().unwrap();
            assert_all_awake(&queues);
        });
    }

    #[test]
    fn work_that_comes_when_a_guest_sits_down_reaches_one_of_the_two() {
        let mut model = loom::model::Builder::new();
        model.preemption_bound = Some(3);
        model.check(|| {
            let queues = Arc::new(WorkQueues::<u32>::new(1, 1));
            let rung = Arc::new((Mutex::new(false), Condvar::new()));
            let bell = Arc::clone(&rung);
            let owner = spawn(&queues, move |queues| {
                let mut run = Vec::new();
                while !queues.is_stopped() {
                    if queues.stands_down(0) || queues.take(0, None, 8, &mut run).is_none() {
                        wait_for_work(queues, 0, &bell);
                    } else {
                        queues.stop();
                    }
                }
            });
            let bell = Arc::clone(&rung);
            let sender = spawn(&queues, move |queues| ring(&bell, queues.push(0, 0, &[7])));
            let mut run = Vec::new();
            assert_eq!(queues.sit(0), Some(0));
            if queues.take(0, Some(0), 8, &mut run).is_some() {
                queues.stop();
                ring(&rung, Ring(true));
            }
            ring(&rung, queues.stand_up(0, false));
            sender.join().unwrap();
            owner.join().unwrap();
        });
    }

    #[test]
    fn a_worker_whose_guest_leaves_takes_the_leadership_that_is_needed() {
        loom::model(|| {
            let queues = Arc::new(WorkQueues::<u32>::new(2, 1));
            let leading = try_lead(&queues, 1).expect("no other worker leads");
            assert_eq!(queues.sit(0), Some(0));
            let owner = spawn(&queues, |queues| {
                let leadership = loop {
                    if let Some(leadership) = try_lead(queues, 0) {
                        break leadership;
                    }
                };
                drop(leadership);
            });
            let other = spawn(&queues, |queues| assert_eq!(queues.stand_up(0, true), Ring(false)));
            queues.release(leading); // worker 1 works elsewhere and never leads again
            other.join().unwrap();
            owner.join().unwrap();
        });
    }
}
