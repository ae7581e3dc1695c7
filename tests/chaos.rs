//! A short [chaos run](smaclite_tests::chaos) as part of the tests; `just chaos MINUTES SEED` runs longer
//! ones.

use smaclite_tests::process::TIMEOUT;
use smaclite_tests::{chaos, roles};
use std::time::Duration;

/// Not a test: children start this program again, with a role.
#[test]
#[ignore = "children run it"]
fn role() {
    roles::run_if_child();
}

#[test]
fn ten_seconds_of_chaos() {
    match chaos::run(Duration::from_secs(10), 1, TIMEOUT) {
        Ok(summary) => println!("{summary}"),
        Err(error) => panic!("{error}"),
    }
}
