//! Resets and changes of the session while requests are being processed: nothing of an old epoch or session
//! reaches the new one, and what follows does not depend on how far the workers were.

use crate::STEPS;
use crate::harness::{all, assert_same, legal_actions, start, start_one};
use smaclite_pool::transport::{Request, RequestKind, RequestNumber, Seeds, SessionId};
use smaclite_pool::{Autoreset, Rejection};
use smaclite_tests::fault::{Fault, Gate};
use smaclite_tests::{LanePlan, Reference, Row};
use std::time::Duration;

fn step_all(reference: &mut Reference, actions: &[i32]) {
    const N_AGENTS: usize = 2;
    for (env, actions) in (0..).zip(actions.chunks(N_AGENTS)) {
        reference.step(env, actions);
    }
}

/// Several times: environment 1 waits at a gate in its step, all environments are reset, and the gate opens.
fn check_reset(plan: LanePlan, threads: usize, seed: Option<u64>) {
    let context = format!("{threads} threads, {:?}", plan.autoreset);
    let (gate, num_envs) = (Gate::default(), plan.num_envs);
    let plan = plan.fault(1, Fault::Gate(gate.clone()));
    let (_pool, mut learner) = start_one(threads, &plan);
    let mut reference = Reference::new(&plan);
    learner.send_reset_all(None);
    reference.reset_all(None);
    for _ in 0..STEPS.min(12) {
        let rows = learner.rows_of_all();
        let actions = legal_actions(&rows);
        gate.close();
        learner.send_step(&all(num_envs), &actions);
        if plan.autoreset == Autoreset::Disabled && rows.iter().any(Row::ended) {
            let rejection = learner.rejection();
            assert!(matches!(rejection, Rejection::FinishedEnv { .. }), "{rejection}");
        } else {
            step_all(&mut reference, &actions);
            if !rows[1].ended() {
                gate.wait_for_arrival(); // otherwise its step is a reset, which does not wait at the gate
            }
        }
        learner.send_reset_all(seed);
        reference.reset_all(seed);
        gate.open();
        let rows = learner.rows_of_all();
        rows.iter().for_each(|row| assert_same(row, reference.row(row.env()), &context));
        let actions = legal_actions(&rows);
        learner.send_step(&all(num_envs), &actions);
        step_all(&mut reference, &actions);
    }
}

#[test]
fn a_reset_of_all_drops_the_results_of_earlier_requests() {
    const N: usize = 6;
    for autoreset in [Autoreset::NextStep, Autoreset::SameStep, Autoreset::Disabled] {
        for (batch_size, threads) in [(N, 1), (N, 2), (2, 1), (2, 3)] {
            for seed in [None, Some(9)] {
                check_reset(LanePlan { batch_size, autoreset, ..LanePlan::toy(N) }, threads, seed);
            }
        }
    }
}

/// A worker that was busy with another lane once found steps of an old epoch and resets of the new one in its
/// queue, and gave the resets no slot: the learner never got an answer.
#[test]
fn resets_that_wait_behind_steps_of_an_old_epoch_are_answered() {
    let gate = Gate::default();
    let lanes = [LanePlan::toy(1).fault(0, Fault::Gate(gate.clone())), LanePlan::toy(40)];
    let (_pool, mut learners) = start(1, &lanes);
    let [busy, learner] = &mut learners[..] else { unreachable!("two lanes") };
    busy.send_reset_all(None);
    let rows = busy.batch();
    learner.send_reset_all(None);
    let before = learner.batch();
    gate.close();
    busy.step_rows(&rows);
    gate.wait_for_arrival();
    learner.step_rows(&before);
    learner.send_reset_all(Some(3));
    gate.open();
    let mut reference = Reference::new(&lanes[1]);
    reference.reset_all(Some(3));
    let rows = learner.batch();
    assert_eq!(rows.iter().map(Row::env).collect::<Vec<_>>(), all(40));
    rows.iter().for_each(|row| assert_same(row, reference.row(row.env()), "after the reset"));
}

/// The reset was accepted although threads were still writing to a frame, which it dropped (Miri).
#[test]
fn a_pool_that_ends_while_a_reset_waits_frees_no_frame_that_is_written() {
    for batch_size in [6, 2] {
        for is_local in [true, false] {
            let gate = Gate::default();
            let plan = LanePlan { batch_size, ..LanePlan::toy(6) }.fault(1, Fault::Gate(gate.clone()));
            let (pool, mut learner) = start_one(2, &plan);
            learner.send_reset_all(None);
            let rows = learner.rows_of_all();
            gate.close();
            learner.step_rows(&rows);
            gate.wait_for_arrival();
            std::thread::scope(|scope| {
                if is_local {
                    let mut local = pool.handle().local_learner(0, SessionId(1)).expect("the lane's session");
                    scope.spawn(move || {
                        let (session, number) = (SessionId(1), RequestNumber(3));
                        let kind = RequestKind::Reset { seeds: Seeds::Continue, levels: false };
                        let request = Request { session, number, kind, env_ids: &all(6), body: &[] };
                        local.order(&request).expect("nothing to refuse");
                    });
                } else {
                    learner.send_reset_all(None);
                }
                std::thread::sleep(Duration::from_millis(10));
                scope.spawn(|| drop(pool));
                std::thread::sleep(Duration::from_millis(10));
                gate.open();
            });
            assert_eq!(learner.rejections(), []);
        }
    }
}

#[test]
fn a_new_learner_receives_nothing_of_the_old_one() {
    const N: usize = 4;
    for (batch_size, threads) in [(N, 1), (N, 2), (1, 2), (3, 4)] {
        let gate = Gate::default();
        let plan = LanePlan { batch_size, ..LanePlan::toy(N) }.fault(0, Fault::Gate(gate.clone()));
        let (pool, mut learner) = start_one(threads, &plan);
        // Batches of three never hold all four environments.
        let receive = |learner: &crate::harness::Learner| match batch_size {
            3 => learner.batch(),
            _ => learner.rows_of_all(),
        };
        learner.send_reset_all(Some(7));
        let rows = receive(&learner);
        gate.close();
        learner.step_rows(&rows);
        if rows.iter().any(|row| row.env() == 0) {
            gate.wait_for_arrival();
        }
        // `set_session` may wait for an environment that is being stepped.
        std::thread::scope(|scope| {
            scope.spawn(|| pool.lane(0).set_session(None));
            gate.open();
        });
        learner.step_rows(&rows); // the dead learner's last request, still in the queue
        pool.lane(0).set_session(Some(SessionId(2)));
        (learner.session, learner.number) = (2, 0);
        learner.send_reset_all(None);
        // Frames of the first session may still be in the channel; `batch` drops them as a client does.
        let mut reference = Reference::new(&plan);
        reference.reset_all(None);
        for row in receive(&learner) {
            assert_same(&row, reference.row(row.env()), &format!("{threads} threads"));
        }
    }
}
