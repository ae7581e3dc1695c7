//! Spectators that never read, stop, or die.

use rustix::process::Signal;
use smaclite_ipc::{Spectator, Supervisor};
use smaclite_tests::pools::games::Oddity;
use smaclite_tests::pools::process::SOON;
use smaclite_tests::pools::raw::{frame_subscriber, node};
use smaclite_tests::pools::role::WATCHING;
use smaclite_tests::pools::{Child, LanePlan, Player, PoolPlan, Room};

#[test]
fn nobody_notices_a_spectator_that_never_reads() {
    let room = Room::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 4)]);
    let _supervisor = Child::supervisor(&room, &plan);
    let mut learner = Child::attached(&room, &plan.lanes[0]);
    learner.must("reset");
    let status = smaclite_ipc::status(room.runtime_dir(), "train").expect("a status");
    let node = node(room.runtime_dir());
    let lane = &status.lanes[0].description;
    let idle = frame_subscriber(&node, lane);
    let hoarder = frame_subscriber(&node, lane);
    let mut hoard = Vec::new();
    for _ in 0..20 {
        learner.must("step 10");
        hoard.extend(hoarder.receive().ok().flatten());
    }
    learner.must("hold 4");
    learner.must("check");
    drop((idle, hoard));
    learner.must("drop");
    learner.must("step 50");
}

#[test]
fn nobody_notices_spectators_that_stop_or_die() {
    let room = Room::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 4)]);
    let mut supervisor = Child::supervisor(&room, &plan);
    let mut learner = Child::attached(&room, &plan.lanes[0]);
    learner.must("reset");
    for round in 0..8 {
        let spectator = |how: &str| {
            let child = Child::start(&room, "spectator", how);
            assert_eq!(child.answer(SOON * 2).as_deref(), Ok("connected"));
            child
        };
        let mut one = spectator("2s3z");
        let mut two = spectator("2s3z");
        learner.must("step 5");
        assert_eq!(one.answer(SOON).as_deref(), Ok(WATCHING));
        assert_eq!(two.answer(SOON).as_deref(), Ok(WATCHING));
        learner.must("hold 4");
        one.signal(Signal::STOP);
        learner.must("check");
        learner.must("drop");
        learner.must("step 20");
        if round % 2 == 0 {
            one.signal(Signal::CONT);
        }
        one.kill();
        two.kill();
        learner.must("step 20");
    }
    learner.end();
    supervisor.end();
    room.assert_empty();
}

/// `latest` gave the batch it held back before it had read the newer frame, and was left with nothing if that
/// was an error report.
#[test]
fn a_spectator_keeps_the_newest_batch_when_an_error_report_comes() {
    let room = Room::new();
    let broken = LanePlan { oddity: Oddity::Panics { env: 2, step: 4 }, ..LanePlan::new("2s3z", 4) };
    let plan = PoolPlan::new([broken]);
    let _supervisor = Supervisor::start(plan.config(room.runtime_dir())).expect("a pool");
    let mut spectator = Spectator::connect(room.runtime_dir(), "train", None).expect("a spectator");
    let mut newest = || spectator.latest().expect("the pool lives").map(|batch| batch.sequence());
    let mut player = Player::connect(room.runtime_dir(), "train", &plan.lanes[0]).expect("a client");
    assert_eq!(newest(), None);
    player.reset(None, SOON).expect("a reset");
    for sequence in 2..=4 {
        player.step(SOON).expect("a step");
        assert_eq!([newest(), newest()], [Some(sequence); 2]);
    }
    let error = player.step(SOON).err().expect("it panics");
    assert!(error.to_string().contains("environment 2 broke"), "{error}");
    assert_eq!([newest(), newest()], [Some(4); 2]);
}
