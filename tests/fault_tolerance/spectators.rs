//! Spectators that never read, stop, or die.

use rustix::process::Signal;
use smaclite_ipc::{Spectator, WaitOptions};
use smaclite_tests::fault::Fault;
use smaclite_tests::process::TIMEOUT;
use smaclite_tests::raw_client::{frame_subscriber, node};
use smaclite_tests::roles::FIRST_FRAME;
use smaclite_tests::{Child, LanePlan, PoolPlan, TestDir};

#[test]
fn a_spectator_that_never_reads_disturbs_no_other_process() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 4)]);
    let (_supervisor, mut learner) = Child::supervisor_and_learner(&dir, &plan);
    let status = dir.status();
    let node = node(dir.runtime_dir());
    let lane = &status.lanes[0].description;
    let idle = frame_subscriber(&node, lane);
    let holder = frame_subscriber(&node, lane);
    let mut held = Vec::new();
    for _ in 0..20 {
        learner.must("step 10");
        held.extend(holder.receive().ok().flatten());
    }
    learner.must("hold 4");
    learner.must("check");
    drop((idle, held));
    learner.must("drop");
    learner.must("step 50");
}

#[test]
fn spectators_that_stop_or_die_disturb_no_other_process() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 4)]);
    let (mut supervisor, mut learner) = Child::supervisor_and_learner(&dir, &plan);
    for repetition in 0..8 {
        let spectator = || {
            let child = Child::start(&dir, "spectator 2s3z");
            assert_eq!(child.answer(TIMEOUT * 2).as_deref(), Ok("connected"));
            child
        };
        let mut one = spectator();
        let mut two = spectator();
        learner.must("step 5");
        assert_eq!(one.answer(TIMEOUT).as_deref(), Ok(FIRST_FRAME));
        assert_eq!(two.answer(TIMEOUT).as_deref(), Ok(FIRST_FRAME));
        learner.must("hold 4");
        one.signal(Signal::STOP);
        learner.must("check");
        learner.must("drop");
        learner.must("step 20");
        if repetition % 2 == 0 {
            one.signal(Signal::CONT);
        }
        one.kill();
        two.kill();
        learner.must("step 20");
    }
    learner.end();
    supervisor.end();
    dir.assert_empty();
}

/// `latest` released the batch that it held before it had read the newer frame, and so had none if that was
/// an error report.
#[test]
fn a_spectator_keeps_the_newest_batch_when_an_error_report_comes() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 4).fault(2, Fault::PanicInStep(4))]);
    let _supervisor = dir.start(&plan);
    let mut spectator = Spectator::connect(dir.runtime_dir(), "train", None, WaitOptions::for_response())
        .expect("a spectator");
    let mut newest = || spectator.latest().expect("the pool lives").map(|batch| batch.sequence());
    let mut learner = dir.learner(&plan.lanes[0]);
    assert_eq!(newest(), None);
    learner.reset(None, TIMEOUT).expect("a reset");
    for sequence in 2..=4 {
        learner.step(TIMEOUT).expect("a step");
        assert_eq!([newest(), newest()], [Some(sequence); 2]);
    }
    let error = learner.step(TIMEOUT).expect_err("it panics");
    assert!(error.to_string().contains("environment 2 broke"), "{error}");
    assert_eq!([newest(), newest()], [Some(4); 2]);
}
