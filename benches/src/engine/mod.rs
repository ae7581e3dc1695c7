//! The cost of one battle: its time, and its number of instructions by phase. Time differs between runs and
//! machines; instruction counts hardly do, so changes to the engine are judged by them.

mod instructions;
mod play;
mod times;

pub(crate) use instructions::{instructions, play_once};
pub(crate) use times::times;

use smaclite_scenarios::Scenario;

/// The battles to play.
#[derive(clap::Args)]
pub(crate) struct Plays {
    /// The policy: `nearest` or `random`
    #[arg(long, default_value = "nearest", value_parser = ["nearest", "random"])]
    policy: String,
    /// Number of steps per scenario, from the first episode of seed 1 on
    #[arg(long, default_value_t = 200)]
    steps: usize,
    /// Names or files of scenarios; the standard ones if none are given
    scenarios: Vec<String>,
}

impl Plays {
    fn scenarios(&self) -> Vec<String> {
        if self.scenarios.is_empty() {
            Scenario::standard_names().map(str::to_owned).collect()
        } else {
            self.scenarios.clone()
        }
    }
}
