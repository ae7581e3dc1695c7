//! Environments that panic.

use crate::assert_contains;
use smaclite_tests::fault::Fault;
use smaclite_tests::{Child, LanePlan, PoolPlan, TestDir};

/// That other lanes go on is tested in `in_memory::rejections`.
#[test]
fn a_lane_that_failed_says_why_to_its_learner_and_to_every_later_one() {
    let dir = TestDir::new();
    let broken = LanePlan::new("2s3z", 4).fault(2, Fault::PanicInStep(4));
    let plan = PoolPlan::new([broken, LanePlan::new("3s5z", 4)]);
    let mut supervisor = Child::supervisor(&dir, &plan);
    let mut failed = Child::attached(&dir, &plan.lanes[0]);
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
    failed.end();
    supervisor.end();
    dir.assert_empty();
}
