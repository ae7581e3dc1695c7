//! Several lanes that share worker threads.

use crate::harness::{Learner, all, legal_actions, start, wait_until};
use crate::{MAX_THREADS, STEPS};
use smaclite_pool::FollowerId;
use smaclite_pool::transport::{Request, RequestKind, RequestNumber, SessionId};
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

/// A big lane whose environments but the first are logged, and a small one.
fn big_and_small(gate: &Gate, log: &Arc<Mutex<Vec<char>>>) -> [LanePlan; 2] {
    let logged = |name| Fault::Log(Arc::clone(log), name);
    let rest = (1..4 * RUN).map(|env| (env, logged('A'))).collect();
    let big = LanePlan { faults: rest, ..LanePlan::toy(4 * RUN) }.fault(0, Fault::Gate(gate.clone()));
    [big, LanePlan::toy(1).fault(0, logged('b'))]
}

/// Environments of the big lane that were served before the small one, and after it.
fn around_the_small_one(log: &Mutex<Vec<char>>) -> (usize, usize) {
    let log = log.lock().unwrap();
    let before = log.iter().position(|lane| *lane == 'b').expect("the small lane was served");
    (before, log.len() - 1 - before)
}

/// Workers accepted requests only when no lane had anything left to take: a lane of one environment waited
/// for the whole step of a big one.
#[test]
fn what_is_sent_to_an_idle_lane_is_accepted_between_two_runs_of_a_busy_one() {
    let (gate, log) = (Gate::default(), Arc::default());
    let (_pool, mut learners) = start(1, &big_and_small(&gate, &log));
    learners.iter_mut().for_each(|learner| learner.send_reset_all(None));
    let rows: Vec<_> = learners.iter().map(Learner::batch).collect();
    gate.close();
    learners[0].step_rows(&rows[0]);
    gate.wait_for_arrival();
    learners[1].step_rows(&rows[1]);
    gate.open();
    learners.iter().for_each(|learner| drop(learner.batch()));
    let (before, after) = around_the_small_one(&log);
    assert!(before < 2 * RUN && after >= RUN, "after {before} environments of the big lane, before {after}");
}

/// A learner of the pool's process that has the only place does not keep the lanes of others waiting.
#[test]
fn a_lane_is_served_while_a_learner_has_the_only_place() {
    let (gate, log) = (Gate::default(), Arc::default());
    let (pool, mut learners) = start(1, &big_and_small(&gate, &log));
    learners.iter_mut().for_each(|learner| learner.send_reset_all(None));
    let rows: Vec<_> = learners.iter().map(Learner::batch).collect();
    gate.close();
    let mut local = pool.handle().local_learner(0, SessionId(1)).expect("the lane's session");
    let (env_ids, body) = (all(4 * RUN), legal_actions(&rows[0]));
    let (session, number) = (SessionId(1), RequestNumber(2));
    let request = Request { session, number, kind: RequestKind::Step, env_ids: &env_ids, body: &body };
    local.order(&request).expect("the actions are available");
    std::thread::scope(|scope| {
        scope.spawn(|| while local.serve() {});
        gate.wait_for_arrival();
        learners[1].step_rows(&rows[1]);
        learners[1].batch();
        gate.open();
    });
    learners[0].batch();
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
fn a_follower_reads_what_its_environment_does_until_it_leaves() {
    let (pool, mut learners) = start(1, &[LanePlan::toy(2)]);
    let [first, second] = [1, 2].map(FollowerId);
    [first, second].iter().for_each(|follower| pool.lane(0).follow(&[1], *follower).expect("room"));
    let n_read = |env, follower| pool.lane(0).read_log(env, follower, &mut usize::MAX.clone()).len();
    pool.lane(0).unfollow(1, first);
    learners[0].send_reset_all(None);
    learners[0].batch();
    // The episode of before the reset, and the present one.
    assert_eq!([n_read(0, second), n_read(1, first), n_read(1, second)], [0, 0, 2]);
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
