//! `smaclite-pool evaluate`: play a trained team, count wins and returns, and record battles.

use super::{CommandResult, THREADS, completions, other_rules, replay, runtime_dir};
use crate::check::warn_of;
use crate::files::check_file_of;
use crate::number::{count, seed};
use crate::opponent::{OpponentOption, warn_of_other_rules};
use crate::output::print_json;
use crate::process::interruption;
use crate::table::percent;
use crate::usage::file_ending_in;
use clap::Args;
use smaclite_engine::IllegalAction;
use smaclite_learn::{
    Evaluation, EvaluationEvent, EvaluationResult, RunDescription, Weights, evaluate, resolve_scenario,
};
use smaclite_pool::PoolOptions;
use smaclite_view::{Recorder, SUFFIX};
use std::path::PathBuf;

#[derive(Args)]
pub(super) struct Evaluate {
    /// Folder of a run of `smaclite-pool train`, or a team of the zoo as zoo:SCENARIO
    folder: PathBuf,
    /// Play this map instead of that of the training, for a team of --network universal or --maps: a standard
    /// scenario or a scenario file
    #[arg(long, value_name = "MAP", add = completions::scenario())]
    map: Option<String>,
    /// Number of episodes, 1 to 1000000: of each of up to 64 environments the first ones
    #[arg(long, default_value_t = 200, value_name = "N", value_parser = count(1..=1_000_000))]
    episodes: usize,
    /// Environment i is seeded with SEED + i; actions are drawn from the seed too
    #[arg(long, default_value_t = 0, value_parser = seed())]
    seed: u64,
    /// Who plays the enemies: attack_move, attack_nearest or a scripted policy; or several with weights,
    /// such as attack_move=0.5,focus_fire=0.5, of which each episode draws one; or the folder of another
    /// run or zoo:SCENARIO, whose team plays them and draws its actions [default: the scripts of the
    /// training on this map; on an unseen one those that the training was given, else the map's own;
    /// attack_move if a team played the enemies]
    #[arg(long, value_name = "NAME|WEIGHTS|FOLDER")]
    opponent: Option<OpponentOption>,
    /// Which weights play: best (of the best evaluation, if the run was evaluated) or last [default: best, if
    /// there are some; in self-play last]
    #[arg(long, value_name = "best|last")]
    weights: Option<Weights>,
    /// Take the most probable action, instead of drawing one by its probability
    #[arg(long)]
    greedy: bool,
    /// Number of threads that step environments, 1 to 1024 [default: the CPU cores available to this process]
    #[arg(long, value_name = "N", value_parser = count(THREADS))]
    threads: Option<usize>,
    /// Print one JSON object per episode, and one with the result
    #[arg(long)]
    json: bool,
    /// Write a replay of the episodes of environment 0, FILE.smreplay; a file of that name is replaced
    #[arg(long, value_name = "FILE", value_parser = file_ending_in(SUFFIX))]
    record: Option<PathBuf>,
}

/// The environment that is recorded. Its seed is that of the evaluation.
const RECORDED_ENV: usize = 0;

impl Evaluate {
    pub(super) fn run(self) -> CommandResult {
        let Evaluate { episodes, seed, greedy, json, .. } = self;
        let threads = self.threads.unwrap_or(PoolOptions::default().threads);
        let (opponents, opponent_team) = match self.opponent {
            None => (None, None),
            Some(OpponentOption::Scripts(scripts)) => (Some(scripts), None),
            Some(OpponentOption::Team(folder)) => (None, Some(folder)),
            Some(OpponentOption::OwnTeam | OpponentOption::League) => {
                return Err(
                    "`self` and `league` are opponents of training; to let a team play itself, name its \
                            folder twice"
                        .into(),
                );
            }
        };
        let weights = self.weights;
        let rules = RunDescription::read(&self.folder)?.setup.rules;
        if let Some(folder) = &opponent_team {
            warn_of_other_rules(folder, rules)?;
        }
        let map = match &self.map {
            None => None,
            Some(name) => {
                let map = resolve_scenario(name, rules)?;
                warn_of(&map);
                Some(map)
            }
        };
        let evaluation =
            Evaluation { episodes, seed, weights, greedy, threads, opponents, opponent_team, map };
        let mut recorder = None;
        if let Some(file) = &self.record {
            check_file_of("--record", file)?;
            recorder = Some(Recorder::new(evaluation.setup(&evaluation.run(&self.folder)?), seed)?);
        }
        let interrupted = interruption()?;
        let (mut printed, mut recorded) = (Ok(()), Ok(()));
        let mut on_event = |event: EvaluationEvent| match event {
            EvaluationEvent::Ended(episode) if json && printed.is_ok() => printed = print_json(&episode),
            EvaluationEvent::Step { env_id: RECORDED_ENV, actions } if recorded.is_ok() => {
                recorded = recorder.as_mut().map_or(Ok(()), |recorder| record_step(recorder, actions));
            }
            _ => {}
        };
        let result =
            evaluate(&self.folder, evaluation, &runtime_dir()?, &mut || interrupted(), &mut on_event)?;
        recorded?;
        let printed = printed.and_then(|()| if json { print_json(&result) } else { print_text(&result) });
        // The file does not depend on who reads the output.
        if let Some((recorder, file)) = recorder.zip(self.record) {
            let replay = recorder.finish();
            replay.write(&file)?;
            if !json && printed.is_ok() {
                replay::print_recorded(&replay, &file)?;
            }
        }
        printed
    }
}

/// Plays a step of the recorded environment again, while it is evaluated.
fn record_step(recorder: &mut Recorder, actions: &[i32]) -> Result<(), IllegalAction> {
    if recorder.battle().is_over() {
        recorder.reset();
    }
    recorder.step(actions).map(|_| ())
}

fn print_text(result: &EvaluationResult) -> CommandResult {
    out!(
        "{}{}: {} episodes in {} environments, {} actions, seed {}",
        result.scenario,
        other_rules(result.rules),
        result.episodes,
        result.num_envs,
        if result.greedy { "greedy" } else { "sampled" },
        result.seed
    )?;
    match &result.opponent_team {
        Some(folder) => out!("opponent     the team of {}", folder.display())?,
        None => out!("opponent     {}", result.opponents)?,
    }
    if result.weights == Weights::Best {
        out!("weights      the best")?;
    }
    out!("win rate     {}", percent(result.win_rate))?;
    out!("mean return  {:.2} (standard deviation {:.2})", result.mean_return, result.return_deviation)?;
    out!("mean length  {:.1} steps", result.mean_length)?;
    Ok(())
}
