//! `smaclite-pool scenarios`: the standard scenarios and their sizes.

use super::CommandResult;
use super::table::Table;
use clap::Args;
use smaclite_engine::{Arena, Rules};
use smaclite_scenarios::Scenario;

#[derive(Args)]
pub(super) struct Scenarios {
    /// Print one JSON object per scenario
    #[arg(long)]
    json: bool,
}

impl Scenarios {
    pub(super) fn run(self) -> CommandResult {
        let mut table =
            Table::new("scenario|agents|enemies|actions|obs size|state size|episode limit|units".split('|'));
        for name in Scenario::standard_names().chain(Scenario::generated_names()) {
            let scenario = Scenario::resolve(name)?;
            let is_generated = scenario.generation.is_some();
            let arena = Arena::new(&scenario, Rules::default());
            let (s, limit) = (arena.sizes(), arena.episode_limit());
            if self.json {
                let scenario = serde_json::json!({
                    "scenario": name, "n_agents": s.n_agents, "n_enemies": s.n_enemies,
                    "n_actions": s.n_actions, "obs_size": s.obs_size, "state_size": s.state_size,
                    "episode_limit": limit, "generated": is_generated,
                });
                out!("{scenario}")?;
                continue;
            }
            let units = if is_generated { "drawn for each episode" } else { "fixed" };
            let sizes = [s.n_agents, s.n_enemies, s.n_actions, s.obs_size, s.state_size];
            let limit = limit.map_or("none".to_owned(), |steps| format!("{steps} steps"));
            table.push(
                [name.to_owned()]
                    .into_iter()
                    .chain(sizes.map(|size| size.to_string()))
                    .chain([limit, units.to_owned()]),
            );
        }
        if !self.json {
            table.print()?;
        }
        Ok(())
    }
}
