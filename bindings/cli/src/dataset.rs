//! `smaclite-pool dataset`: record what policies play as a recipe, describe it, expand it to arrays, and
//! export it. `smaclite_learn` does all of it but the export, for which the Python package has the libraries.

use super::bench::this_program::python_interpreter;
use super::{CommandResult, completions};
use crate::check::warn_of;
use crate::files::{check_file_of, check_folder_of};
use crate::number::{Threads, count, seed};
use crate::opponent::scripts;
use crate::os;
use crate::process::interruption;
use crate::table::{Table, percent};
use crate::usage::{file_ending_in, first_given};
use clap::{Args, Subcommand, ValueEnum};
use smaclite_engine::policy::{Scripted, Tactic};
use smaclite_engine::{BattleSetup, Opponents, Rules};
use smaclite_lab::{
    Amount, ArrayName, Card, DATASET_SUFFIX, Dataset, Distribution, PolicyCard, Quality, Recording, Source,
};
use smaclite_learn::{names_team, resolve_scenario};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::Command as Process;
use std::time::Instant;

#[derive(Args)]
#[command(after_help = "\
Examples:
  smaclite-pool train 3m --out runs/3m --evaluate-every 50k
  smaclite-pool dataset record runs/3m --quality good --steps 1M --out 3m-good.smdata
  smaclite-pool dataset record kite --scenario 3m --episodes 1000 --out 3m-kite.smdata
  smaclite-pool dataset show 3m-good.smdata
  smaclite-pool dataset expand 3m-good.smdata --out 3m-good
  smaclite-pool dataset export 3m-good.smdata --to vault --out vaults/smaclite/3m.vlt --uid Good")]
pub(super) struct DatasetCommand {
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand)]
enum Action {
    /// Play a trained team or a scripted policy, and write seeds and actions
    Record(Box<Record>),
    /// Describe a dataset: returns, wins, lengths, coverage, hash
    Show(Show),
    /// Play the episodes again, into files of NumPy, and compare them with the recording
    Expand(Expand),
    /// Write a dataset for another library, through Python
    Export(Export),
}

#[derive(Args)]
#[command(group(clap::ArgGroup::new("amount").required(true).args(["steps", "episodes"])))]
struct Record {
    /// Folder of a run of `smaclite-pool train`, a team of the zoo as zoo:SCENARIO, or a scripted policy:
    /// random, nearest, focus_fire, kite, hold, line, flank, escort or spread
    #[arg(add = completions::player())]
    source: String,
    /// Weights of a run by its evaluations: good, medium, poor, or replay, which is all of them in turn
    /// [default: as `evaluate` chooses: the best ones, or else the last]
    #[arg(long)]
    quality: Option<Quality>,
    /// Number of steps: the last episode that is needed for them is whole
    #[arg(long, value_name = "N", value_parser = count(1..=1_000_000_000))]
    steps: Option<usize>,
    /// Number of episodes
    #[arg(long, value_name = "N", value_parser = count(1..=100_000_000))]
    episodes: Option<usize>,
    /// A standard scenario or a scenario file, for a scripted policy
    #[arg(long, value_name = "MAP", add = completions::scenario())]
    scenario: Option<String>,
    /// Rules of the battles of a scripted policy: smaclite (as the published environment plays), paper (as
    /// its paper describes) or starcraft (nearer to the real battles) [default: smaclite]
    #[arg(long)]
    rules: Option<Rules>,
    /// Who plays the enemies: attack_move, attack_nearest or a scripted policy; or several with weights, such
    /// as attack_move=0.5,focus_fire=0.5, of which each episode draws one [default: the scripts of the
    /// training, or attack_move if a team played them; the scenario's own for a scripted policy]
    #[arg(long, value_name = "NAME|WEIGHTS", value_parser = scripts)]
    opponent: Option<Opponents>,
    /// Episode i is seeded with SEED + i; actions are drawn from the seed too
    #[arg(long, default_value_t = 0, value_parser = seed())]
    seed: u64,
    /// Let a team take the most probable action, instead of drawing one by its probability
    #[arg(long)]
    greedy: bool,
    #[command(flatten)]
    threads: Threads,
    /// The dataset file, NAME.smdata; a file of that name is replaced
    #[arg(long, value_name = "FILE", value_parser = file_ending_in(DATASET_SUFFIX))]
    out: PathBuf,
}

#[derive(Args)]
struct Show {
    /// The dataset file
    file: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
struct Expand {
    /// The dataset file
    file: PathBuf,
    /// A new folder for a file NAME.npy per array
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    /// The arrays to write, separated by commas: obs, state, avail_actions, actions, reward, terminated,
    /// truncated, battle_won, final_obs, final_state, final_avail_actions, episode_start [default: all]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    fields: Vec<String>,
    #[command(flatten)]
    threads: Threads,
}

#[derive(Args)]
struct Export {
    /// The dataset file
    file: PathBuf,
    /// What to write: vault (OG-MARL's format, through flashbax) or minari
    #[arg(long, value_name = "FORMAT")]
    to: Format,
    /// The folder: of the vault, NAME.vlt; of all datasets of Minari
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    /// Of a vault: the name of this dataset in it, such as Good; of Minari: the id of the dataset, such as
    /// smaclite/3m/good-v0
    #[arg(long, value_name = "NAME")]
    uid: String,
    /// Python interpreter with the package smaclite_pool and its extra of that name [default: the one that
    /// runs this program, otherwise python3]
    #[arg(long, value_name = "PATH")]
    python: Option<PathBuf>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Format {
    /// OG-MARL's format, through flashbax
    Vault,
    /// Minari's format
    Minari,
}

impl DatasetCommand {
    pub(super) fn run(self) -> CommandResult {
        match self.action {
            Action::Record(record) => record.run(),
            Action::Show(show) => show.run(),
            Action::Expand(expand) => expand.run(),
            Action::Export(export) => export.run(),
        }
    }
}

impl Record {
    fn run(self) -> CommandResult {
        let amount = match (self.steps, self.episodes) {
            (Some(steps), _) => Amount::Steps(steps),
            (_, episodes) => Amount::Episodes(episodes.unwrap_or(1)),
        };
        let interrupted = interruption()?;
        let recording = Recording {
            source: self.source()?,
            amount,
            seed: self.seed,
            greedy: self.greedy,
            threads: self.threads.number(),
        };
        check_file_of("--out", &self.out)?;
        let dataset = Dataset::record(&recording, &mut || interrupted())?;
        dataset.write(&self.out)?;
        print_card(&dataset, &self.out)
    }

    fn source(&self) -> Result<Source, Box<dyn Error>> {
        let Record { source, quality, scenario, opponent, greedy, .. } = self;
        match Tactic::from_name(source) {
            Ok(tactic) => {
                if let Some(option) = first_given([("--quality", quality.is_some()), ("--greedy", *greedy)]) {
                    return Err(format!("{option} has no effect on a scripted policy; leave it out").into());
                }
                let Some(scenario) = scenario else {
                    return Err(format!("--scenario must name what the policy {source} plays").into());
                };
                let setup = resolve_scenario(scenario, self.rules.unwrap_or_default())?;
                warn_of(&setup);
                let opponents = opponent.clone().unwrap_or_else(|| setup.opponents.clone());
                Ok(Source::Script { setup: BattleSetup { opponents, ..setup }, tactic })
            }
            Err(_) if names_team(source) => {
                let of_scripts = [("--scenario", scenario.is_some()), ("--rules", self.rules.is_some())];
                if let Some(option) = first_given(of_scripts) {
                    let text = "has no effect on a run, which plays what it was trained in; leave it out";
                    return Err(format!("{option} {text}").into());
                }
                let (folder, opponents) = (PathBuf::from(source), opponent.clone());
                Ok(Source::Run { folder, quality: *quality, opponents })
            }
            Err(_) => Err(format!(
                "`{source}` is neither a scripted policy ({}) nor a run of `smaclite-pool train`",
                Scripted::NAMES.join(", ")
            )
            .into()),
        }
    }
}

impl Show {
    fn run(self) -> CommandResult {
        let dataset = Dataset::read(&self.file)?;
        if !self.json {
            return print_card(&dataset, &self.file);
        }
        let mut card = dataset.card_json()?;
        card["file_bytes"] = std::fs::metadata(&self.file)?.len().into();
        out!("{card}")?;
        Ok(())
    }
}

impl Expand {
    fn run(self) -> CommandResult {
        check_folder_of("--out", &self.out)?;
        let dataset = Dataset::read(&self.file)?;
        let arrays = match self.fields.as_slice() {
            [] => ArrayName::ALL.to_vec(),
            names => names.iter().map(|name| ArrayName::from_name(name)).collect::<Result<_, _>>()?,
        };
        let interrupted = interruption()?;
        let threads = self.threads.number();
        let begin = Instant::now();
        dataset.expand_to(&self.out, &arrays, threads, &mut || interrupted())?;
        let seconds = begin.elapsed().as_secs_f64();
        let steps = dataset.n_steps();
        out!(
            "{}: {steps} steps with the recorded bits, {:.0} steps/s",
            self.out.display(),
            steps as f64 / seconds
        )?;
        Ok(())
    }
}

impl Export {
    fn run(self) -> CommandResult {
        let python = self.python.or_else(python_interpreter).unwrap_or_else(|| "python3".into());
        let module = match self.to {
            Format::Vault => "smaclite_pool.integrations.vault",
            Format::Minari => "smaclite_pool.integrations.minari",
        };
        let mut command = Process::new(&python);
        command.args(["-m", module]).arg(self.file).arg(self.out).arg(self.uid);
        let status = os::hand_over(&mut command).map_err(|error| {
            format!("the Python interpreter {} cannot be started: {error}", python.display())
        })?;
        match status.success() {
            true => Ok(()),
            false => Err(format!("{} failed ({status}); it says above why", python.display()).into()),
        }
    }
}

fn print_card(dataset: &Dataset, file: &Path) -> CommandResult {
    let Card { scenario, rules, opponents, episodes, steps, .. } = dataset.card();
    let Card { win_rate, truncated_rate, returns, lengths, unique_pairs, coverage, policies, .. } =
        dataset.card();
    let bytes = std::fs::metadata(file)?.len();
    out!("{}: {scenario}, rules {rules}, opponent {opponents}", file.display())?;
    out!("episodes   {episodes}: {} won, {} truncated", percent(*win_rate), percent(*truncated_rate))?;
    out!("steps      {steps}, {bytes} bytes ({:.2} per step)", bytes as f64 / *steps as f64)?;
    out!("returns    {}", text(returns))?;
    out!("lengths    {}", text(lengths))?;
    out!("coverage   {coverage:.4} ({unique_pairs} different pairs of state and joint action)")?;
    out!("recorded   by {}", dataset.program())?;
    out!("hash       {}", dataset.hash())?;
    let mut table = Table::new(["policy", "trained for", "evaluated", "episodes", "steps", "won", "return"]);
    for (card, policy) in policies.iter().zip(dataset.policies()) {
        let PolicyCard { name, episodes, steps, win_rate, mean_return } = card;
        table.push([
            name.clone(),
            policy.training_steps.map_or("-".to_owned(), |steps| format!("{steps} steps")),
            policy.sampled_win_rate.map_or("-".to_owned(), percent),
            episodes.to_string(),
            steps.to_string(),
            percent(*win_rate),
            format!("{mean_return:.2}"),
        ]);
    }
    table.print()?;
    Ok(())
}

fn text(distribution: &Distribution) -> String {
    let Distribution { mean, deviation, min, quantile_25, median, quantile_75, max } = distribution;
    format!(
        "{mean:.2} (standard deviation {deviation:.2}; quantiles {min:.2} {quantile_25:.2} {median:.2} \
         {quantile_75:.2} {max:.2})"
    )
}
