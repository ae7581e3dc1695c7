//! The hand-off from who accepts a request to who carries it out, in every interleaving (`just loom`), with
//! the crew and the work of a pool and with lanes that only count. A lost wake-up shows as a deadlock.

use super::*;
use crate::sync::{Mutex, lock};
use crate::wait_strategy::WaitStrategy;
use crate::work::Work;
use loom::model::Builder;
use loom::sync::{Arc, Condvar};
use loom::thread::{self, JoinHandle};
use std::ops::Range;

/// A pool of one lane.
struct Pool {
    crew: Crew,
    work: Work,
    num_envs: u32,
    synchronous: bool,
    /// Whether the server was rung, or has to stop.
    rung: (Mutex<bool>, Condvar),
    /// Environments that were carried out.
    done: (Mutex<usize>, Condvar),
}

impl Source for Pool {
    type Chunk = Range<usize>;

    fn has_work(&self) -> bool {
        !self.work.is_empty()
    }

    fn receive(&self) -> bool {
        false
    }

    fn take(&self, thread: usize, _: &mut usize) -> Option<Range<usize>> {
        self.work.take(thread)
    }
}

impl Pool {
    /// Accepts a request to all environments.
    fn publish(&self) {
        let threads = if self.synchronous {
            self.work.publish()
        } else {
            self.work.add(&(0..self.num_envs).collect::<Vec<_>>());
            self.num_envs as usize
        };
        self.crew.wake(threads - 1);
    }

    fn serve(&self, envs: Range<usize>) {
        *lock(&self.done.0) += envs.len();
        self.done.1.notify_one();
    }

    fn serve_all(&self) {
        while let Some(envs) = self.work.take(self.crew.server()) {
            self.serve(envs);
        }
    }

    /// What the server does, without requests of other processes.
    fn be_server(&self) {
        while !self.crew.is_stopped() {
            if !self.crew.has_callers() {
                self.serve_all();
            }
            let mut rung = lock(&self.rung.0);
            while !std::mem::take(&mut *rung) {
                rung = self.rung.1.wait(rung).unwrap();
            }
        }
    }

    fn ring(&self) {
        *lock(&self.rung.0) = true;
        self.rung.1.notify_one();
    }

    /// A request of a learner's thread, which works while it waits, or leaves at once.
    fn call(&self, stays: bool) {
        self.crew.enter();
        self.publish();
        if stays {
            self.serve_all();
        }
        if self.crew.leave(self) {
            self.ring();
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

/// Runs `learner` with a pool of so many threads, which must have carried out `expected` environments in the
/// end.
fn model(threads: usize, synchronous: bool, expected: usize, learner: fn(&Arc<Pool>)) {
    let mut builder = Builder::new();
    // Enough for every handshake between two threads; all interleavings of three would take hours. `just
    // loom` with LOOM_MAX_PREEMPTIONS=3 takes five minutes.
    let default = if threads == 1 { 2 } else { 1 };
    builder.preemption_bound = builder.preemption_bound.or(Some(default));
    builder.check(move || {
        let num_envs = 2;
        let pool = Arc::new(Pool {
            crew: Crew::new(threads),
            work: Work::new(num_envs, synchronous, threads),
            num_envs: num_envs as u32,
            synchronous,
            rung: (Mutex::new(false), Condvar::new()),
            done: (Mutex::new(0), Condvar::new()),
        });
        let mut crew = vec![spawn(&pool, Pool::be_server)];
        for index in 0..threads - 1 {
            let polling = WaitStrategy::Block.polling(1);
            crew.push(spawn(&pool, move |pool| {
                pool.crew.help(index, polling, pool, |envs| pool.serve(envs))
            }));
        }
        learner(&pool);
        pool.wait_for(expected);
        pool.crew.stop();
        pool.ring();
        crew.into_iter().for_each(|thread| thread.join().unwrap());
        assert!(!pool.crew.has_callers() && pool.work.is_empty());
    });
}

fn spawn(pool: &Arc<Pool>, work: impl FnOnce(&Pool) + Send + 'static) -> JoinHandle<()> {
    let pool = Arc::clone(pool);
    thread::spawn(move || work(&pool))
}

#[test]
fn requests_of_a_caller_are_carried_out() {
    for synchronous in [true, false] {
        for threads in [1, 2] {
            model(threads, synchronous, 2, |pool| pool.call(true));
        }
        model(1, synchronous, 4, |pool| {
            pool.call(true);
            pool.wait_for(2);
            pool.call(true);
        });
    }
}

/// By the server or a helper, which is woken if it sleeps.
#[test]
fn work_that_a_caller_leaves_is_carried_out() {
    for synchronous in [true, false] {
        for threads in [1, 2] {
            model(threads, synchronous, 2, |pool| pool.call(false));
        }
    }
}

/// Neither the server nor the helper may take it before the other one has left, too.
#[test]
fn work_that_is_left_while_another_learner_calls_is_carried_out() {
    for threads in [1, 2] {
        model(threads, false, 2, |pool| {
            let other = spawn(pool, |pool| {
                pool.crew.enter();
                if pool.crew.leave(pool) {
                    pool.ring();
                }
            });
            pool.call(false);
            other.join().unwrap();
        });
    }
}

/// Requests of other processes: the server, here this thread, works on them, and a helper takes part.
#[test]
fn requests_that_the_server_accepts_are_carried_out() {
    for synchronous in [true, false] {
        model(2, synchronous, 2, |pool| {
            pool.publish();
            pool.serve_all();
        });
    }
}

#[test]
fn a_pool_that_stops_leaves_no_thread_asleep() {
    for threads in [1, 2] {
        model(threads, true, 0, |_| {});
    }
}
