//! `smaclite-pool tournament`: play scripts and trained teams against each other. The battles are played by
//! `smaclite_learn`; here are the options, `report` has the texts and `chart` the picture.

mod chart;
mod report;

use super::files::{check_out, make_out, write_files};
use super::{CommandResult, completions};
use crate::check::warn_of;
use crate::number::{Threads, count, seed};
use crate::output::print_json;
use crate::process::interruption;
use clap::Args;
use smaclite_engine::{BattleSetup, Opponent, Rules};
use smaclite_lab::{Tournament, TournamentResult};
use smaclite_learn::resolve_scenario;
use std::error::Error;
use std::path::{Path, PathBuf};

#[derive(Args)]
#[command(after_help = "\
Examples:
  smaclite-pool tournament attack_move nearest focus_fire kite --scenario 3m --seed 1
  smaclite-pool tournament runs/3m-1 runs/3m-2 focus_fire --episodes 1000 --out tournament

A pairing is a player with the agents against one with the enemies; all are played, also those of a player \
against itself. A trained team plays the enemies in the mirror, so the two sides of its scenario must have \
equal sizes.
Elo ratings are those of the Bradley-Terry model by maximum likelihood, a draw as half a win, with 95 % \
intervals from how much the scores of each pair vary (docs/how-to/evaluation.md).")]
pub(super) struct PlayTournament {
    /// Scripts (attack_move, attack_nearest or a scripted policy), folders of runs of `smaclite-pool train`,
    /// and teams of the zoo as zoo:SCENARIO
    #[arg(required = true, value_name = "PLAYER", add = completions::player())]
    players: Vec<String>,
    /// A standard scenario or a scenario file [default: that of the trained teams]
    #[arg(long, value_name = "MAP", add = completions::scenario())]
    scenario: Option<String>,
    /// Rules of the battles: smaclite (as the published environment plays), paper (as its paper describes) or
    /// starcraft (nearer to the real battles) [default: smaclite; without --scenario those of the teams]
    #[arg(long, requires = "scenario")]
    rules: Option<Rules>,
    /// Number of episodes of each pairing, 1 to 1000000
    #[arg(long, default_value_t = 200, value_name = "N", value_parser = count(1..=1_000_000))]
    episodes: usize,
    /// Episode i of each pairing is seeded with SEED + i; actions are drawn from the seed too
    #[arg(long, default_value_t = 0, value_parser = seed())]
    seed: u64,
    /// Let teams take the most probable action, instead of drawing one by its probability
    #[arg(long)]
    greedy: bool,
    #[command(flatten)]
    threads: Threads,
    /// Print the result as one JSON object
    #[arg(long)]
    json: bool,
    /// Write matrix.csv, matrix.svg, tournament.json and tournament.md to this folder; files of these names
    /// are replaced
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
}

impl PlayTournament {
    pub(super) fn run(self) -> CommandResult {
        let is_script = |player: &String| Opponent::scripts().any(|script| script.name() == player);
        if self.greedy && self.players.iter().all(is_script) {
            return Err("--greedy has no effect on scripts; leave it out, or name a trained team".into());
        }
        if let Some(out) = &self.out {
            check_out(out)?;
            make_out(out)?;
        }
        let interrupted = interruption()?;
        let tournament = Tournament {
            setup: self.setup()?,
            players: self.players.iter().map(|name| without_slash(name)).collect(),
            episodes: self.episodes,
            seed: self.seed,
            greedy: self.greedy,
            threads: self.threads.number(),
        };
        let result = tournament.play(&mut || interrupted())?;
        // First: the files do not depend on who reads the output.
        if let Some(out) = &self.out {
            write(out, &result)?;
        }
        if self.json {
            return print_json(&result);
        }
        report::print(&result)
    }

    fn setup(&self) -> Result<Option<BattleSetup>, Box<dyn Error>> {
        let Some(name) = &self.scenario else { return Ok(None) };
        let setup = resolve_scenario(name, self.rules.unwrap_or_default())?;
        warn_of(&setup);
        Ok(Some(setup))
    }
}

/// A folder as a person names it: shells complete `runs/3m/`.
fn without_slash(name: &str) -> String {
    let trimmed = name.trim_end_matches('/');
    if trimmed.is_empty() { name.to_owned() } else { trimmed.to_owned() }
}

fn write(folder: &Path, result: &TournamentResult) -> CommandResult {
    let json = serde_json::to_string_pretty(result)? + "\n";
    let files = [
        ("matrix.csv", report::csv(result)),
        ("matrix.svg", chart::heat_map(result)),
        ("tournament.json", json),
        ("tournament.md", report::markdown(result)),
    ];
    write_files(folder, &files)
}
