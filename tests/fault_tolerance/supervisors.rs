//! Supervisors that die, stop, are restarted or are asked to end.

use crate::assert_contains;
use rustix::process::Signal;
use smaclite_ipc::{Client, ClientError, Order, StartError, Supervisor, WaitOptions, WaitStrategy};
use smaclite_tests::fault::Fault;
use smaclite_tests::process::{TIMEOUT, eventually_within};
use smaclite_tests::{Child, LanePlan, Learner, PoolPlan, TestDir};
use std::time::{Duration, Instant};

fn two_lanes() -> PoolPlan {
    PoolPlan::new([LanePlan::new("2s3z", 8), LanePlan::new("3s5z", 8)])
}

/// Waits for the error that a learner must get, and prints how long it took.
#[track_caller]
fn assert_gets_error(learner: &Child, since: Instant) {
    let error = learner.answer(TIMEOUT).expect_err("the pool is dead");
    assert_contains(&error, &["supervisor", "`train`", "gone"]);
    println!("error after {:?}", since.elapsed());
}

#[test]
fn learners_of_a_killed_supervisor_get_an_error_and_keep_the_batches_they_hold() {
    let dir = TestDir::new();
    let plan = two_lanes();
    for repetition in 0..6 {
        let (mut supervisor, mut running) = Child::supervisor_and_learner(&dir, &plan);
        running.must("hold 3");
        running.must("run"); // so that the kill comes during stepping and publishing
        let mut waiting = Child::attached(&dir, &plan.lanes[1]);
        waiting.must("reset");
        waiting.must("hold 2");
        std::thread::sleep(Duration::from_millis(3 * repetition));
        supervisor.kill();
        let killed = Instant::now();
        assert_gets_error(&running, killed);
        running.must("check");
        waiting.tell("step");
        assert_gets_error(&waiting, killed);
        waiting.must("check");

        // A pool of the same name can start at once and serves learners that still hold frames of the dead
        // one.
        let (_restarted, mut fresh) = Child::supervisor_and_learner(&dir, &plan);
        fresh.must("step 5");
        waiting.must("connect train");
        waiting.must("reset");
        waiting.must("step 5");
        waiting.must("check");
        running.must("check");
    }
}

/// A pool of some gigabytes reserves its memory for seconds, and SIGTERM was not handled before the end.
#[test]
fn a_start_can_be_interrupted_while_memory_is_reserved() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("27m_vs_30m", 100)]); // some 80 MB
    let prepared = plan.prepare(dir.runtime_dir()).expect("a valid plan");
    let mut checks = 0;
    let interrupted = Supervisor::start_prepared(prepared, &mut || {
        checks += 1;
        checks == 5
    });
    assert!(matches!(interrupted, Err(StartError::Interrupted)));
    drop(interrupted);
    dir.assert_empty();
}

#[test]
fn a_restart_with_learners_of_the_dead_pool_leaves_nothing_behind() {
    let dir = TestDir::new();
    let plan = two_lanes();
    let (mut old, mut learner) = Child::supervisor_and_learner(&dir, &plan);
    learner.must("hold 2");
    old.kill();
    let mut new = Child::supervisor(&dir, &plan);
    let mut second = Child::try_supervisor(&dir, &plan);
    assert_contains(
        &second.answer(TIMEOUT * 2).expect_err("the name is in use"),
        &["`train`", &new.pid().to_string()],
    );
    second.end();
    learner.tell("recv 3000");
    assert!(learner.answer(TIMEOUT).is_err());
    learner.must("check");
    learner.end();
    new.end();
    dir.assert_empty();
}

#[test]
fn a_waiting_learner_gets_an_error_when_its_supervisor_dies() {
    let dir = TestDir::new();
    let slow = Fault::Sleep(Duration::from_secs(60));
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2).fault(0, slow)]);
    for wait in ["adaptive", "block", "spin"] {
        let mut supervisor = Child::supervisor(&dir, &plan);
        let mut learner = Child::learner(&dir, &plan.lanes[0]);
        learner.must(&format!("connect train {wait}"));
        learner.must("reset");
        learner.must("send");
        learner.tell("recv");
        std::thread::sleep(Duration::from_millis(200)); // now it waits
        supervisor.kill();
        assert_gets_error(&learner, Instant::now());
    }
}

#[test]
fn a_learner_waits_for_a_stopped_supervisor_until_its_timeout() {
    let dir = TestDir::new();
    let plan = two_lanes();
    let (supervisor, mut learner) = Child::supervisor_and_learner(&dir, &plan);
    learner.must("step 3");
    supervisor.signal(Signal::STOP);
    learner.must("send");
    let error = learner.ask("recv 300").expect_err("the supervisor is stopped");
    assert_contains(&error, &["within 0.3 s"]);
    supervisor.signal(Signal::CONT);
    learner.must("recv 5000"); // the result that was late
    learner.must("step 10");
}

/// The client began the new epoch before the reset was sent. If sending failed, the client dropped all frames
/// of the epoch that continued, and its next step hung.
#[test]
fn a_reset_of_all_that_was_not_accepted_changes_nothing() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([
        LanePlan { batch_size: 1, ..LanePlan::new("2s3z", 4) },
        LanePlan { name: "synchronous".to_owned(), ..LanePlan::new("2s3z", 4) },
    ]);
    let supervisor = Child::supervisor(&dir, &plan);
    let mut learner = dir.learner(&plan.lanes[0]);
    let mut other =
        dir.connect(Some("synchronous"), WaitStrategy::default(), WaitOptions::no_wait()).expect("a client");
    learner.reset(None, TIMEOUT).expect("a reset");
    exchange(&mut other, |client| client.send(Order::reset(Some(1)), None, WaitOptions::forever()));
    supervisor.signal(Signal::STOP);
    // In the lane with batches of one, the queue is full with one step per environment.
    (0..4).for_each(|env| learner.send_to(&[env]).expect("sent"));
    let refused = learner.client().send(Order::reset(Some(5)), None, WaitOptions::forever());
    assert!(matches!(refused, Err(ClientError::NotAccepted { .. })), "{refused:?}");
    // In the other, resets are sent until the queue is full.
    let refused = std::iter::repeat_with(|| other.send(Order::reset(Some(5)), None, WaitOptions::forever()))
        .find_map(Result::err);
    assert!(matches!(refused, Some(ClientError::NotAccepted { .. })), "{refused:?}");
    supervisor.signal(Signal::CONT);
    (0..4).for_each(|_| drop(learner.recv(TIMEOUT).expect("the result of a step")));
    learner.send_to(&[0]).expect("sent");
    learner.recv(TIMEOUT).expect("the result of another step");
    exchange(&mut other, |_| Ok(())); // the frame of the last reset that was sent
    let mut actions = vec![0; 4 * other.description().sizes.n_agents];
    other.sample_actions(None, &mut actions).expect("legal actions");
    exchange(&mut other, |client| client.send(Order::Step(&actions), None, WaitOptions::forever()));
}

/// A request to a supervisor that does not read waited for five seconds, whatever the caller's timeout, and
/// could not be interrupted.
#[test]
fn sending_ends_at_its_timeout_and_can_be_interrupted() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 4)]);
    let supervisor = Child::supervisor(&dir, &plan);
    let mut client = dir.client();
    supervisor.signal(Signal::STOP);
    let mut refused_after = |timeout: Option<Duration>, interrupt: bool| {
        loop {
            let begin = Instant::now();
            let wait = WaitOptions { timeout, interrupted: &mut || interrupt };
            if let Err(error) = client.send(Order::reset(None), None, wait) {
                return (error, begin.elapsed());
            }
        }
    };
    let (error, time) = refused_after(Some(Duration::from_millis(20)), false);
    assert!(matches!(error, ClientError::NotAccepted { .. }), "{error}");
    assert!(time < Duration::from_secs(3), "{time:?}");
    let (error, time) = refused_after(None, true);
    assert!(matches!(error, ClientError::Interrupted), "{error}");
    assert!(time < Duration::from_secs(3), "{time:?}");
    supervisor.signal(Signal::CONT);
    client
        .recv(WaitOptions { timeout: Some(TIMEOUT), interrupted: &mut || false })
        .expect("the frame of the last reset that was sent");
}

/// Sends something and receives a batch of all environments.
fn exchange(client: &mut Client, send: impl FnOnce(&mut Client) -> Result<(), ClientError>) {
    send(client).expect("sent");
    let batch =
        client.recv(WaitOptions { timeout: Some(TIMEOUT), interrupted: &mut || false }).expect("a batch");
    assert_eq!(batch.env_id(), [0, 1, 2, 3]);
}

/// A timeout that ends later than a clock can represent was a panic, but only if the answer came late.
#[test]
fn a_timeout_too_long_for_the_clock_is_no_limit() {
    let dir = TestDir::new();
    let slow = Fault::Sleep(Duration::from_millis(300));
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2).fault(0, slow)]);
    let _supervisor = dir.start(&plan);
    for wait in [WaitStrategy::Adaptive, WaitStrategy::Block, WaitStrategy::Spin] {
        let mut learner =
            Learner::connect_waiting(dir.runtime_dir(), "train", &plan.lanes[0], wait).expect("a client");
        learner.reset(None, Duration::MAX).expect("a reset");
        learner.step(Duration::MAX).expect("a slow step");
    }
}

#[test]
fn sigterm_ends_a_pool_and_leaves_nothing_behind() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 8)]);
    let arguments = "serve 2s3z:8 --name train --seed 7 --episode-limit 30 --threads 2";
    let mut program = Child::program(&dir, arguments);
    let mut learner = Child::learner(&dir, &plan.lanes[0]);
    let serves = eventually_within(TIMEOUT * 2, || learner.ask("connect train").is_ok());
    assert!(serves, "the program does not serve");
    learner.must("reset");
    learner.must("hold 2");
    learner.must("run");
    program.signal(Signal::TERM);
    assert_eq!(program.wait(TIMEOUT).and_then(|status| status.code()), Some(0));
    assert_gets_error(&learner, Instant::now());
    learner.must("check");
    learner.end();
    dir.assert_empty();
}

#[test]
fn an_interrupted_measurement_leaves_nothing_behind() {
    let dir = TestDir::new();
    let mut bench = Child::program(&dir, "bench 2s3z --seconds 600");
    assert!(eventually_within(TIMEOUT * 2, || !dir.files().is_empty()), "it does not start");
    bench.signal(Signal::INT);
    assert_eq!(bench.wait(TIMEOUT * 2).and_then(|status| status.code()), Some(128 + 2));
    dir.assert_empty();
}

#[test]
fn clean_removes_the_files_of_killed_processes() {
    let dir = TestDir::new();
    let plan = two_lanes();
    let (mut supervisor, mut learner) = Child::supervisor_and_learner(&dir, &plan);
    learner.must("hold 2");
    supervisor.kill();
    learner.kill();
    assert!(!dir.files().is_empty(), "killed processes leave files");
    let mut clean = Child::program(&dir, "clean");
    assert_eq!(clean.wait(TIMEOUT * 2).and_then(|status| status.code()), Some(0));
    dir.assert_empty();
}
