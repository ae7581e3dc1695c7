//! A short [chaos run](smaclite_tests::chaos) as part of the tests; `just chaos MINUTES SEED` runs longer
//! ones.

use smaclite_tests::chaos;
use smaclite_tests::process::TIMEOUT;
use std::time::Duration;

#[test]
fn ten_seconds_of_chaos() {
    match chaos::run(Duration::from_secs(10), 1, TIMEOUT) {
        Ok(summary) => println!("{summary}"),
        Err(error) => panic!("{error}"),
    }
}
