//! `torture MINUTES SEED`: kills, stops and restarts the processes of two pools at random for so long. Exits
//! with 0 if every invariant held, 1 if one did not, 2 for wrong usage.
#![forbid(unsafe_code)]

use smaclite_tests::pools::{role, torture};
use std::process::ExitCode;
use std::time::Duration;

/// The promise is a second; the rest is for machines with more to do.
const HANG: Duration = Duration::from_secs(4);

fn main() -> ExitCode {
    role::play_if_asked();
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let parsed = match &arguments[..] {
        [minutes, seed] => minutes.parse::<f64>().ok().zip(seed.parse::<u64>().ok()),
        _ => None,
    };
    let Some((minutes, seed)) = parsed.filter(|(minutes, _)| minutes.is_finite() && *minutes > 0.0) else {
        eprintln!("usage: torture MINUTES SEED   (a number like 0.5, and a whole number)");
        return ExitCode::from(2);
    };
    println!("torturing two pools for {minutes} minutes, seed {seed}");
    match torture::run(Duration::from_secs_f64(minutes * 60.0), seed, HANG) {
        Ok(summary) => {
            println!("{summary}\nevery invariant held");
            ExitCode::SUCCESS
        }
        Err(broken) => {
            println!("BROKEN: {broken}");
            ExitCode::FAILURE
        }
    }
}
