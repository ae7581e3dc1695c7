//! `smaclite-pool zoo`: the trained teams that are part of the program.

use super::CommandResult;
use super::files::refuse_file;
use super::output::print_json;
use super::table::{Table, percent};
use clap::Args;
use smaclite_learn::{export_zoo_team, read_team_files, zoo_cards};
use smaclite_playground::TeamFiles;
use std::path::Path;

#[derive(Args)]
#[command(after_help = "\
Wherever the folder of a run stands for its team, zoo:SCENARIO is the team of that scenario, and
zoo:all-maps one that plays every map. It has no evaluations and no checkpoint, so report,
verify-run and train --resume do not take it:
  smaclite-pool evaluate zoo:2s3z
  smaclite-pool evaluate zoo:all-maps --map MMM
  smaclite-pool tournament zoo:3m attack_move kite
  smaclite-pool play 8m --against zoo:8m --open
With --export, its files are written to a folder, which the playground opens, too:
  smaclite-pool zoo --export 3m teams/3m

Teams of one map were trained with --network flat and former defaults for two million steps,
all-maps by train --maps; wins are those of the final evaluation, of all-maps the mean over the maps
of SMAC (--json has each).")]
pub(super) struct Zoo {
    /// Print one JSON object per team
    #[arg(long)]
    json: bool,
    /// Write the files of a team to a folder, which must not hold a run: run.json, best.safetensors and
    /// card.json
    #[arg(long, num_args = 2, value_names = ["SCENARIO", "FOLDER"], conflicts_with = "json")]
    export: Option<Vec<String>>,
}

impl Zoo {
    pub(super) fn run(self) -> CommandResult {
        if let Some([scenario, folder]) = self.export.as_deref() {
            refuse_file("--export", Path::new(folder))?;
            export_zoo_team(scenario, Path::new(folder))?;
            out!("{folder}: the team of {scenario}; smaclite-pool evaluate {folder}")?;
            return Ok(());
        }
        let mut table =
            Table::new(["team", "seed", "steps", "CPU-seconds", "won, greedy", "won, sampled", "episodes"]);
        for card in zoo_cards()? {
            if self.json {
                print_json(&card)?;
                continue;
            }
            table.push([
                format!("zoo:{}", card.scenario),
                card.seed.to_string(),
                card.steps.to_string(),
                format!("{:.0}", card.cpu_seconds),
                percent(card.greedy.win_rate),
                percent(card.sampled.win_rate),
                card.episodes.to_string(),
            ]);
        }
        if !self.json {
            table.print()?;
        }
        Ok(())
    }
}

/// The files of a team, for a page that calls it by this name.
pub(crate) fn team_files(folder: &Path, name: &str) -> Result<TeamFiles, Box<dyn std::error::Error>> {
    let (run, weights) = read_team_files(folder)?;
    Ok(TeamFiles::new(name.to_owned(), String::from_utf8(run)?, &weights)?)
}
