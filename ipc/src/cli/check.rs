//! `smaclite-pool check`: validate scenario and unit files before anything runs.

use super::Outcome;
use clap::Args;
use smaclite_engine::{Arena, Rules};
use smaclite_scenarios::Scenario;
use smaclite_units::UnitType;
use std::error::Error;
use std::path::{Path, PathBuf};

#[derive(Args)]
pub(super) struct Check {
    /// Scenario or unit files (JSON)
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
}

impl Check {
    pub(super) fn run(self) -> Outcome {
        let mut wrong = 0;
        for file in &self.files {
            match describe(file) {
                Ok(summary) => out!("{}: {summary}", file.display())?,
                Err(error) => {
                    eprintln!("{error}");
                    wrong += 1;
                }
            }
        }
        let total = self.files.len();
        if wrong > 0 { Err(format!("{wrong} of {total} files are wrong").into()) } else { Ok(()) }
    }
}

/// A scenario has groups, a unit does not.
fn describe(file: &Path) -> Result<String, Box<dyn Error>> {
    let text = std::fs::read_to_string(file).map_err(|e| format!("{}: {e}", file.display()))?;
    let is_scenario = serde_json::from_str::<serde_json::Value>(&text)
        .map_or(text.contains("\"groups\""), |value| value.get("groups").is_some());
    if !is_scenario {
        let unit = UnitType::load(file)?;
        return Ok(format!(
            "a correct unit: {} hp, {} damage, range {}, speed {}",
            unit.hp, unit.damage, unit.attack_range, unit.speed
        ));
    }
    let scenario = Scenario::load(file)?;
    let s = Arena::new(&scenario, Rules::default()).sizes();
    Ok(format!(
        "a correct scenario: {} agents against {} enemies, {} actions, obs {}, state {}",
        s.n_agents, s.n_enemies, s.n_actions, s.obs_size, s.state_size
    ))
}
