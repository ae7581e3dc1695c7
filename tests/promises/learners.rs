//! Learners that die, stop, hold too much, or come second.

use crate::assert_says;
use rustix::process::{Pid, Resource, Rlimit, Signal, getrlimit, prlimit};
use smaclite_ipc::{ROOT_VARIABLE, status};
use smaclite_tests::pools::process::{ROLE_VARIABLE, SOON, eventually, eventually_within};
use smaclite_tests::pools::raw::{node, requests};
use smaclite_tests::pools::{Child, LanePlan, PoolPlan, Room};
use std::path::Path;
use std::process::Command;

/// Attaches as soon as the lane is free.
fn attach_when_free(child: &mut Child) {
    let mut last = String::new();
    let attached = eventually(|| child.ask("connect train").map_err(|error| last = error).is_ok());
    assert!(attached, "the lane was not freed: {last}");
}

#[test]
fn a_killed_learner_frees_its_lane_and_leaves_the_other_lane_alone() {
    let room = Room::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 4), LanePlan::new("3s5z", 4)]);
    let mut supervisor = Child::supervisor(&room, &plan);
    let mut neighbour = Child::attached(&room, &plan.lanes[1]);
    neighbour.must("reset");
    neighbour.must("run");
    // More rounds than the lane has frames: what the dead held must come back.
    for round in 0..12 {
        let mut learner = Child::attached(&room, &plan.lanes[0]);
        learner.must("reset");
        learner.must("hold 4");
        if round % 2 == 0 {
            learner.must("drop");
            learner.must("run"); // killed while it sends and receives
        }
        learner.kill();
        let mut successor = Child::learner(&room, &plan.lanes[0]);
        attach_when_free(&mut successor);
        let error = successor.ask("step").expect_err("nothing was reset");
        assert_says(&error, &["reset"]);
        successor.must("reset");
        successor.must("hold 4");
        successor.must("check");
        successor.end();
    }
    assert!(
        neighbour.answer(std::time::Duration::ZERO).is_err_and(|e| e.contains("no answer")),
        "it goes on"
    );
    neighbour.kill();
    supervisor.end();
    room.assert_empty();
}

#[test]
fn a_learner_killed_with_a_request_under_way_does_not_disturb_its_successor() {
    let room = Room::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 6)]).threads(2);
    let _supervisor = Child::supervisor(&room, &plan);
    for _ in 0..10 {
        let mut learner = Child::attached(&room, &plan.lanes[0]);
        learner.must("reset");
        learner.must("step 3");
        learner.must("send");
        learner.kill();
        let mut successor = Child::learner(&room, &plan.lanes[0]);
        attach_when_free(&mut successor);
        successor.must("reset"); // compares with a run of its own
        successor.must("step 5");
        successor.end();
    }
}

#[test]
fn a_second_learner_is_refused_with_the_process_of_the_first() {
    let room = Room::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2)]);
    let _supervisor = Child::supervisor(&room, &plan);
    let mut first = Child::attached(&room, &plan.lanes[0]);
    let mut second = Child::learner(&room, &plan.lanes[0]);
    let error = second.ask("connect train").expect_err("the lane is taken");
    assert_says(&error, &["2s3z", &format!("process {}", first.pid())]);
    let lane = &status(room.runtime_dir(), "train").expect("a status").lanes[0];
    assert_eq!(lane.learner_pid, Some(first.pid()));
    first.must("reset");
    first.must("step 3"); // undisturbed
    first.must("disconnect");
    second.must("connect train");
    let error = first.ask("connect train").expect_err("now the other way round");
    assert_says(&error, &[&format!("process {}", second.pid())]);
}

#[test]
fn a_stopped_learner_keeps_its_lane_and_goes_on_later() {
    let room = Room::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 4), LanePlan::new("3s5z", 4)]);
    let _supervisor = Child::supervisor(&room, &plan);
    let mut stopped = Child::attached(&room, &plan.lanes[0]);
    stopped.must("reset");
    stopped.must("hold 3");
    stopped.must("send");
    stopped.signal(Signal::STOP);
    let mut other = Child::attached(&room, &plan.lanes[1]);
    other.must("reset");
    other.must("step 50");
    let mut second = Child::learner(&room, &plan.lanes[0]);
    assert_says(&second.ask("connect train").expect_err("it is only stopped"), &["process"]);
    stopped.signal(Signal::CONT);
    stopped.must("recv 5000");
    stopped.must("check");
    stopped.must("drop");
    stopped.must("step 20");
}

#[test]
fn holding_too_many_frames_is_an_error_that_passes() {
    let room = Room::new();
    let lane = LanePlan { max_held_batches: 3, spectators: 0, ..LanePlan::new("2s3z", 4) };
    let plan = PoolPlan::new([lane]);
    let _supervisor = Child::supervisor(&room, &plan);
    let mut learner = Child::attached(&room, &plan.lanes[0]);
    learner.must("reset");
    learner.must("hold 3");
    learner.must("send");
    let error = learner.ask("recv 5000").expect_err("no frame is free");
    assert_says(&error, &["all 3 batches", "drop", "max_held_batches"]);
    learner.must("check");
    learner.must("drop");
    learner.must("recv 5000"); // the step's result was not lost
    learner.must("step 10");
}

#[test]
fn frames_of_a_client_that_is_gone_stay_as_they_are() {
    // iceoryx2 takes a dropped subscriber's samples back, so a batch must keep its subscriber.
    let room = Room::new();
    let plan = PoolPlan::new([LanePlan { spectators: 0, ..LanePlan::new("2s3z", 4) }]);
    let mut supervisor = Child::supervisor(&room, &plan);
    let mut learner = Child::attached(&room, &plan.lanes[0]);
    learner.must("reset");
    learner.must("hold 2");
    learner.must("disconnect");
    learner.must("connect train");
    learner.must("reset");
    learner.must("step 50");
    learner.must("hold 2");
    learner.must("check");
    learner.must("disconnect");
    // Such leftovers have a limit; beyond it attaching fails and says why, and the lane lives.
    let error = learner.ask("connect train").expect_err("two clients' frames are still held");
    assert_says(&error, &["held", "drop"]);
    learner.must("check");
    learner.must("drop");
    learner.must("connect train");
    learner.must("reset");
    learner.must("step 10");
    supervisor.kill();
}

/// A lane that could not read a learner's requests once waited without a word, and so did the learner.
#[test]
fn requests_that_cannot_be_read_are_logged() {
    let room = Room::new();
    let log = tempfile::NamedTempFile::new().expect("a file");
    let mut program = Command::new(std::env::current_exe().expect("a path of this program"));
    program.args(["--exact", "role", "--ignored", "--nocapture"]).env(ROOT_VARIABLE, room.root());
    program.env(ROLE_VARIABLE, "program smaclite-pool serve 2s3z:2 --name train --threads 1");
    program.stderr(log.reopen().expect("the same file"));
    let mut program = Child::of_command(&mut program, "program");
    assert!(eventually_within(SOON * 2, || status(room.runtime_dir(), "train").is_ok()), "it does not serve");
    let lane = status(room.runtime_dir(), "train").expect("a status").lanes.remove(0).description;
    let node = node(room.runtime_dir());
    // Without file descriptors it cannot open what the learner writes to.
    let pid = Pid::from_raw(program.pid() as i32).expect("a process number");
    let is_free = |number: &u64| !Path::new(&format!("/proc/{}/fd/{number}", program.pid())).exists();
    let before = getrlimit(Resource::Nofile);
    let first_free = (0..).find(is_free);
    prlimit(Some(pid), Resource::Nofile, Rlimit { current: first_free, ..before }).expect("a limit");
    let _requests = requests(&node, &lane, 1 << 12);
    let log_says = |part: &str| std::fs::read_to_string(log.path()).is_ok_and(|text| text.contains(part));
    let logged = eventually(|| log_says("requests could not be received"));
    prlimit(Some(pid), Resource::Nofile, before).expect("the limit of before");
    assert!(logged, "{}", std::fs::read_to_string(log.path()).unwrap_or_default());
    program.signal(Signal::TERM);
    assert_eq!(program.wait(SOON).and_then(|status| status.code()), Some(0));
}
