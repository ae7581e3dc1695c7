//! `long_run STEPS SEED [SCENARIO...]` runs the [long run](smaclite_tests::long_run), on all standard
//! scenarios if none is named. Exit status: 0 if every step was right and no resource grew, 1 if not, 2 for
//! wrong arguments.
#![forbid(unsafe_code)]

use smaclite_scenarios::Scenario;
use smaclite_tests::long_run;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let parsed = match &arguments[..] {
        [steps, seed, ..] => steps.parse::<u64>().ok().zip(seed.parse::<u64>().ok()),
        _ => None,
    };
    let Some((steps, seed)) = parsed.filter(|(steps, _)| *steps > 0) else {
        eprintln!("usage: long_run STEPS SEED [SCENARIO...]   (STEPS at least 1; SEED from 0 to 2^64 - 1)");
        return ExitCode::from(2);
    };
    let mut scenarios = arguments[2..].to_vec();
    if scenarios.is_empty() {
        scenarios = Scenario::standard_names().map(str::to_owned).collect();
    }
    println!("long run of {steps} steps, seed {seed}: {}", scenarios.join(" "));
    match long_run::run(steps, seed, &scenarios, true, |summary| println!("{} steps", summary.steps)) {
        Ok(summary) => {
            println!("{summary}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            println!("FAILED: {error}");
            ExitCode::FAILURE
        }
    }
}
