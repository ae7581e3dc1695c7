//! What one battle costs: its time, and its instructions phase by phase. Time differs from run to run and
//! from machine to machine; instructions hardly do, so they are what changes to the engine are judged by.

mod instructions;
mod play;
mod times;

pub(crate) use instructions::{instructions, play_once};
pub(crate) use times::times;

use smaclite_scenarios::Scenario;

/// What to play.
#[derive(clap::Args)]
pub(crate) struct Plays {
    /// Who plays: `nearest` or `random`
    #[arg(long, default_value = "nearest", value_parser = ["nearest", "random"])]
    policy: String,
    /// Steps of each scenario, from the first episode of seed 1 on
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
