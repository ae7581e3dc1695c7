//! Environments that panic, and lanes that share worker threads.

use crate::assert_contains;
use smaclite_tests::fault::Fault;
use smaclite_tests::process::eventually;
use smaclite_tests::{Child, LanePlan, PoolPlan, TestDir};

#[test]
fn a_panic_ends_its_lane_and_no_other() {
    for threads in [1, 2] {
        let dir = TestDir::new();
        let broken = LanePlan::new("2s3z", 4).fault(2, Fault::PanicInStep(4));
        let plan = PoolPlan::new([broken, LanePlan::new("3s5z", 4)]).threads(threads);
        let mut supervisor = Child::supervisor(&dir, &plan);
        let mut failed = Child::attached(&dir, &plan.lanes[0]);
        let mut other = Child::attached(&dir, &plan.lanes[1]);
        other.must("reset");
        other.must("run");
        failed.must("reset");
        failed.must("step 3");
        let error = failed.ask("step").expect_err("it panicked");
        assert_contains(&error, &["lane failed", "environment 2 broke in step 4"]);
        let error = failed.ask("reset").expect_err("the lane has failed");
        assert_contains(&error, &["environment 2 broke in step 4"]);
        failed.must("disconnect");
        let error = failed.ask("connect train").expect_err("the lane has failed");
        assert_contains(&error, &["`2s3z`", "environment 2 broke in step 4"]);
        let lanes = dir.status().lanes;
        assert_contains(lanes[0].failure.as_deref().expect("a failure"), &["environment 2 broke"]);
        assert_eq!(lanes[1].failure, None);
        let before = lanes[1].stats.steps;
        let continues = || dir.status().lanes[1].stats.steps > before;
        assert!(eventually(continues), "the other lane stopped");
        other.kill();
        failed.end();
        supervisor.end();
        dir.assert_empty();
    }
}

#[test]
fn a_light_lane_does_not_wait_for_a_heavy_one() {
    // A batch of 64 slow environments must not delay one of a single fast environment until it is complete.
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("bane_vs_bane", 64), LanePlan::new("2s_vs_1sc", 1)]);
    let _supervisor = Child::supervisor(&dir, &plan);
    let mut heavy = Child::attached(&dir, &plan.lanes[0]);
    let mut light = Child::attached(&dir, &plan.lanes[1]);
    heavy.must("reset");
    light.must("reset");
    heavy.must("run");
    light.must("run");
    let mut lanes = Vec::new();
    let heavy_continues = eventually(|| {
        lanes = dir.status().lanes;
        lanes[0].stats.frames > 10
    });
    let [heavy, light] = [&lanes[0].stats, &lanes[1].stats];
    println!("batches: {} of 64 x bane_vs_bane, {} of 1 x 2s_vs_1sc", heavy.frames, light.frames);
    assert!(heavy_continues, "the heavy lane starves: {heavy:?}");
    assert!(light.frames > heavy.frames, "the light lane waits behind the heavy one: {light:?}, {heavy:?}");
}
