//! Supervisors that die, stop, are restarted or told to end.

use crate::assert_says;
use rustix::process::Signal;
use smaclite_ipc::{Client, ClientError, StartError, Supervisor, WaitOptions, WaitStrategy};
use smaclite_tests::pools::games::Oddity;
use smaclite_tests::pools::process::{SOON, eventually_within};
use smaclite_tests::pools::{Child, LanePlan, Player, PoolPlan, Room};
use std::time::{Duration, Instant};

fn two_lanes() -> PoolPlan {
    PoolPlan::new([LanePlan::new("2s3z", 8), LanePlan::new("3s5z", 8)])
}

/// Waits for the error that a learner must get, and measures how long it took.
#[track_caller]
fn assert_hears_of_death(learner: &Child, since: Instant) {
    let error = learner.answer(SOON).expect_err("the pool is dead");
    assert_says(&error, &["supervisor", "`train`", "gone"]);
    println!("told after {:?}", since.elapsed());
}

#[test]
fn learners_hear_of_a_killed_supervisor_and_keep_what_they_hold() {
    let room = Room::new();
    let plan = two_lanes();
    for round in 0..6 {
        let mut supervisor = Child::supervisor(&room, &plan);
        let mut running = Child::attached(&room, &plan.lanes[0]);
        running.must("reset");
        running.must("hold 3");
        running.must("run"); // so that the kill comes in the midst of stepping and publishing
        let mut waiting = Child::attached(&room, &plan.lanes[1]);
        waiting.must("reset");
        waiting.must("hold 2");
        std::thread::sleep(Duration::from_millis(3 * round));
        supervisor.kill();
        let killed = Instant::now();
        assert_hears_of_death(&running, killed);
        running.must("check");
        waiting.tell("step");
        assert_hears_of_death(&waiting, killed);
        waiting.must("check");

        // The same name serves again at once, also to learners that still hold frames of the dead one.
        let _restarted = Child::supervisor(&room, &plan);
        let mut fresh = Child::attached(&room, &plan.lanes[0]);
        fresh.must("reset");
        fresh.must("step 5");
        waiting.must("connect train");
        waiting.must("reset");
        waiting.must("step 5");
        waiting.must("check");
        running.must("check");
    }
}

/// A pool of some gigabytes sets its memory aside for seconds, and SIGTERM was not looked at before the end.
#[test]
fn a_start_is_given_up_while_memory_is_set_aside() {
    let room = Room::new();
    let plan = PoolPlan::new([LanePlan::new("27m_vs_30m", 100)]); // some 80 MB
    let prepared = plan.config(room.runtime_dir()).prepare().expect("a right plan");
    let mut asked = 0;
    let given_up = Supervisor::start_prepared(prepared, &mut || {
        asked += 1;
        asked == 5
    });
    assert!(matches!(given_up, Err(StartError::Interrupted)));
    drop(given_up);
    room.assert_empty();
}

#[test]
fn a_restart_meets_learners_of_the_dead_and_leaves_nothing_of_it() {
    let room = Room::new();
    let plan = two_lanes();
    let mut old = Child::supervisor(&room, &plan);
    let mut learner = Child::attached(&room, &plan.lanes[0]);
    learner.must("reset");
    learner.must("hold 2");
    old.kill();
    let mut new = Child::supervisor(&room, &plan);
    let mut second = Child::supervisor_refused(&room, &plan);
    assert_says(
        &second.answer(SOON * 2).expect_err("the name is taken"),
        &["`train`", &new.pid().to_string()],
    );
    second.end();
    learner.tell("recv 3000");
    assert!(learner.answer(SOON).is_err());
    learner.must("check");
    learner.end();
    new.end();
    room.assert_empty();
}

#[test]
fn a_waiting_learner_hears_of_a_supervisor_that_died() {
    let room = Room::new();
    let slow = Oddity::Sleeps { env: 0, millis: 60_000 };
    let plan = PoolPlan::new([LanePlan { oddity: slow, ..LanePlan::new("2s3z", 2) }]);
    for wait in ["adaptive", "block", "spin"] {
        let mut supervisor = Child::supervisor(&room, &plan);
        let mut learner = Child::learner(&room, &plan.lanes[0]);
        learner.must(&format!("connect train {wait}"));
        learner.must("reset");
        learner.must("send");
        learner.tell("recv");
        std::thread::sleep(Duration::from_millis(200)); // now it waits
        supervisor.kill();
        assert_hears_of_death(&learner, Instant::now());
    }
}

#[test]
fn a_stopped_supervisor_is_waited_for_as_long_as_the_learner_likes() {
    let room = Room::new();
    let plan = two_lanes();
    let supervisor = Child::supervisor(&room, &plan);
    let mut learner = Child::attached(&room, &plan.lanes[0]);
    learner.must("reset");
    learner.must("step 3");
    supervisor.signal(Signal::STOP);
    learner.must("send");
    let error = learner.ask("recv 300").expect_err("nobody answers");
    assert_says(&error, &["within 0.3 s"]);
    supervisor.signal(Signal::CONT);
    learner.must("recv 5000"); // the result that was late
    learner.must("step 10");
}

/// The client began the new round before the reset was sent. When it was not, the client dropped all that
/// came of the round that went on, and its next step hung.
#[test]
fn a_reset_of_all_that_was_not_accepted_changes_nothing() {
    let room = Room::new();
    let plan = PoolPlan::new([
        LanePlan { batch_size: 1, ..LanePlan::new("2s3z", 4) },
        LanePlan { name: "synchronous".to_owned(), ..LanePlan::new("2s3z", 4) },
    ]);
    let supervisor = Child::supervisor(&room, &plan);
    let mut player = Player::connect(room.runtime_dir(), "train", &plan.lanes[0]).expect("a client");
    let mut other =
        Client::connect(room.runtime_dir(), "train", Some("synchronous"), WaitStrategy::default())
            .expect("a client");
    player.reset(None, SOON).expect("a reset");
    recv_of_all(&mut other, |client| client.send_reset(Some(1), None, WaitOptions::forever()));
    supervisor.signal(Signal::STOP);
    // Of the lane with batches of one, a step of every environment waits, and there is no room for more.
    (0..4).for_each(|env| player.send_to(&[env]).expect("sent"));
    let refused = player.client().send_reset(Some(5), None, WaitOptions::forever());
    assert!(matches!(refused, Err(ClientError::NotAccepted { .. })), "{refused:?}");
    // Of the other, as many resets as there is room for.
    let refused = std::iter::repeat_with(|| other.send_reset(Some(5), None, WaitOptions::forever()))
        .find_map(Result::err);
    assert!(matches!(refused, Some(ClientError::NotAccepted { .. })), "{refused:?}");
    supervisor.signal(Signal::CONT);
    (0..4).for_each(|_| drop(player.recv(SOON).expect("the result of a step")));
    player.send_to(&[0]).expect("sent");
    player.recv(SOON).expect("the result of one more");
    recv_of_all(&mut other, |_| Ok(())); // of the last reset that was sent
    let mut actions = vec![0; 4 * other.description().sizes.n_agents];
    other.sample_actions(None, &mut actions).expect("legal actions");
    recv_of_all(&mut other, |client| client.send(&actions, None, WaitOptions::forever()));
}

/// A request to a supervisor that has stopped reading waited for five seconds, whatever the caller's timeout
/// and Ctrl-C.
#[test]
fn a_wait_to_send_keeps_to_the_timeout_and_can_be_interrupted() {
    let room = Room::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 4)]);
    let supervisor = Child::supervisor(&room, &plan);
    let mut client =
        Client::connect(room.runtime_dir(), "train", None, WaitStrategy::default()).expect("a client");
    supervisor.signal(Signal::STOP);
    let mut refused_after = |timeout: Option<Duration>, interrupt: bool| {
        loop {
            let begin = Instant::now();
            let wait = WaitOptions { timeout, interrupted: &mut || interrupt };
            if let Err(error) = client.send_reset(None, None, wait) {
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
        .recv(WaitOptions { timeout: Some(SOON), interrupted: &mut || false })
        .expect("of the last reset that was sent");
}

fn recv_of_all(client: &mut Client, send: impl FnOnce(&mut Client) -> Result<(), ClientError>) {
    send(client).expect("sent");
    let batch =
        client.recv(WaitOptions { timeout: Some(SOON), interrupted: &mut || false }).expect("a batch");
    assert_eq!(batch.env_id(), [0, 1, 2, 3]);
}

/// A timeout that reaches beyond what a clock can hold once was a panic, but only where the answer came late.
#[test]
fn a_timeout_beyond_any_clock_is_no_limit() {
    let room = Room::new();
    let slow = Oddity::Sleeps { env: 0, millis: 300 };
    let plan = PoolPlan::new([LanePlan { oddity: slow, ..LanePlan::new("2s3z", 2) }]);
    let _supervisor = Supervisor::start(plan.config(room.runtime_dir())).expect("a pool");
    for wait in [WaitStrategy::Adaptive, WaitStrategy::Block, WaitStrategy::Spin] {
        let mut player =
            Player::connect_waiting(room.runtime_dir(), "train", &plan.lanes[0], wait).expect("a client");
        player.reset(None, Duration::MAX).expect("a reset");
        player.step(Duration::MAX).expect("a step that takes its time");
    }
}

#[test]
fn sigterm_ends_a_pool_and_leaves_nothing_behind() {
    let room = Room::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 8)]);
    let arguments = "smaclite-pool serve 2s3z:8 --name train --seed 7 --episode-limit 30 --threads 2";
    let mut program = Child::start(&room, "program", arguments);
    let mut learner = Child::learner(&room, &plan.lanes[0]);
    let serves = eventually_within(SOON * 2, || learner.ask("connect train").is_ok());
    assert!(serves, "the program does not serve");
    learner.must("reset");
    learner.must("hold 2");
    learner.must("run");
    program.signal(Signal::TERM);
    assert_eq!(program.wait(SOON).and_then(|status| status.code()), Some(0));
    assert_hears_of_death(&learner, Instant::now());
    learner.must("check");
    learner.end();
    room.assert_empty();
}

#[test]
fn an_interrupted_measurement_leaves_nothing_behind() {
    let room = Room::new();
    let mut bench = Child::start(&room, "program", "smaclite-pool bench 2s3z --seconds 600");
    assert!(eventually_within(SOON * 2, || !room.files().is_empty()), "it does not begin");
    bench.signal(Signal::INT);
    assert_eq!(bench.wait(SOON * 2).and_then(|status| status.code()), Some(1));
    room.assert_empty();
}

#[test]
fn clean_takes_away_what_the_killed_left() {
    let room = Room::new();
    let plan = two_lanes();
    let mut supervisor = Child::supervisor(&room, &plan);
    let mut learner = Child::attached(&room, &plan.lanes[0]);
    learner.must("reset");
    learner.must("hold 2");
    supervisor.kill();
    learner.kill();
    assert!(!room.files().is_empty(), "they had no chance to clean up");
    let mut clean = Child::start(&room, "program", "smaclite-pool clean");
    assert_eq!(clean.wait(SOON * 2).and_then(|status| status.code()), Some(0));
    room.assert_empty();
}
