//! Several lanes that share worker threads.

use crate::harness::{start, wait_until};
use crate::{MAX_THREADS, STEPS};
use smaclite_tests::LanePlan;
use smaclite_tests::fault::{Fault, Gate};
use std::sync::{Arc, Mutex};

/// Environments that a worker steps before it turns to another lane.
const RUN: usize = 16;

#[test]
fn lanes_take_turns_on_a_worker() {
    const N: usize = if cfg!(miri) { 2 * RUN } else { 4 * RUN };
    let gate = Gate::default();
    let log = Arc::new(Mutex::new(Vec::new()));
    let logged = |name: char| {
        let faults = (0..N).map(|env| (env, Fault::Log(Arc::clone(&log), name))).collect();
        LanePlan { faults, ..LanePlan::toy(N) }
    };
    let lanes = [LanePlan::toy(1).fault(0, Fault::Gate(gate.clone())), logged('a'), logged('b')];
    let (_pool, mut learners) = start(1, &lanes);
    let mut rows = Vec::new();
    for learner in &mut learners {
        learner.send_reset_all(None);
        rows.push(learner.batch());
    }
    // The only worker waits at the gate while the other two lanes send.
    gate.close();
    learners[0].step_rows(&rows[0]);
    gate.wait_for_arrival();
    learners[1].step_rows(&rows[1]);
    learners[2].step_rows(&rows[2]);
    gate.open();
    learners[1..].iter().for_each(|learner| drop(learner.batch()));
    let mut ahead = 0isize;
    for lane in log.lock().unwrap().iter() {
        ahead += if *lane == 'a' { 1 } else { -1 };
        assert!(ahead.unsigned_abs() <= RUN, "a lane had more than one run before the other's turn");
    }
    assert_eq!(log.lock().unwrap().len(), 2 * N);
}

#[test]
fn a_small_lane_is_served_beside_a_large_one_that_is_always_busy() {
    for threads in 1..=MAX_THREADS {
        let lanes = [LanePlan::toy(20), LanePlan::toy(1), LanePlan { batch_size: 2, ..LanePlan::toy(7) }];
        let (pool, learners) = start(threads, &lanes);
        std::thread::scope(|scope| {
            for mut learner in learners {
                scope.spawn(move || {
                    learner.send_reset_all(None);
                    for _ in 0..STEPS {
                        let rows = learner.batch();
                        learner.step_rows(&rows);
                    }
                });
            }
        });
        for lane in 0..3 {
            wait_until("every lane has its frames", || pool.lane(lane).stats().frames >= STEPS as u64);
        }
    }
}

#[test]
fn a_pool_stops_while_learners_wait_and_workers_work() {
    for threads in 1..=MAX_THREADS {
        let lanes = [LanePlan::toy(20), LanePlan { batch_size: 1, ..LanePlan::toy(5) }];
        let (pool, mut learners) = start(threads, &lanes);
        learners.iter_mut().for_each(|learner| learner.send_reset_all(None));
        drop(pool);
        assert_eq!(learners.len(), 2, "the pool stopped while its learners were still there");
    }
}
