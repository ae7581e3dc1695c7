//! Several lanes, one set of workers.

use crate::game::{Gate, Oddity};
use crate::harness::{LaneSetup, Row, all, settle, start};
use crate::{MANY_THREADS, STEPS};
use std::sync::{Arc, Mutex};

/// Environments a worker takes at a time.
const RUN: usize = 16;

#[test]
fn lanes_take_turns_on_a_worker() {
    const N: usize = if cfg!(miri) { 2 * RUN } else { 4 * RUN };
    let gate = Gate::default();
    let log = Arc::new(Mutex::new(Vec::new()));
    let (held, written) = (gate.clone(), Arc::clone(&log));
    let oddity = move |lane: usize, _| Oddity {
        gate: (lane == 0).then(|| held.clone()),
        log: (lane > 0).then(|| (Arc::clone(&written), ['-', 'a', 'b'][lane])),
        ..Oddity::default()
    };
    let lanes = [LaneSetup::new(1), LaneSetup::new(N), LaneSetup::new(N)];
    let (_pool, mut learners) = start(1, &lanes, oddity);
    let mut first = Vec::new();
    for (learner, setup) in learners.iter_mut().zip(lanes) {
        learner.send_reset(None, &all(setup.num_envs), setup.num_envs);
        first.push(learner.batch());
    }
    // The only worker stands at the gate while the other two lanes send.
    gate.close();
    let play = |lane: usize, learners: &mut [crate::harness::Learner]| {
        let actions: Vec<_> = first[lane].iter().flat_map(Row::legal_actions).collect();
        learners[lane].send_step(&all(lanes[lane].num_envs), &actions);
    };
    play(0, &mut learners);
    gate.somebody_waits();
    play(1, &mut learners);
    play(2, &mut learners);
    gate.open();
    learners[1..].iter().for_each(|learner| drop(learner.batch()));
    let mut ahead = 0isize;
    for mark in log.lock().unwrap().iter() {
        ahead += if *mark == 'a' { 1 } else { -1 };
        assert!(ahead.unsigned_abs() <= RUN, "a lane had more than a run before the other's turn");
    }
    assert_eq!(log.lock().unwrap().len(), 2 * N);
}

#[test]
fn a_small_lane_is_served_beside_a_large_one_that_never_rests() {
    for threads in 1..=MANY_THREADS {
        let lanes = [LaneSetup::new(20), LaneSetup::new(1), LaneSetup { batch_size: 2, ..LaneSetup::new(7) }];
        let (pool, learners) = start(threads, &lanes, |_, _| Oddity::default());
        std::thread::scope(|scope| {
            for (mut learner, setup) in learners.into_iter().zip(lanes) {
                scope.spawn(move || {
                    learner.send_reset(None, &all(setup.num_envs), setup.num_envs);
                    for _ in 0..STEPS {
                        let rows = learner.batch();
                        let ids: Vec<_> = rows.iter().map(|row| row.env).collect();
                        let actions: Vec<_> = rows.iter().flat_map(Row::legal_actions).collect();
                        learner.send_step(&ids, &actions);
                    }
                });
            }
        });
        for lane in 0..3 {
            settle("every lane got its frames", || pool.stats(lane).frames >= STEPS as u64);
        }
    }
}

#[test]
fn a_pool_stops_while_learners_wait_and_workers_work() {
    for threads in 1..=MANY_THREADS {
        let lanes = [LaneSetup::new(20), LaneSetup { batch_size: 1, ..LaneSetup::new(5) }];
        let (pool, mut learners) = start(threads, &lanes, |_, _| Oddity::default());
        for (learner, setup) in learners.iter_mut().zip(lanes) {
            learner.send_reset(None, &all(setup.num_envs), setup.num_envs);
        }
        drop(pool);
        assert_eq!(learners.len(), 2, "their ends are still here: nobody was waited for");
    }
}
