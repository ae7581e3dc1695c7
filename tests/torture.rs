//! A short torture run with every test run; `just torture MINUTES SEED` is the long one.

use smaclite_tests::pools::process::SOON;
use smaclite_tests::pools::{role, torture};
use std::time::Duration;

/// Not a test: what children run, which are this program with a role.
#[test]
#[ignore = "children run it"]
fn role() {
    role::play_if_asked();
}

#[test]
fn ten_seconds_of_torture() {
    match torture::run(Duration::from_secs(10), 1, SOON) {
        Ok(summary) => println!("{summary}"),
        Err(broken) => panic!("{broken}"),
    }
}
