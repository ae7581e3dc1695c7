//! Requests that are refused, and that nothing happens when one is. Nothing here goes through a client's own
//! checks.

use crate::game::{Gate, Oddity};
use crate::harness::{LaneSetup, Learner, Reference, Row, all, settle, start};
use crate::transport::HeapMessage;
use smaclite_pool::transport::RequestKind;
use smaclite_pool::{Autoreset, Pool, Rejection};

const N: usize = 4;

/// A lane after its first reset, and what the reset showed.
fn reset_lane(setup: LaneSetup) -> (Pool<crate::transport::Heap>, Learner, Vec<Row>) {
    let (pool, mut learners) = start(2, &[setup], |_, _| Oddity::default());
    let mut learner = learners.remove(0);
    learner.send_reset(Some(7), &all(setup.num_envs), setup.num_envs);
    let mut rows = learner.batch();
    for _ in 1..setup.num_envs / setup.batch_size {
        rows.extend(learner.batch());
    }
    rows.sort_by_key(|row| row.env);
    (pool, learner, rows)
}

/// Sends a request that is to be refused so, and then one step that must find everything as it was.
fn check(
    setup: LaneSetup,
    env_ids: &[i32],
    change: impl Fn(&[Row], &mut Vec<i32>),
    is_right: impl Fn(&Rejection) -> bool,
) {
    let (pool, mut learner, rows) = reset_lane(setup);
    let mut actions: Vec<i32> =
        env_ids.iter().flat_map(|env| rows[(*env).clamp(0, N as i32 - 1) as usize].legal_actions()).collect();
    change(&rows, &mut actions);
    learner.send_step(env_ids, &actions);
    let rejection = learner.rejection();
    assert!(is_right(&rejection), "{rejection:?}");
    assert_eq!(pool.stats(0).rejected, 1);

    let legal: Vec<_> = rows.iter().flat_map(Row::legal_actions).collect();
    learner.send_step(&all(N), &legal);
    let mut reference = Reference::new(setup);
    (0..N as i32).for_each(|env| drop(reference.reset(env, Some(7))));
    let mut stepped: Vec<Row> = Vec::new();
    while stepped.len() < N {
        stepped.extend(learner.batch());
    }
    stepped.sort_by_key(|row| row.env);
    for (row, actions) in stepped.iter().zip(legal.chunks(2)) {
        assert_eq!(*row, reference.step(row.env, actions), "after {rejection}");
    }
    assert!(learner.hears_nothing());
    settle("every environment stepped once", || pool.stats(0).steps == N as u64);
}

fn unavailable(row: &Row, agent: usize) -> i32 {
    let masks = &row.bytes.iter().find(|(f, _)| f.spec().name == "avail_actions").unwrap().1;
    (0..5).find(|action| masks[agent * 5 + action] == 0).expect("one action never is") as i32
}

#[test]
fn wrong_actions_and_environments_are_named_and_nothing_is_stepped() {
    let synchronous = LaneSetup::new(N);
    let asynchronous = LaneSetup { batch_size: 2, ..synchronous };
    let same = |_: &[Row], _: &mut Vec<i32>| {};
    for setup in [synchronous, asynchronous] {
        let illegal = |rows: &[Row], actions: &mut Vec<i32>| actions[7] = unavailable(&rows[3], 1);
        check(
            setup,
            &all(N),
            illegal,
            |r| matches!(r, Rejection::UnavailableAction { env: 3, agent: 1, available, .. } if available.len() == 4),
        );
        for action in [5, -1, i32::MIN, i32::MAX] {
            let out_of_range = |_: &[Row], actions: &mut Vec<i32>| actions[0] = action;
            check(setup, &all(N), out_of_range, |r| {
                let text = r.to_string();
                text.contains("environment 0") && text.contains(&action.to_string())
            });
        }
        for (ids, env) in [([0, 1, 2, 4], 4), ([0, 1, 2, -1], -1), ([0, 1, 2, i32::MIN], i64::from(i32::MIN))]
        {
            check(setup, &ids, same, |r| *r == Rejection::UnknownEnv { env, num_envs: N });
        }
        check(setup, &[0, 1, 2, 1], same, |r| *r == Rejection::DuplicateEnv { env: 1 });
    }
    check(synchronous, &[0, 2], same, |r| *r == Rejection::IncompleteBatch { given: 2, expected: N });
    check(asynchronous, &[0, 1, 2, 3, 0], same, |r| *r == Rejection::DuplicateEnv { env: 0 });
}

#[test]
fn numbers_that_come_twice_are_refused() {
    let (_pool, mut learner, rows) = reset_lane(LaneSetup::new(N));
    let legal: Vec<_> = rows.iter().flat_map(Row::legal_actions).collect();
    learner.number = 0;
    learner.send_step(&all(N), &legal);
    assert!(matches!(learner.rejection(), Rejection::Malformed { what } if what.contains("got 1 after 1")));
}

#[test]
fn a_session_begins_with_a_reset_of_everything() {
    let (_pool, mut learners) = start(1, &[LaneSetup::new(N)], |_, _| Oddity::default());
    let learner = &mut learners[0];
    learner.send_step(&all(N), &[0; 2 * N]);
    assert_eq!(learner.rejection(), Rejection::NotReset);
    learner.send_reset(None, &[1], N);
    assert_eq!(learner.rejection(), Rejection::NotReset);
    learner.send_reset(None, &[0, 1, 2, 2], N);
    assert_eq!(learner.rejection(), Rejection::DuplicateEnv { env: 2 });
    learner.send_step(&all(N), &[0; 2 * N]);
    assert_eq!(learner.rejection(), Rejection::NotReset, "a refused reset is none");
    learner.send_reset(None, &all(N), N);
    assert_eq!(learner.batch().len(), N);
}

#[test]
fn a_finished_environment_is_not_stepped_where_nothing_resets_it() {
    for batch_size in [1, 2] {
        let setup = LaneSetup { autoreset: Autoreset::Disabled, batch_size, ..LaneSetup::new(2) };
        let (_pool, mut learner, mut rows) = reset_lane(setup);
        while !rows.iter().any(Row::ended) {
            let actions: Vec<_> = rows.iter().flat_map(Row::legal_actions).collect();
            learner.send_step(&[0, 1], &actions);
            rows = learner.batch();
            if batch_size == 1 {
                rows.extend(learner.batch());
                rows.sort_by_key(|row| row.env);
            }
        }
        let env = rows.iter().position(Row::ended).unwrap();
        let actions: Vec<_> = rows.iter().flat_map(Row::legal_actions).collect();
        learner.send_step(&[0, 1], &actions);
        assert_eq!(learner.rejection(), Rejection::FinishedEnv { env });
    }
}

#[test]
fn an_environment_at_work_does_not_hold_up_the_others_of_its_lane() {
    let gate = Gate::default();
    let held = gate.clone();
    let oddity = move |_, env| Oddity { gate: (env == 0).then(|| held.clone()), ..Oddity::default() };
    let setup = LaneSetup { batch_size: 1, ..LaneSetup::new(2) };
    let (_pool, mut learners) = start(2, &[setup], oddity);
    let learner = &mut learners[0];
    learner.send_reset(Some(7), &[0, 1], 2);
    let mut rows = [learner.batch().remove(0), learner.batch().remove(0)];
    rows.sort_by_key(|row| row.env);
    gate.close();
    learner.send_step(&[0], &rows[0].legal_actions());
    gate.somebody_waits();
    learner.send_step(&[1], &rows[1].legal_actions());
    assert_eq!(learner.batch()[0].env, 1, "the other environment is free");
    gate.open();
    assert_eq!(learner.batch()[0].env, 0);
}

#[test]
fn what_has_no_form_or_comes_from_another_session_is_counted_and_not_answered() {
    let (pool, mut learner, rows) = reset_lane(LaneSetup::new(N));
    let legal: Vec<_> = rows.iter().flat_map(Row::legal_actions).collect();
    let message = |session, number, kind| HeapMessage {
        session,
        number,
        kind,
        env_ids: all(N),
        actions: legal.clone(),
    };
    learner.send_raw(message(1, 2, None));
    learner.send_raw(message(2, 2, Some(RequestKind::Step)));
    learner.send_raw(message(0, u64::MAX, Some(RequestKind::Reset { seed: None })));
    learner.send_step(&all(N), &legal);
    learner.batch();
    assert!(learner.hears_nothing());
    assert_eq!(pool.stats(0).rejected, 3);
    settle("every environment stepped once", || pool.stats(0).steps == N as u64);
}

#[test]
fn a_panic_ends_its_lane_with_its_text_and_no_other() {
    let in_step = Oddity { panics_in_step: Some(2), ..Oddity::default() };
    let in_check = Oddity { panics_in_check: true, ..Oddity::default() };
    for (broken, text) in [(in_step, "step 2 broke"), (in_check, "the check broke")] {
        for batch_size in [N, 1] {
            for threads in 1..=2 {
                let broken = broken.clone();
                let oddity = move |lane, env| {
                    if (lane, env) == (0, 2) { broken.clone() } else { Oddity::default() }
                };
                let setup = LaneSetup { batch_size, ..LaneSetup::new(N) };
                let (pool, mut learners) = start(threads, &[setup, LaneSetup::new(N)], oddity);
                let [broken, sound] = &mut learners[..] else { unreachable!("two lanes") };
                let rejection = play_until_refused(broken);
                let failed =
                    |r: &Rejection| matches!(r, Rejection::LaneFailed { text: t } if t.contains(text));
                assert!(failed(&rejection), "{rejection:?}");
                assert!(pool.failure(0).is_some_and(|t| t.contains(text)));
                broken.send_reset(None, &all(N), N);
                let again = std::iter::repeat_with(|| broken.frame()).find_map(|frame| frame.rejection());
                assert!(again.is_some_and(|(_, r)| failed(&r)));

                assert!(pool.failure(1).is_none());
                sound.send_reset(None, &all(N), N);
                let rows = sound.batch();
                sound.send_step(&all(N), &rows.iter().flat_map(Row::legal_actions).collect::<Vec<_>>());
                assert_eq!(sound.batch().len(), N);
            }
        }
    }
}

/// Steps every environment it hears of until something is refused.
fn play_until_refused(learner: &mut Learner) -> Rejection {
    learner.send_reset(None, &all(N), N);
    loop {
        let frame = learner.frame();
        if let Some((_, rejection)) = frame.rejection() {
            return rejection;
        }
        let rows = learner.rows(&frame);
        let ids: Vec<_> = rows.iter().map(|row| row.env).collect();
        learner.send_step(&ids, &rows.iter().flat_map(Row::legal_actions).collect::<Vec<_>>());
    }
}
