//! `smaclite-pool evaluate`: play a trained team, and count wins and returns.

use super::{CommandResult, THREADS, check_range, runtime_dir};
use clap::Args;
use smaclite_benches::process::interrupt_flag;
use smaclite_learn::{EvaluatedEpisode, Evaluation, evaluate};
use smaclite_pool::PoolOptions;
use std::path::PathBuf;
use std::sync::atomic::Ordering;

#[derive(Args)]
pub(super) struct Evaluate {
    /// Folder of a run of `smaclite-pool train`
    folder: PathBuf,
    /// Number of episodes, 1 to 1000000: of each of up to 64 environments the first ones
    #[arg(long, default_value_t = 200, value_name = "N")]
    episodes: usize,
    /// Environment i is seeded with SEED + i; actions are drawn from the seed too
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Take the most probable action, instead of drawing one by its probability
    #[arg(long)]
    greedy: bool,
    /// Number of threads that step environments, 1 to 1024 [default: the CPU cores available to this process]
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Print one JSON object per episode, and one with the result
    #[arg(long)]
    json: bool,
}

impl Evaluate {
    pub(super) fn run(self) -> CommandResult {
        let Evaluate { episodes, seed, greedy, json, .. } = self;
        let threads = self.threads.unwrap_or(PoolOptions::default().threads);
        check_range("--episodes", 1..=1_000_000, episodes)?;
        check_range("--threads", THREADS, threads)?;
        let interrupted = interrupt_flag()?;
        let evaluation = Evaluation { episodes, seed, greedy, threads };
        let mut printed = Ok(());
        let mut on_episode = |episode: &EvaluatedEpisode| {
            if json && printed.is_ok() {
                printed = print_json(episode);
            }
        };
        let mut stop = || interrupted.load(Ordering::Relaxed);
        let result = evaluate(&self.folder, evaluation, &runtime_dir()?, &mut stop, &mut on_episode)?;
        printed?;
        if json {
            return print_json(&result);
        }
        out!(
            "{}: {} episodes in {} environments, {} actions, seed {}",
            result.scenario,
            result.episodes,
            result.num_envs,
            if greedy { "greedy" } else { "sampled" },
            result.seed
        )?;
        out!("win rate     {:.1} %", 100.0 * result.win_rate)?;
        out!("mean return  {:.2} (standard deviation {:.2})", result.mean_return, result.return_deviation)?;
        out!("mean length  {:.1} steps", result.mean_length)?;
        Ok(())
    }
}

fn print_json(value: &impl serde::Serialize) -> CommandResult {
    out!("{}", serde_json::to_string(value)?)?;
    Ok(())
}
