//! Requests that are rejected: each names its reason and changes nothing. These learners do not check
//! anything themselves.

use crate::harness::{Learner, all, assert_same, legal_actions, start, start_one, wait_until};
use smaclite_engine::Actor;
use smaclite_pool::transport::{Request, RequestKind, RequestNumber, Seeds, SessionId};
use smaclite_pool::{Autoreset, Pool, Rejection};
use smaclite_tests::fault::{Fault, Gate};
use smaclite_tests::in_memory::{InMemory, SentMessage};
use smaclite_tests::{LanePlan, Reference, Row};

const N: usize = 4;

/// A lane after its first reset, and the rows of the reset.
fn reset_lane(plan: &LanePlan) -> (Pool<InMemory>, Learner, Vec<Row>) {
    let (pool, mut learner) = start_one(2, plan);
    learner.send_reset_all(Some(7));
    let rows = learner.rows_of_all();
    (pool, learner, rows)
}

/// Sends a step that must be rejected with a reason that `is_expected`, then a legal one, which must find
/// everything unchanged.
fn check(
    plan: &LanePlan,
    env_ids: &[i32],
    change: impl Fn(&[Row], &mut Vec<i32>),
    is_expected: impl Fn(&Rejection) -> bool,
) {
    let (pool, mut learner, rows) = reset_lane(plan);
    let row = |env: &i32| &rows[(*env).clamp(0, N as i32 - 1) as usize];
    let mut actions: Vec<i32> = env_ids.iter().flat_map(|env| row(env).legal_actions()).collect();
    change(&rows, &mut actions);
    learner.send_step(env_ids, &actions);
    let rejection = learner.rejection();
    assert!(is_expected(&rejection), "{rejection:?}");
    assert_eq!(pool.lane(0).stats().rejected, 1);

    learner.step_rows(&rows);
    let mut reference = Reference::new(plan);
    reference.reset_all(Some(7));
    for (row, next) in rows.iter().zip(learner.rows_of_all()) {
        let expected = reference.step(row.env(), &row.legal_actions());
        assert_same(&next, expected, &format!("after {rejection}"));
    }
    assert!(learner.has_no_frame());
    wait_until("every environment was stepped once", || pool.lane(0).stats().steps == N as u64);
}

/// An action of the agent that is not available.
fn unavailable(row: &Row, agent: usize) -> i32 {
    let mask = row.masks().nth(agent).expect("an agent");
    mask.iter().position(|available| *available == 0).expect("one action never is") as i32
}

#[test]
fn wrong_actions_and_environments_are_named_and_nothing_is_stepped() {
    let synchronous = LanePlan::toy(N);
    let asynchronous = LanePlan { batch_size: 2, ..LanePlan::toy(N) };
    let same = |_: &[Row], _: &mut Vec<i32>| {};
    for plan in [&synchronous, &asynchronous] {
        let illegal = |rows: &[Row], actions: &mut Vec<i32>| actions[7] = unavailable(&rows[3], 1);
        check(plan, &all(N), illegal, |rejection| match rejection {
            Rejection::UnavailableAction { env: 3, actor: Actor::Agent(1), action, available, .. } => {
                !available.is_empty() && !available.contains(&(*action as usize))
            }
            _ => false,
        });
        for action in [8, -1, i32::MIN, i32::MAX] {
            let out_of_range = |_: &[Row], actions: &mut Vec<i32>| actions[0] = action;
            check(plan, &all(N), out_of_range, |r| {
                let text = r.to_string();
                text.contains("environment 0") && text.contains(&action.to_string())
            });
        }
        for env in [4, -1, i32::MIN] {
            let expected = Rejection::UnknownEnv { env: env.into(), num_envs: N };
            check(plan, &[0, 1, 2, env], same, |r| *r == expected);
        }
        check(plan, &[0, 1, 2, 1], same, |r| *r == Rejection::DuplicateEnv { env: 1 });
    }
    check(&synchronous, &[0, 2], same, |r| *r == Rejection::IncompleteBatch { given: 2, expected: N });
    check(&asynchronous, &[0, 1, 2, 3, 0], same, |r| *r == Rejection::DuplicateEnv { env: 0 });
}

#[test]
fn a_repeated_request_number_is_rejected() {
    let (_pool, mut learner, rows) = reset_lane(&LanePlan::toy(N));
    learner.number = 0;
    learner.step_rows(&rows);
    assert!(matches!(learner.rejection(), Rejection::Malformed { what } if what.contains("got 1 after 1")));
}

#[test]
fn an_asynchronous_session_must_begin_with_a_reset_of_all() {
    let (_pool, mut learner) = start_one(1, &LanePlan { batch_size: 2, ..LanePlan::toy(N) });
    learner.send_step(&all(N), &[0; 2 * N]);
    assert_eq!(learner.rejection(), Rejection::NotReset);
    learner.send_reset(None, &[1]);
    assert_eq!(learner.rejection(), Rejection::NotReset);
    learner.send_reset(None, &[0, 1, 2, 2]);
    assert_eq!(learner.rejection(), Rejection::DuplicateEnv { env: 2 });
    learner.send_step(&all(N), &[0; 2 * N]);
    assert_eq!(learner.rejection(), Rejection::NotReset, "the rejected reset had an effect");
    learner.send_reset_all(None);
    assert_eq!(learner.batch().len(), 2);
}

/// A restore of some environments could begin a session, and a reset of some could not.
#[test]
fn the_first_reset_of_some_environments_begins_all() {
    let (_pool, mut learner) = start_one(1, &LanePlan::toy(N));
    learner.send_step(&all(N), &[0; 2 * N]);
    assert_eq!(learner.rejection(), Rejection::NotReset);
    learner.send_reset(None, &[0, 1, 2, 2]);
    assert_eq!(learner.rejection(), Rejection::DuplicateEnv { env: 2 });
    learner.send_step(&all(N), &[0; 2 * N]);
    assert_eq!(learner.rejection(), Rejection::NotReset, "the rejected reset had an effect");
    learner.send_reset(None, &[1]);
    let frame = learner.frame();
    assert_eq!(frame.rejection(), None);
    assert_eq!(learner.rows(&frame).len(), N);
}

#[test]
fn a_finished_environment_cannot_be_stepped_without_autoreset() {
    for batch_size in [1, 2] {
        let plan = LanePlan { autoreset: Autoreset::Disabled, batch_size, ..LanePlan::toy(2) };
        let (_pool, mut learner, mut rows) = reset_lane(&plan);
        while !rows.iter().any(Row::ended) {
            learner.step_rows(&rows);
            rows = learner.rows_of_all();
        }
        let env = rows.iter().position(Row::ended).unwrap();
        learner.step_rows(&rows);
        assert_eq!(learner.rejection(), Rejection::FinishedEnv { env });
    }
}

#[test]
fn an_environment_that_is_being_stepped_does_not_delay_those_that_a_learner_of_the_process_orders() {
    let gate = Gate::default();
    let plan = LanePlan { batch_size: 1, ..LanePlan::toy(2) }.fault(0, Fault::Gate(gate.clone()));
    let (pool, learner, rows) = reset_lane(&plan);
    let mut local = pool.handle().local_learner(0, SessionId(1)).expect("the lane's session");
    let mut step = |number, row: &Row| {
        let (env_ids, body, kind) = ([row.env()], row.legal_actions(), RequestKind::Step);
        let (session, number) = (SessionId(1), RequestNumber(number));
        local.order(&Request { session, number, kind, env_ids: &env_ids, body: &body }).expect("idle");
        local.leave(); // to the threads of the pool
    };
    gate.close();
    step(2, &rows[0]);
    gate.wait_for_arrival();
    step(3, &rows[1]);
    assert_eq!(learner.batch()[0].env(), 1);
    gate.open();
    assert_eq!(learner.batch()[0].env(), 0);
}

#[test]
fn malformed_requests_and_those_of_other_sessions_are_counted_and_not_answered() {
    let (pool, mut learner, rows) = reset_lane(&LanePlan::toy(N));
    let message = |session, number, kind| SentMessage {
        session,
        number,
        kind,
        env_ids: all(N),
        actions: legal_actions(&rows),
    };
    learner.send_raw(message(1, 2, None));
    learner.send_raw(message(2, 2, Some(RequestKind::Step)));
    learner.send_raw(message(
        0,
        u64::MAX,
        Some(RequestKind::Reset { seeds: Seeds::Continue, levels: false }),
    ));
    learner.step_rows(&rows);
    learner.batch();
    assert!(learner.has_no_frame());
    let stats = pool.lane(0).stats();
    assert_eq!((stats.rejected, stats.accepted), (3, 2));
    wait_until("every environment was stepped once", || pool.lane(0).stats().steps == N as u64);
}

#[test]
fn a_panic_ends_its_lane_with_its_message_and_no_other_lane() {
    let (fault, text) = (Fault::PanicInStep(2), "environment 2 broke in step 2");
    for batch_size in [N, 1] {
        for threads in 1..=2 {
            let faulty = LanePlan { batch_size, ..LanePlan::toy(N) }.fault(2, fault.clone());
            let (pool, mut learners) = start(threads, &[faulty, LanePlan::toy(N)]);
            let [broken, intact] = &mut learners[..] else { unreachable!("two lanes") };
            let rejection = step_until_rejected(broken);
            let failed = |r: &Rejection| matches!(r, Rejection::LaneFailed { text: t } if t.contains(text));
            assert!(failed(&rejection), "{rejection:?}");
            assert!(pool.lane(0).failure().is_some_and(|t| t.contains(text)));
            broken.send_reset_all(None);
            let again = std::iter::repeat_with(|| broken.frame()).find_map(|frame| frame.rejection());
            assert!(again.is_some_and(|(_, r)| failed(&r)));

            assert!(pool.lane(1).failure().is_none());
            intact.send_reset_all(None);
            let rows = intact.batch();
            intact.step_rows(&rows);
            assert_eq!(intact.batch().len(), N);
        }
    }
}

/// Resets, then steps the environments of every batch until a request is rejected.
fn step_until_rejected(learner: &mut Learner) -> Rejection {
    learner.send_reset_all(None);
    loop {
        let frame = learner.frame();
        if let Some((_, rejection)) = frame.rejection() {
            return rejection;
        }
        let rows = learner.rows(&frame);
        learner.step_rows(&rows);
    }
}
