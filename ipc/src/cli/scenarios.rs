//! `smaclite-pool scenarios`: the standard scenarios and their sizes.

use super::{Outcome, heading, print_table};
use clap::Args;
use smaclite_engine::{Arena, Rules};
use smaclite_scenarios::Scenario;
use std::io::Write;

#[derive(Args)]
pub(super) struct Scenarios {
    /// One JSON object a line
    #[arg(long)]
    json: bool,
}

impl Scenarios {
    pub(super) fn run(self) -> Outcome {
        let mut rows =
            vec![heading(["scenario", "agents", "enemies", "actions", "obs", "state", "episode limit"])];
        for name in Scenario::standard_names() {
            let arena = Arena::new(&Scenario::resolve(name)?, Rules::default());
            let (s, limit) = (arena.sizes(), arena.episode_limit());
            if self.json {
                let row = serde_json::json!({
                    "scenario": name, "n_agents": s.n_agents, "n_enemies": s.n_enemies, "n_actions": s.n_actions,
                    "obs_size": s.obs_size, "state_size": s.state_size, "episode_limit": limit,
                });
                writeln!(std::io::stdout(), "{row}")?;
                continue;
            }
            let numbers = [s.n_agents, s.n_enemies, s.n_actions, s.obs_size, s.state_size];
            let mut row = vec![name.to_owned()];
            row.extend(numbers.map(|n| n.to_string()));
            row.push(limit.map_or("none".to_owned(), |l| l.to_string()));
            rows.push(row);
        }
        if !self.json {
            print_table(&rows)?;
        }
        Ok(())
    }
}
