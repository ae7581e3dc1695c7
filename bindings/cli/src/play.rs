//! `smaclite-pool play`: a page in the browser on which a person plays against a script or a trained team.

use crate::check::warn_of;
use crate::number::seed;
use crate::opponent::OpponentOption;
use crate::web::play::Play as Page;
use crate::web::{ServeOptions, serve};
use crate::{CommandResult, completions};
use clap::Args;
use smaclite_engine::{BattleSetup, Rules};
use smaclite_learn::{TrainedTeam, resolve_scenario};

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
    /// or as zoo:SCENARIO, which sees the map turned by half a turn and needs a scenario with two equal sides
    #[arg(long, default_value = "attack_move", value_name = "PLAYER")]
    against: OpponentOption,
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
        warn_of(&setup.files);
        let page = match self.against {
            OpponentOption::Scripts(opponents) => Page::new(BattleSetup { opponents, ..setup }, self.seed)?,
            OpponentOption::Team(folder) => {
                let team = TrainedTeam::open_for(&folder, &setup)?;
                Page::against_team(setup, team, folder.display().to_string(), self.seed)?
            }
            OpponentOption::OwnTeam | OpponentOption::League => {
                return Err("--against takes scripts or a team; self and league are for training".into());
            }
        };
        serve(&self.serve, vec![("/", Box::new(page))])
    }
}
