//! `smaclite-pool serve`: run a pool until SIGINT or SIGTERM.

use super::{Outcome, megabytes, runtime_dir};
use crate::supervisor::{LaneConfig, LaneEnvs, StartError, Supervisor, SupervisorConfig};
use crate::{RuntimeDir, WaitStrategy, check_name};
use clap::Args;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use smaclite_engine::Rules;
use smaclite_pool::fields::FieldSet;
use smaclite_pool::{Autoreset, PoolOptions};
use smaclite_scenarios::Scenario;
use std::error::Error;

#[derive(Args)]
#[command(after_help = "Examples:\n  smaclite-pool serve 2s3z:64 --name train\n  \
    smaclite-pool serve 2s3z:64 MMM2:32 ./mine.json:16 --name zoo --threads 8\n  \
    smaclite-pool serve easy=3s5z:64 hard=3s5z_vs_3s6z:64\n\n\
    Then, in a learner:  smaclite_pool.connect(\"train\")")]
pub(super) struct Serve {
    /// A lane: a standard scenario or a file, the number of environments, and a name if it is not the
    /// scenario's
    #[arg(required = true, value_name = "[LANE=]SCENARIO[:N]")]
    lanes: Vec<String>,
    /// The name learners connect by
    #[arg(long, default_value = "default")]
    name: String,
    /// Worker threads [default: the cores this process may use, less one for the learner]
    #[arg(long)]
    threads: Option<usize>,
    /// Environments in a batch; fewer than N means asynchronous stepping [default: N]
    #[arg(long, value_name = "M")]
    batch_size: Option<usize>,
    /// Environment i of every lane is seeded with this + i
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// At an episode's end: next_step, same_step or disabled
    #[arg(long, default_value = "next_step", value_name = "MODE")]
    autoreset: Autoreset,
    /// The rules: smaclite (as the published environment plays) or paper (as its paper says)
    #[arg(long, default_value = "smaclite")]
    rules: Rules,
    /// Steps before an episode is cut off, or `none` [default: the scenario's]
    #[arg(long, value_name = "STEPS", value_parser = episode_limit)]
    episode_limit: Option<Limit>,
    /// Fields of a batch, by comma [default: all]
    #[arg(long, value_delimiter = ',', value_name = "NAME,...")]
    fields: Option<Vec<String>>,
    /// Batches a learner may hold at once
    #[arg(long, default_value_t = 4, value_name = "K")]
    max_held_batches: usize,
    /// Spectators at once, a lane
    #[arg(long, default_value_t = 1, value_name = "K")]
    spectators: usize,
    /// How idle workers wait: adaptive, spin or block
    #[arg(long, default_value = "adaptive", value_name = "HOW")]
    wait: WaitStrategy,
}

/// `Limit(None)` is no limit.
#[derive(Clone, Copy)]
struct Limit(Option<u32>);

fn episode_limit(word: &str) -> Result<Limit, String> {
    match word {
        "none" => Ok(Limit(None)),
        _ => match word.parse::<u32>() {
            Ok(steps) if steps > 0 => Ok(Limit(Some(steps))),
            _ => Err("a number of steps from 1, or `none`".to_owned()),
        },
    }
}

/// Environments of a lane that does not say how many.
const DEFAULT_ENVS: usize = 64;

impl Serve {
    pub(super) fn run(self) -> Outcome {
        let prepared = self.config(runtime_dir()?)?.prepare()?;
        // Until here a signal ends the program at once. From here on there is something to clean up.
        let mut signals = Signals::new([SIGINT, SIGTERM])?;
        let started = Supervisor::start_prepared(prepared, &mut || signals.pending().next().is_some());
        if let Err(StartError::Interrupted) = started {
            return Ok(());
        }
        let supervisor = started?;
        print_start(&supervisor);
        signals.forever().next();
        let _ = out!("stopping");
        Ok(())
    }

    fn config(&self, runtime_dir: RuntimeDir) -> Result<SupervisorConfig, Box<dyn Error>> {
        let lanes = self.lanes.iter().map(|lane| self.lane(lane)).collect::<Result<Vec<_>, _>>()?;
        let threads = self.threads.unwrap_or(PoolOptions::default().threads);
        if !(1..=1024).contains(&threads) {
            return Err(format!("--threads must be between 1 and 1024, got {threads}").into());
        }
        let options = PoolOptions { threads, wait: self.wait };
        Ok(SupervisorConfig { name: self.name.clone(), lanes, options, runtime_dir })
    }

    fn lane(&self, text: &str) -> Result<LaneConfig, Box<dyn Error>> {
        let (name, rest) = match text.split_once('=') {
            Some((name, rest)) => (Some(name.to_owned()), rest),
            None => (None, text),
        };
        let (scenario, num_envs) = match rest.rsplit_once(':') {
            Some((scenario, count)) => {
                let count = count.parse::<usize>().map_err(|_| {
                    format!("lane `{text}`: `{count}` is not a number of environments; say SCENARIO:N, as in 2s3z:64")
                })?;
                (scenario, count)
            }
            None => (rest, DEFAULT_ENVS),
        };
        let scenario = Scenario::resolve(scenario)?;
        let name = name.unwrap_or_else(|| scenario.name.clone());
        check_name(&name).map_err(|why| format!("lane `{text}`: {why}; name it: NAME={rest}"))?;
        let mut lane = LaneConfig::new(name, scenario, num_envs);
        if let (LaneEnvs::Battle { rules, episode_limit, .. }, limit) = (&mut lane.envs, self.episode_limit) {
            *rules = self.rules;
            *episode_limit = limit.map(|limit| limit.0);
        }
        lane.settings.batch_size = self.batch_size.unwrap_or(num_envs);
        lane.settings.seed = self.seed;
        lane.settings.autoreset = self.autoreset;
        if let Some(names) = &self.fields {
            lane.settings.fields = FieldSet::from_names(names)?;
        }
        lane.max_held_batches = self.max_held_batches;
        lane.spectators = self.spectators;
        Ok(lane)
    }
}

fn print_start(supervisor: &Supervisor) {
    let threads = supervisor.threads();
    let plural = if threads == 1 { "" } else { "s" };
    // A pool goes on whether or not somebody reads this.
    let _ = out!(
        "pool `{}` (process {}): {threads} worker thread{plural}, {} of shared memory",
        supervisor.name(),
        std::process::id(),
        megabytes(supervisor.shared_memory())
    );
    for lane in supervisor.lanes() {
        let mode = if lane.settings.is_synchronous() {
            "synchronous".to_owned()
        } else {
            format!("asynchronous in batches of {}", lane.settings.batch_size)
        };
        let _ = out!("  lane `{}`: {} x {}, {mode}", lane.lane, lane.settings.num_envs, lane.scenario);
    }
    let _ = out!("attach with smaclite_pool.connect({:?}); Ctrl-C stops it", supervisor.name());
}
