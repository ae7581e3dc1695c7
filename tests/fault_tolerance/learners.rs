//! Learners that die, stop, hold too many frames, or attach to a lane in use.

use crate::assert_contains;
use rustix::process::{Pid, Resource, Rlimit, Signal, getrlimit, prlimit};
use smaclite_ipc::{Spectator, WaitOptions, WaitStrategy};
use smaclite_tests::process::eventually;
use smaclite_tests::{Child, LanePlan, PoolPlan, TestDir};
use std::path::Path;

/// Attaches to the lane as soon as it is free.
fn attach_when_free(child: &mut Child) {
    let mut last = String::new();
    let attached = eventually(|| child.ask("connect train").map_err(|error| last = error).is_ok());
    assert!(attached, "the lane was not freed: {last}");
}

#[test]
fn a_killed_learner_frees_its_lane_and_leaves_the_other_lane_alone() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 4), LanePlan::new("3s5z", 4)]);
    let mut supervisor = Child::supervisor(&dir, &plan);
    let mut neighbour = Child::attached(&dir, &plan.lanes[1]);
    neighbour.must("reset");
    neighbour.must("run");
    // More repetitions than the lane has frames: those of dead learners must become free again.
    for repetition in 0..12 {
        let mut learner = Child::attached(&dir, &plan.lanes[0]);
        learner.must("reset");
        learner.must("hold 4");
        if repetition % 2 == 0 {
            learner.must("drop");
            learner.must("run"); // killed while it sends and receives
        }
        learner.kill();
        let mut successor = Child::learner(&dir, &plan.lanes[0]);
        attach_when_free(&mut successor);
        let error = successor.ask("step").expect_err("nothing was reset");
        assert_contains(&error, &["reset"]);
        successor.must("reset");
        successor.must("hold 4");
        successor.must("check");
        successor.end();
    }
    assert!(
        neighbour.answer(std::time::Duration::ZERO).is_err_and(|e| e.contains("no answer")),
        "it continues"
    );
    neighbour.kill();
    supervisor.end();
    dir.assert_empty();
}

#[test]
fn a_learner_killed_during_a_request_does_not_disturb_its_successor() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 6)]).threads(2);
    let _supervisor = Child::supervisor(&dir, &plan);
    for _ in 0..10 {
        let mut learner = Child::attached(&dir, &plan.lanes[0]);
        learner.must("reset");
        learner.must("step 3");
        learner.must("send");
        learner.kill();
        let mut successor = Child::learner(&dir, &plan.lanes[0]);
        attach_when_free(&mut successor);
        successor.must("reset"); // compares with its own reference
        successor.must("step 5");
        successor.end();
    }
}

#[test]
fn a_second_learner_is_refused_with_the_process_id_of_the_first() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2)]);
    let _supervisor = Child::supervisor(&dir, &plan);
    let mut first = Child::attached(&dir, &plan.lanes[0]);
    let mut second = Child::learner(&dir, &plan.lanes[0]);
    let error = second.ask("connect train").expect_err("the lane is in use");
    assert_contains(&error, &["2s3z", &format!("process {}", first.pid())]);
    let lane = &dir.status().lanes[0];
    assert_eq!(lane.learner_pid, Some(first.pid()));
    first.must("reset");
    first.must("step 3"); // undisturbed
    first.must("disconnect");
    second.must("connect train");
    let error = first.ask("connect train").expect_err("now the second has the lane");
    assert_contains(&error, &[&format!("process {}", second.pid())]);
}

/// Where pools do not use Linux's sockets, every tenth was told that the lane still has a learner.
#[test]
fn a_lane_is_free_as_soon_as_its_learner_or_spectator_has_left() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2)]);
    let _supervisor = Child::supervisor(&dir, &plan);
    for _ in 0..200 {
        let attached = dir.connect(None, WaitStrategy::default(), WaitOptions::no_wait());
        drop(attached.expect("a lane without a learner"));
        let watching = Spectator::connect(dir.runtime_dir(), "train", None, WaitOptions::for_response());
        drop(watching.expect("a lane without a spectator"));
    }
}

#[test]
fn a_stopped_learner_keeps_its_lane_and_continues_later() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 4), LanePlan::new("3s5z", 4)]);
    let (_supervisor, mut stopped) = Child::supervisor_and_learner(&dir, &plan);
    stopped.must("hold 3");
    stopped.must("send");
    stopped.signal(Signal::STOP);
    let mut other = Child::attached(&dir, &plan.lanes[1]);
    other.must("reset");
    other.must("step 50");
    let mut second = Child::learner(&dir, &plan.lanes[0]);
    assert_contains(&second.ask("connect train").expect_err("it is only stopped"), &["process"]);
    stopped.signal(Signal::CONT);
    stopped.must("recv 5000");
    stopped.must("check");
    stopped.must("drop");
    stopped.must("step 20");
}

#[test]
fn holding_too_many_frames_is_an_error_until_some_are_dropped() {
    let dir = TestDir::new();
    let lane = LanePlan { max_held_batches: 3, spectators: 0, ..LanePlan::new("2s3z", 4) };
    let plan = PoolPlan::new([lane]);
    let (_supervisor, mut learner) = Child::supervisor_and_learner(&dir, &plan);
    learner.must("hold 3");
    learner.must("send");
    let error = learner.ask("recv 5000").expect_err("no frame is free");
    assert_contains(&error, &["all 3 batches", "drop", "max_held_batches"]);
    learner.must("check");
    learner.must("drop");
    learner.must("recv 5000"); // the result of the step was not lost
    learner.must("step 10");
}

#[test]
fn frames_of_a_client_that_is_gone_do_not_change() {
    // iceoryx2 reclaims the samples of a dropped subscriber, so a batch must keep its subscriber.
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan { spectators: 0, ..LanePlan::new("2s3z", 4) }]);
    let (mut supervisor, mut learner) = Child::supervisor_and_learner(&dir, &plan);
    learner.must("hold 2");
    learner.must("disconnect");
    learner.must("connect train");
    learner.must("reset");
    learner.must("step 50");
    learner.must("hold 2");
    learner.must("check");
    learner.must("disconnect");
    // The number of such clients has a limit; beyond it attaching fails with the reason, and the lane lives.
    let error = learner.ask("connect train").expect_err("two clients' frames are still held");
    assert_contains(&error, &["held", "drop"]);
    learner.must("check");
    learner.must("drop");
    learner.must("connect train");
    learner.must("reset");
    learner.must("step 10");
    supervisor.kill();
}

/// A pool that could not open a learner's requests only logged it, and the learner waited without end for
/// its first batch. Whatever the pool is short of when a learner or a spectator attaches, that one is told,
/// and others go on.
#[test]
fn a_learner_that_the_pool_cannot_connect_to_is_told_why() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2), LanePlan::new("3m", 2)]);
    let (supervisor, mut first) = Child::supervisor_and_learner(&dir, &plan);
    let pid = Pid::from_raw(supervisor.pid() as i32).expect("a process id");
    let is_free = |number: &u64| !Path::new(&format!("/proc/{}/fd/{number}", supervisor.pid())).exists();
    let before = getrlimit(Resource::Nofile);
    // How many descriptors a connection needs is iceoryx2's matter: each number is tried until one is enough.
    let enough = (0..64).find(|&spare| {
        let limit = (0..).filter(is_free).nth(spare);
        prlimit(Some(pid), Resource::Nofile, Rlimit { current: limit, ..before }).expect("a limit");
        let mut second = Child::learner(&dir, &plan.lanes[1]);
        let attached = second.ask("connect train");
        if let Err(error) = &attached {
            println!("{spare} free descriptors: {error}");
            let process = format!("(process {})", supervisor.pid());
            assert_contains(error, &[&process, "file descriptors are open, and the limit is", "`ulimit -n`"]);
        } else {
            second.must("reset");
            second.must("step 5");
            second.must("disconnect");
        }
        first.must("step 5");
        attached.is_ok()
    });
    prlimit(Some(pid), Resource::Nofile, before).expect("the limit from before");
    assert!(enough > Some(0), "{enough:?} free descriptors were enough");
    let mut second = Child::learner(&dir, &plan.lanes[1]);
    second.must("connect train");
    second.must("reset");
    first.must("check");
}
