//! Workers whose environment panics, and lanes that share them.

use crate::assert_says;
use smaclite_ipc::status;
use smaclite_tests::pools::games::Oddity;
use smaclite_tests::pools::process::eventually;
use smaclite_tests::pools::{Child, LanePlan, PoolPlan, Room};

#[test]
fn a_panic_takes_one_lane_out_and_no_other() {
    for threads in [1, 2] {
        let room = Room::new();
        let broken = LanePlan { oddity: Oddity::Panics { env: 2, step: 4 }, ..LanePlan::new("2s3z", 4) };
        let plan = PoolPlan::new([broken, LanePlan::new("3s5z", 4)]).threads(threads);
        let mut supervisor = Child::supervisor(&room, &plan);
        let mut unlucky = Child::attached(&room, &plan.lanes[0]);
        let mut other = Child::attached(&room, &plan.lanes[1]);
        other.must("reset");
        other.must("run");
        unlucky.must("reset");
        unlucky.must("step 3");
        let error = unlucky.ask("step").expect_err("it panicked");
        assert_says(&error, &["lane failed", "environment 2 broke in step 4"]);
        let error = unlucky.ask("reset").expect_err("the lane is out of service");
        assert_says(&error, &["environment 2 broke in step 4"]);
        unlucky.must("disconnect");
        let error = unlucky.ask("connect train").expect_err("the lane is out of service");
        assert_says(&error, &["`2s3z`", "environment 2 broke in step 4"]);
        let lanes = status(room.runtime_dir(), "train").expect("a status").lanes;
        assert_says(lanes[0].failure.as_deref().expect("a failure"), &["environment 2 broke"]);
        assert_eq!(lanes[1].failure, None);
        let before = lanes[1].stats.steps;
        let goes_on = || status(room.runtime_dir(), "train").expect("a status").lanes[1].stats.steps > before;
        assert!(eventually(goes_on), "the other lane stopped");
        other.kill();
        unlucky.end();
        supervisor.end();
        room.assert_empty();
    }
}

#[test]
fn lanes_of_different_weight_share_the_workers() {
    // A heavy lane's batch of 64 must not make a light lane's batch of 1 wait for all of it.
    let room = Room::new();
    let plan = PoolPlan::new([LanePlan::new("bane_vs_bane", 64), LanePlan::new("2s_vs_1sc", 1)]);
    let _supervisor = Child::supervisor(&room, &plan);
    let mut heavy = Child::attached(&room, &plan.lanes[0]);
    let mut light = Child::attached(&room, &plan.lanes[1]);
    heavy.must("reset");
    light.must("reset");
    heavy.must("run");
    light.must("run");
    let mut lanes = Vec::new();
    let heavy_goes_on = eventually(|| {
        lanes = status(room.runtime_dir(), "train").expect("a status").lanes;
        lanes[0].stats.frames > 50
    });
    let [heavy, light] = [&lanes[0].stats, &lanes[1].stats];
    println!("batches: {} of 64 x bane_vs_bane, {} of 1 x 2s_vs_1sc", heavy.frames, light.frames);
    assert!(heavy_goes_on, "the heavy lane starves: {heavy:?}");
    assert!(light.frames > heavy.frames, "the light lane waits behind the heavy one: {light:?}, {heavy:?}");
}
