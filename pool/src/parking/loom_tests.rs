//! The hand-off from who accepts a request to who carries it out, in every interleaving (`just loom`), with
//! the parking and the work of a pool and with lanes that only count. A lost wake-up shows as a deadlock.

use super::*;
use crate::wait_strategy::WaitStrategy;
use crate::work::Work;
use loom::model::Builder;
use loom::sync::Arc;
use loom::thread::{self, JoinHandle};

/// A pool of one lane.
struct Pool {
    parking: Parking,
    work: Work,
    num_envs: usize,
    /// The lane's requests come from another process.
    is_polled: bool,
    /// Requests that were sent and not accepted.
    requests: Mutex<usize>,
    rung: (Mutex<bool>, Condvar),
    /// Environments that were carried out.
    done: (Mutex<usize>, Condvar),
}

impl Pool {
    /// Accepts a request to all environments. `present` threads serve it anyway.
    fn accept(&self, present: usize) {
        let threads = match &self.work {
            Work::Synchronous(ranges) => ranges.publish(),
            Work::Asynchronous(queue) => {
                (0..self.num_envs as u32).for_each(|env| queue.push(env).expect("room for all"));
                self.num_envs
            }
        };
        self.parking.published(threads - present, self);
    }

    fn serve(&self, thread: usize, searching: &mut Option<Searching<'_>>) -> bool {
        let Some(envs) = self.work.take(thread) else { return false };
        if let Some(searching) = searching.take() {
            self.parking.found(searching, self);
        }
        *lock(&self.done.0) += envs.len();
        self.done.1.notify_one();
        true
    }

    fn work(&self, worker: usize) {
        while let Some(searching) = self.parking.search(worker, self, WaitStrategy::Block.polling(1)) {
            let mut searching = Some(searching);
            while self.parking.may_work(worker) && self.serve(worker, &mut searching) {}
        }
    }

    /// A request of another process.
    fn send(&self) {
        *lock(&self.requests) += 1;
        self.ring();
    }

    /// A request of a learner's thread, which works while it waits.
    fn step(&self) {
        let place = self.parking.substitute(0);
        self.accept(usize::from(place.is_some()));
        if let Some(worker) = place {
            while self.serve(worker, &mut None) {}
            self.parking.reinstate(worker, self);
        }
    }

    /// Waits until as many environments were carried out.
    fn wait_for(&self, count: usize) {
        let mut done = lock(&self.done.0);
        while *done < count {
            done = self.done.1.wait(done).unwrap();
        }
        assert_eq!(*done, count);
    }
}

impl Source for Pool {
    fn has_work(&self) -> bool {
        !self.work.is_empty()
    }

    fn needs_polling(&self) -> bool {
        self.is_polled
    }

    fn poll(&self) -> bool {
        let any = std::mem::take(&mut *lock(&self.requests)) > 0;
        if any {
            self.accept(0);
        }
        any
    }

    fn wait_at_doorbell(&self) {
        let mut rung = lock(&self.rung.0);
        while !std::mem::take(&mut *rung) {
            rung = self.rung.1.wait(rung).unwrap();
        }
    }

    fn ring(&self) {
        *lock(&self.rung.0) = true;
        self.rung.1.notify_one();
    }
}

/// Runs `learner` with a pool of so many workers, which must have carried out `expected` environments in the
/// end.
fn model(workers: usize, synchronous: bool, is_polled: bool, expected: usize, learner: fn(&Arc<Pool>)) {
    let mut builder = Builder::new();
    // Enough for every handshake between two threads; all interleavings of three would take hours. `just
    // loom` with LOOM_MAX_PREEMPTIONS=3 takes five minutes.
    let default = if workers == 1 { 2 } else { 1 };
    builder.preemption_bound = builder.preemption_bound.or(Some(default));
    builder.check(move || {
        let num_envs = 2;
        let pool = Arc::new(Pool {
            parking: Parking::new(workers),
            work: Work::new(num_envs, synchronous, workers),
            num_envs,
            is_polled,
            requests: Mutex::new(0),
            rung: (Mutex::new(false), Condvar::new()),
            done: (Mutex::new(0), Condvar::new()),
        });
        let threads: Vec<_> =
            (0..workers).map(|worker| spawn(&pool, move |pool| pool.work(worker))).collect();
        learner(&pool);
        pool.wait_for(expected);
        pool.parking.stop(&*pool);
        threads.into_iter().for_each(|thread| thread.join().unwrap());
        assert_eq!(pool.parking.searching.load(Ordering::SeqCst), 0);
        assert!(!pool.parking.polled.load(Ordering::SeqCst), "{workers} workers, polled: {is_polled}");
    });
}

fn spawn(pool: &Arc<Pool>, work: impl FnOnce(&Pool) + Send + 'static) -> JoinHandle<()> {
    let pool = Arc::clone(pool);
    thread::spawn(move || work(&pool))
}

#[test]
fn requests_of_another_process_are_carried_out() {
    for synchronous in [true, false] {
        for workers in [1, 2] {
            model(workers, synchronous, true, 2, |pool| pool.send());
        }
        model(1, synchronous, true, 4, |pool| {
            pool.send();
            pool.wait_for(2);
            pool.send();
        });
    }
}

#[test]
fn requests_of_a_learner_that_works_itself_are_carried_out() {
    for synchronous in [true, false] {
        for workers in [1, 2] {
            model(workers, synchronous, false, 2, |pool| pool.step());
        }
        model(1, synchronous, false, 4, |pool| {
            pool.step();
            pool.wait_for(2);
            pool.step();
        });
    }
}

/// The only worker is parked, substituted or about to be either when the request comes.
#[test]
fn a_request_is_carried_out_while_a_learner_takes_the_only_place_and_leaves() {
    for synchronous in [true, false] {
        model(1, synchronous, true, 2, |pool| {
            let other = spawn(pool, |pool| {
                if let Some(worker) = pool.parking.substitute(0) {
                    pool.parking.reinstate(worker, pool);
                }
            });
            pool.send();
            other.join().unwrap();
        });
    }
}

/// Work that a learner publishes, and leaves to the workers.
#[test]
fn work_is_carried_out_without_the_learner() {
    for synchronous in [true, false] {
        for workers in [1, 2] {
            model(workers, synchronous, false, 2, |pool| pool.accept(0));
        }
    }
}

#[test]
fn a_pool_that_stops_leaves_no_worker_parked() {
    for is_polled in [true, false] {
        for workers in [1, 2] {
            model(workers, true, is_polled, 0, |_| {});
        }
    }
}
