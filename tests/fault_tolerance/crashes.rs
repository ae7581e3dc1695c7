//! Supervisors that are killed at any point of their start or end.

use smaclite_tests::crash_points::{CALLS, check, has_strace};
use smaclite_tests::{LanePlan, PoolPlan, skip};

/// After a kill before the socket was created, `NAME.lock` stayed; after one while iceoryx2 created its
/// counter, the next `clean` failed.
#[test]
fn one_clean_removes_everything_of_a_start_that_was_killed() {
    if !has_strace() {
        return skip("crash points need `strace`, and permission to trace children");
    }
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2)]);
    for (call, most) in CALLS {
        let mut killed = 0;
        for nth in 1..=most {
            match check(&plan, call, nth) {
                Ok(true) => killed += 1,
                Ok(false) => break,
                Err(error) => panic!("{error}"),
            }
        }
        println!("{call}: killed at {killed} points");
    }
}
