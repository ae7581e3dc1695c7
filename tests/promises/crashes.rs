//! A supervisor that is killed at any point of its start or end.

use smaclite_tests::pools::crash::{CALLS, has_strace, survives};
use smaclite_tests::pools::{LanePlan, PoolPlan};

/// A kill before the socket was there left `NAME.lock` for good, and one while iceoryx2 made its counter made
/// the next `clean` fail.
#[test]
fn one_clean_leaves_nothing_of_a_start_that_was_killed() {
    if !has_strace() {
        println!("skipped: crash points need `strace`, and permission to trace children");
        return;
    }
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2)]);
    for (call, most) in CALLS {
        let mut killed = 0;
        for nth in 1..=most {
            match survives(&plan, call, nth) {
                Ok(true) => killed += 1,
                Ok(false) => break,
                Err(broken) => panic!("{broken}"),
            }
        }
        println!("{call}: killed at {killed} points");
    }
}
