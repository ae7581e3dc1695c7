//! `chaos MINUTES SEED` runs the [chaos test](smaclite_tests::chaos). Exit status: 0 if every invariant held,
//! 1 if one did not, 2 for wrong arguments.
#![forbid(unsafe_code)]

use smaclite_tests::{chaos, roles};
use std::process::ExitCode;
use std::time::Duration;

/// Processes should report at least once per second; the rest is for busy machines.
const MAX_SILENCE: Duration = Duration::from_secs(4);

fn main() -> ExitCode {
    roles::run_if_child();
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let parsed = match &arguments[..] {
        [minutes, seed] => minutes.parse::<f64>().ok().zip(seed.parse::<u64>().ok()),
        _ => None,
    };
    let Some((minutes, seed)) = parsed.filter(|(minutes, _)| minutes.is_finite() && *minutes > 0.0) else {
        eprintln!(
            "usage: chaos MINUTES SEED   (MINUTES > 0, such as 0.5; SEED an integer from 0 to 2^64 - 1)"
        );
        return ExitCode::from(2);
    };
    println!("chaos test of two pools for {minutes} minutes, seed {seed}");
    match chaos::run(Duration::from_secs_f64(minutes * 60.0), seed, MAX_SILENCE) {
        Ok(summary) => {
            println!("{summary}\nevery invariant held");
            ExitCode::SUCCESS
        }
        Err(error) => {
            println!("FAILED: {error}");
            ExitCode::FAILURE
        }
    }
}
