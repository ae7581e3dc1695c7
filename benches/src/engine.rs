//! What the measurements of the engine have in common: the battles that they play. Times differ between runs
//! and between machines; instructions hardly do, so changes of the engine are judged by instructions first.

use smaclite_cli::bench::policy::Policy;
use smaclite_engine::{BattleSetup, Rules};
use smaclite_lab::{ActionTrace, AfterEpisode, TracePlayer};
use smaclite_scenarios::{Scenario, ScenarioError, ScenarioFiles};
use std::sync::Arc;

/// Which battles are played.
#[derive(clap::Args)]
pub(crate) struct Plays {
    /// How the agents choose their actions
    #[arg(long, value_enum, default_value = "nearest")]
    pub(crate) policy: Policy,
    /// Rules of the battles: smaclite, paper or starcraft
    #[arg(long, default_value = "smaclite")]
    pub(crate) rules: Rules,
    /// Steps per scenario, from the first episode of seed 1 on
    #[arg(long, default_value_t = 200)]
    pub(crate) steps: usize,
    /// Names or files of scenarios [default: the standard scenarios]
    #[arg(value_name = "SCENARIO")]
    pub(crate) scenarios: Vec<String>,
}

impl Plays {
    pub(crate) fn scenarios(&self) -> Vec<String> {
        if self.scenarios.is_empty() {
            Scenario::standard_names().map(str::to_owned).collect()
        } else {
            self.scenarios.clone()
        }
    }
}

/// Records the steps of a battle, and makes the player for them.
pub(crate) fn record(
    scenario: &str,
    rules: Rules,
    policy: Policy,
    steps: usize,
) -> Result<(TracePlayer, ActionTrace), ScenarioError> {
    let setup = BattleSetup { rules, ..BattleSetup::new(ScenarioFiles::resolve(scenario)?.1) };
    let arena = Arc::new(setup.arena()?.1);
    let trace = policy.record(&arena, 1, steps, AfterEpisode::ResetAndPlay);
    Ok((TracePlayer::new(arena), trace))
}
