//! `smaclite-pool play`: the playground, where a person plays against a script or a trained team.

use crate::check::warn_of;
use crate::number::seed;
use crate::opponent::{OpponentOption, warn_of_other_rules};
use crate::web::playground::Playground;
use crate::web::{ServeOptions, serve};
use crate::zoo::team_files;
use crate::{CommandResult, completions};
use clap::Args;
use serde_json::json;
use smaclite_engine::{BattleSetup, Rules};
use smaclite_learn::resolve_scenario;
use smaclite_playground::source_of;
use std::path::Path;

#[derive(Args)]
#[command(after_help = "\
Examples:
  smaclite-pool play 2s3z --open
  smaclite-pool play MMM --against focus_fire --seed 7 --open
  smaclite-pool play 3m --against zoo:3m --open")]
pub(super) struct Play {
    /// A standard scenario or a scenario file; without an episode limit, its battles end after 1000 steps
    #[arg(add = completions::scenario())]
    scenario: String,
    /// Who plays the enemies: attack_move, attack_nearest or a scripted policy; several with weights, such as
    /// attack_move=0.5,focus_fire=0.5, of which each battle draws one; or a team, by the folder of a run
    /// or as zoo:SCENARIO, which sees the map turned by half a turn; the two sides of the scenario must have
    /// equal sizes
    /// [default: the scenario's own]
    #[arg(long, value_name = "PLAYER")]
    against: Option<OpponentOption>,
    /// Seed of the first battle; each later one has the next number
    #[arg(long, default_value_t = 0, value_parser = seed())]
    seed: u64,
    /// Rules of the battles: smaclite (as the published environment plays), paper (as its paper describes) or
    /// starcraft (nearer to the real battles)
    #[arg(long, default_value = "smaclite")]
    rules: Rules,
    #[command(flatten)]
    serve: ServeOptions,
}

impl Play {
    pub(super) fn run(self) -> CommandResult {
        if let Some(of_team) = self.scenario.strip_prefix("zoo:") {
            let team = &self.scenario;
            let text = format!(
                "`{team}` is a team; to play against it: smaclite-pool play {of_team} --against {team}"
            );
            return Err(text.into());
        }
        let setup = resolve_scenario(&self.scenario, self.rules)?;
        warn_of(&setup);
        let mut teams = vec![team_files(Path::new("zoo:all-maps"), "all-maps")?];
        let (opponents, opponent) = match self.against {
            None => (setup.opponents.clone(), String::new()),
            Some(OpponentOption::Scripts(opponents)) => match opponents.weights() {
                [(script, _)] => (setup.opponents.clone(), script.name().to_owned()),
                _ => (opponents, String::new()),
            },
            Some(OpponentOption::Team(folder)) => {
                warn_of_other_rules(&folder, setup.rules)?;
                let name = folder.display().to_string();
                teams.push(team_files(&folder, &name)?);
                (setup.opponents.clone(), name)
            }
            Some(OpponentOption::OwnTeam | OpponentOption::League) => {
                return Err("--against takes scripts or a team; self and league are for training".into());
            }
        };
        let (scenario, arena) = setup.arena()?;
        let of_map = BattleSetup { rules: Rules::default(), opponents, ..setup.clone() };
        let first = json!({
            "scenario": source_of(&of_map, &scenario),
            "seed": self.seed.to_string(),
            "opponent": opponent,
            "rules": if setup.rules == of_map.rules { String::new() } else { setup.rules.to_string() },
            "taken": (0..arena.sizes().n_agents).collect::<Vec<_>>(),
        });
        serve(&self.serve, Playground::of_battle(teams, first)?)
    }
}
