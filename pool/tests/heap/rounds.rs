//! Resets and changes of the learner while work is under way: nothing of an old round or session reaches the
//! new one, and what follows does not depend on how far the workers were.

use crate::STEPS;
use crate::game::{Gate, Oddity, SIZES};
use crate::harness::{LaneSetup, Learner, Reference, Row, all, start};
use smaclite_pool::transport::SessionId;
use smaclite_pool::{Autoreset, Rejection};

fn rows_of_all(learner: &Learner, num_envs: usize) -> Vec<Row> {
    let mut rows = Vec::new();
    while rows.len() < num_envs {
        rows.extend(learner.batch());
    }
    rows.sort_by_key(|row| row.env);
    rows
}

fn actions(rows: &[Row]) -> Vec<i32> {
    rows.iter().flat_map(Row::legal_actions).collect()
}

/// A gate for one environment of the only lane.
fn gated(env: usize) -> (Gate, impl Fn(usize, usize) -> Oddity + Clone + Send + 'static) {
    let gate = Gate::default();
    let held = gate.clone();
    (gate, move |_, e| Oddity { gate: (e == env).then(|| held.clone()), ..Oddity::default() })
}

fn step_all(reference: &mut Reference, actions: &[i32]) {
    (0..).zip(actions.chunks(SIZES.n_agents)).for_each(|(env, actions)| drop(reference.step(env, actions)));
}

/// Steps are under way, one environment stands at a gate; everything is reset; the gate opens. Again and
/// again.
fn check_reset(setup: LaneSetup, threads: usize, seed: Option<u64>) {
    let num_envs = setup.num_envs;
    let (gate, oddity) = gated(1);
    let (_pool, mut learners) = start(threads, &[setup], oddity);
    let learner = &mut learners[0];
    let mut reference = Reference::new(setup);
    learner.send_reset(None, &all(num_envs), num_envs);
    all(num_envs).into_iter().for_each(|env| drop(reference.reset(env, Some(setup.seed))));
    for _ in 0..STEPS.min(12) {
        let rows = rows_of_all(learner, num_envs);
        gate.close();
        learner.send_step(&all(num_envs), &actions(&rows));
        if setup.autoreset == Autoreset::Disabled && rows.iter().any(Row::ended) {
            let rejection = learner.rejection();
            assert!(matches!(rejection, Rejection::FinishedEnv { .. }), "{rejection}");
        } else {
            step_all(&mut reference, &actions(&rows));
            if !rows[1].ended() {
                gate.somebody_waits(); // else its step is a reset, and those pass by the gate
            }
        }
        learner.send_reset(seed, &all(num_envs), num_envs);
        gate.open();
        let rows = rows_of_all(learner, num_envs);
        for row in &rows {
            assert_eq!(*row, reference.reset(row.env, seed), "{threads} threads, {:?}", setup.autoreset);
        }
        learner.send_step(&all(num_envs), &actions(&rows));
        step_all(&mut reference, &actions(&rows));
    }
}

#[test]
fn a_reset_of_everything_drops_what_is_under_way() {
    const N: usize = 6;
    for autoreset in [Autoreset::NextStep, Autoreset::SameStep, Autoreset::Disabled] {
        for (batch_size, threads) in [(N, 1), (N, 2), (2, 1), (2, 3)] {
            for seed in [None, Some(9)] {
                let setup = LaneSetup { batch_size, autoreset, ..LaneSetup::new(N) };
                check_reset(setup, threads, seed);
            }
        }
    }
}

/// A worker that was busy with another lane found steps of an old round and resets of the new one in its
/// inbox, took both as one run of the old round, and gave the resets no slot: the learner waited for ever.
#[test]
fn resets_that_wait_behind_steps_of_an_old_round_are_answered() {
    let gate = Gate::default();
    let held = gate.clone();
    // With two workers and two environments a lane, environment 1 of lane 0 is worker 1's.
    let oddity =
        move |lane, env| Oddity { gate: ((lane, env) == (0, 1)).then(|| held.clone()), ..Oddity::default() };
    let lanes = [LaneSetup::new(2), LaneSetup::new(4)];
    let (_pool, mut learners) = start(2, &lanes, oddity);
    let [busy, learner] = &mut learners[..] else { unreachable!("two lanes") };
    busy.send_reset(None, &all(2), 2);
    let rows = busy.batch();
    learner.send_reset(None, &all(4), 4);
    let before = learner.batch();
    gate.close();
    busy.send_step(&all(2), &actions(&rows));
    gate.somebody_waits();
    learner.send_step(&all(4), &actions(&before));
    learner.send_reset(Some(3), &all(4), 4);
    learner.send_step(&all(4), &[0; 8]);
    let refused = learner.rejection(); // so the reset before it was accepted
    assert!(matches!(refused, Rejection::BusyEnv { .. }), "{refused}");
    gate.open();
    let mut reference = Reference::new(lanes[1]);
    let expected: Vec<_> = (0..4).map(|env| reference.reset(env, Some(3))).collect();
    assert_eq!(learner.batch(), expected);
}

#[test]
fn a_new_learner_hears_nothing_of_the_old_one() {
    const N: usize = 4;
    for (batch_size, threads) in [(N, 1), (N, 2), (1, 2), (3, 4)] {
        let (gate, oddity) = gated(0);
        let setup = LaneSetup { batch_size, ..LaneSetup::new(N) };
        let (pool, mut learners) = start(threads, &[setup], oddity);
        let learner = &mut learners[0];
        learner.send_reset(Some(7), &all(N), N);
        let rows = if batch_size == 3 { learner.batch() } else { rows_of_all(learner, N) };
        let ids: Vec<_> = rows.iter().map(|row| row.env).collect();
        gate.close();
        learner.send_step(&ids, &actions(&rows));
        if ids.contains(&0) {
            gate.somebody_waits();
        }
        // `set_session` waits for the seat of an environment in its step, as it may.
        std::thread::scope(|scope| {
            scope.spawn(|| pool.set_session(0, None));
            gate.open();
        });
        learner.send_step(&ids, &actions(&rows)); // the dead learner's last message, still in the queue
        pool.set_session(0, Some(SessionId(2)));
        (learner.session, learner.number) = (2, 0);
        learner.send_reset(None, &all(N), N);
        // Frames of the first session may still lie in the channel; `batch` leaves them aside as a client
        // does.
        let mut reference = Reference::new(setup);
        let mut rows = learner.batch();
        if batch_size != 3 {
            while rows.len() < N {
                rows.extend(learner.batch());
            }
        }
        for row in rows {
            assert_eq!(row, reference.reset(row.env, Some(setup.seed)), "{threads} threads");
        }
    }
}
