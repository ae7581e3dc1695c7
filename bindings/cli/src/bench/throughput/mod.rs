//! Steps per second of the engine alone or of a whole pool.
//!
//! Unless the policy is `sampled`, actions are recorded before the measurement and replayed during it, so
//! that the results are those of the environments and the transport alone.

mod engine;
mod pool;

use crate::bench::policy::Policy;
use clap::ValueEnum;
use serde::Serialize;
use smaclite_engine::{Arena, BattleSetup, Rules};
use smaclite_ipc::{ClientError, ConnectError, RuntimeDirError, StartError};
use smaclite_lab::{ActionTrace, AfterEpisode};
use smaclite_pool::PoolOptions;
use smaclite_scenarios::{Problems, Scenario, ScenarioError, ScenarioFiles};
use std::process::{Command, ExitStatus};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Steps that are recorded of each environment.
const RECORDED_STEPS: usize = 128;

/// Environment `i` is seeded with this + `i`.
const SEED: u64 = 1;

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")] // as the option
pub enum Mode {
    /// The engine alone: one thread plays the battles of all environments one by one
    Engine,
    /// The same with one step of each battle in turn, as a pool steps its environments
    InTurn,
    /// A pool in this process
    Embedded,
    /// A pool in another process, with the learner in this one
    Attached,
}

impl Mode {
    /// The name that is typed on the command line.
    pub fn name(self) -> String {
        self.to_possible_value().map_or(String::new(), |value| value.get_name().to_owned())
    }
}

/// What to measure.
#[derive(Clone)]
pub struct Workload {
    /// The scenario.
    pub scenario: Scenario,
    /// The texts that it was read from.
    pub files: ScenarioFiles,
    /// The scenario as the user named it: a standard name or a file. A second process gets it.
    pub scenario_argument: String,
    /// The rules of the battles.
    pub rules: Rules,
    /// How actions are chosen.
    pub policy: Policy,
    /// What steps the battles.
    pub mode: Mode,
    /// Environments, at least 1.
    pub num_envs: usize,
    /// Environments per batch, 1 to `num_envs`; fewer than `num_envs` means asynchronous stepping.
    pub batch_size: usize,
    /// Worker threads of a pool, and how they wait.
    pub options: PoolOptions,
    /// How long to measure; always at least one pass over the recordings or one batch.
    pub time: Duration,
}

impl Workload {
    /// 64 environments of a scenario, embedded and synchronous, with sampled actions, for 3 s.
    ///
    /// # Errors
    /// If there is no such scenario or its file is invalid.
    pub fn new(scenario: &str) -> Result<Workload, ScenarioError> {
        let (resolved, files) = ScenarioFiles::resolve(scenario)?;
        Ok(Workload {
            scenario: resolved,
            files,
            scenario_argument: scenario.to_owned(),
            rules: Rules::default(),
            policy: Policy::Sampled,
            mode: Mode::Embedded,
            num_envs: 64,
            batch_size: 64,
            options: PoolOptions::default(),
            time: Duration::from_secs(3),
        })
    }

    /// Measures it. In the mode `attached`, `second_process` makes the command that serves the workload's
    /// pool under the given name until SIGTERM.
    ///
    /// # Errors
    /// If the pool cannot start or fails, or the measurement was interrupted.
    pub fn measure(
        &self,
        second_process: &dyn Fn(&Workload, &str) -> std::io::Result<Command>,
        interrupted: &AtomicBool,
    ) -> Result<Throughput, MeasureError> {
        let interrupt = Interrupt(interrupted);
        let (counts, threads) = match self.mode {
            Mode::Engine | Mode::InTurn => (engine::measure(self, interrupt)?, 1),
            Mode::Embedded | Mode::Attached => {
                (pool::measure(self, second_process, interrupt)?, self.options.threads)
            }
        };
        let seconds = counts.time.as_secs_f64();
        Ok(Throughput {
            scenario: self.scenario.name.clone(),
            policy: self.policy,
            mode: self.mode,
            threads,
            num_envs: self.num_envs,
            batch_size: self.batch_size,
            steps_per_s: counts.steps as f64 / seconds,
            ns_per_unit_tick: seconds * 1e9 / counts.unit_ticks as f64,
            rss_bytes: counts.rss_bytes,
        })
    }

    /// What is played.
    fn setup(&self) -> BattleSetup {
        BattleSetup { rules: self.rules, ..BattleSetup::new(self.files.clone()) }
    }

    /// Where it is played, against the scenario's own opponent.
    fn arena(&self) -> Result<Arc<Arena>, MeasureError> {
        Ok(Arc::new(self.setup().arena()?.1))
    }

    /// What a pool's environments play, by environment.
    fn record(&self, arena: &Arc<Arena>) -> Vec<ActionTrace> {
        let record = |seed| self.policy.record(arena, seed, RECORDED_STEPS, AfterEpisode::Reset);
        (SEED..).take(self.num_envs).map(record).collect()
    }
}

/// The result of a measurement.
#[derive(Clone, Debug, Serialize)]
pub struct Throughput {
    /// Name of the scenario.
    pub scenario: String,
    /// How actions were chosen.
    pub policy: Policy,
    /// What stepped the battles.
    pub mode: Mode,
    /// Threads that stepped them.
    pub threads: usize,
    /// Environments.
    pub num_envs: usize,
    /// Environments per batch.
    pub batch_size: usize,
    /// Steps of single environments per second.
    pub steps_per_s: f64,
    /// Nanoseconds per living unit and tick, on all threads together.
    pub ns_per_unit_tick: f64,
    /// Resident memory of the process that steps, in bytes.
    pub rss_bytes: usize,
}

/// Why there is no result.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum MeasureError {
    #[error("interrupted")]
    Interrupted,
    #[error(
        "with the policy `{}`, the batch size must be {num_envs} (the number of environments), got \
         {batch_size}; only `sampled` can step asynchronously",
        policy.name()
    )]
    NotSynchronous { policy: Policy, num_envs: usize, batch_size: usize },
    #[error(transparent)]
    Scenario(#[from] Problems),
    #[error(transparent)]
    RuntimeDir(#[from] RuntimeDirError),
    #[error(transparent)]
    Start(#[from] StartError),
    #[error("the second process cannot be started: {0}")]
    SecondProcess(#[source] std::io::Error),
    #[error("the second process ended before its pool was ready ({status}), and said {said:?} last")]
    SecondProcessEnded {
        status: ExitStatus,
        /// The last line that it said on standard error.
        said: String,
    },
    #[error(transparent)]
    Connect(#[from] ConnectError),
    #[error(transparent)]
    Client(#[from] ClientError),
}

/// Set when the program should end.
#[derive(Clone, Copy)]
struct Interrupt<'a>(&'a AtomicBool);

impl Interrupt<'_> {
    fn check(self) -> Result<(), MeasureError> {
        if self.0.load(Ordering::Relaxed) { Err(MeasureError::Interrupted) } else { Ok(()) }
    }
}

/// What was counted in a measurement.
struct Counts {
    /// Steps of single environments.
    steps: u64,
    /// Units alive at the start of each step, times the ticks of a step, summed.
    unit_ticks: u64,
    time: Duration,
    rss_bytes: usize,
}

impl Counts {
    fn of_traces(traces: &[ActionTrace], passes: u64, time: Duration, rss_bytes: usize) -> Counts {
        Counts {
            steps: passes * traces.iter().map(ActionTrace::played).sum::<u64>(),
            unit_ticks: passes * traces.iter().map(ActionTrace::unit_ticks).sum::<u64>(),
            time,
            rss_bytes,
        }
    }
}

/// The median of several measurements; of an even number of them the upper of the two in the middle.
///
/// # Panics
/// If there are none.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
