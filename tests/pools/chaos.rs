//! A short [chaos run](smaclite_tests::chaos) and a short [long run](smaclite_tests::long_run) as part of the
//! tests; `just chaos MINUTES SEED` and `just long-run STEPS SEED` run longer ones.

use smaclite_tests::process::TIMEOUT;
use smaclite_tests::{chaos, long_run};
use std::time::Duration;

#[test]
fn ten_seconds_of_chaos() {
    match chaos::run(Duration::from_secs(10), 1, TIMEOUT) {
        Ok(summary) => println!("{summary}"),
        Err(error) => panic!("{error}"),
    }
}

#[test]
fn pools_of_random_settings_show_the_checksums_of_the_engine_alone() {
    let scenarios = ["3m", "terran_5_vs_5", "2s_vs_1sc", "protoss_5_vs_5"].map(str::to_owned);
    let summary = long_run::run(60_000, 5, &scenarios, false, |_| ()).expect("right frames");
    assert!(summary.steps >= 60_000 && summary.pools > 1, "{summary}");
}
