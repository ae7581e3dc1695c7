//! `smaclite-pool bench`: steps per second, of one bare battle or of a whole pool.
//!
//! Actions are recorded before anything is timed and replayed then, so that the figures are the environment's
//! and the transport's alone: same seeds and actions give the same battles. Only the sampled policy has the
//! client draw them.

mod engine;
mod pool;
mod replay;
mod table;

use super::{Outcome, heading, print_table};
use clap::{Args, ValueEnum};
use replay::Policy;
use serde::Serialize;
use signal_hook::consts::{SIGINT, SIGTERM};
use smaclite_pool::{PoolOptions, WaitStrategy};
use smaclite_scenarios::Scenario;
use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

#[derive(Args)]
#[command(
    after_help = "Modes: `engine` plays the battles of --envs environments one by one on one thread and writes all observations; `embedded` runs a pool in this \
    process; `attached` runs it in another and measures from here."
)]
pub(super) struct Bench {
    /// Scenarios: standard names or files [default: the standard ones]
    #[arg(value_name = "SCENARIO")]
    scenarios: Vec<String>,
    /// What the agents do
    #[arg(long, value_enum, default_value = "sampled")]
    policy: Policy,
    /// What is measured
    #[arg(long, value_enum, default_value = "embedded")]
    mode: Mode,
    /// Worker threads of a pool [default: the cores this process may use, less one]
    #[arg(long)]
    threads: Option<usize>,
    /// Environments
    #[arg(long, default_value_t = 64)]
    envs: usize,
    /// Environments in a batch; fewer than --envs steps asynchronously, with sampled actions [default:
    /// --envs]
    #[arg(long, value_name = "M")]
    batch_size: Option<usize>,
    /// How long to measure each scenario
    #[arg(long, default_value_t = 3.0)]
    seconds: f64,
    /// How idle threads wait: adaptive, spin or block
    #[arg(long, default_value = "adaptive", value_name = "HOW")]
    wait: WaitStrategy,
    /// One JSON object a line
    #[arg(long)]
    json: bool,
    /// Print the speed table of the SMAClite paper with a column for this machine instead
    #[arg(long, conflicts_with_all = ["scenarios", "mode", "policy", "envs", "threads"])]
    table: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Mode {
    Engine,
    Embedded,
    Attached,
}

/// What one measurement is about.
struct Task<'a> {
    scenario: &'a Scenario,
    /// As the user wrote it, for a process that has to find it again.
    word: &'a str,
    policy: Policy,
    mode: Mode,
    envs: usize,
    batch_size: usize,
    options: PoolOptions,
    time: Duration,
    /// Set by SIGINT and SIGTERM: a pool must not be left behind in shared memory.
    interrupted: &'a AtomicBool,
}

/// One line of the outcome.
#[derive(Serialize)]
struct Row {
    scenario: String,
    policy: Policy,
    mode: Mode,
    threads: usize,
    envs: usize,
    batch_size: usize,
    /// Steps of single environments per second.
    steps_per_s: f64,
    /// Nanoseconds per living unit and tick, on all threads together.
    ns_per_unit_tick: f64,
    /// Resident memory of the process that steps.
    rss_bytes: u64,
}

/// Counts of one measurement.
struct Measured {
    steps: u64,
    /// Living units at each step's begin, times 8 ticks.
    unit_ticks: u64,
    time: Duration,
    rss_bytes: u64,
}

impl Bench {
    pub(in crate::cli) fn run(self) -> Outcome {
        if self.table {
            return table::print(self.json);
        }
        let names = if self.scenarios.is_empty() {
            Scenario::standard_names().map(str::to_owned).collect()
        } else {
            self.scenarios.clone()
        };
        let scenarios = names.iter().map(|n| Scenario::resolve(n)).collect::<Result<Vec<_>, _>>()?;
        let (options, time) = self.check()?;
        let interrupted = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM] {
            signal_hook::flag::register(signal, Arc::clone(&interrupted))?;
        }
        let title = heading([
            "scenario",
            "policy",
            "mode",
            "threads",
            "environments",
            "steps/s",
            "ns/unit/tick",
            "memory",
        ]);
        let mut rows = vec![title];
        for (word, scenario) in names.iter().zip(&scenarios) {
            let envs = self.envs;
            let batch_size = self.batch_size.unwrap_or(envs).min(envs);
            let (policy, mode) = (self.policy, self.mode);
            let interrupted = &*interrupted;
            let task = Task { scenario, word, policy, mode, envs, batch_size, options, time, interrupted };
            let row = task.measure()?;
            if self.json {
                out!("{}", serde_json::to_string(&row)?)?;
            } else {
                eprintln!("{}: {:.0} steps/s", row.scenario, row.steps_per_s);
                rows.push(row.cells());
            }
        }
        if !self.json {
            print_table(&rows)?;
        }
        Ok(())
    }

    fn check(&self) -> Result<(PoolOptions, Duration), Box<dyn Error>> {
        let threads = self.threads.unwrap_or(PoolOptions::default().threads);
        if threads == 0 || self.envs == 0 || self.batch_size == Some(0) {
            return Err("--threads, --envs and --batch-size begin at 1".into());
        }
        let time = Duration::try_from_secs_f64(self.seconds)
            .map_err(|_| format!("--seconds {}: a number of seconds is right, as 3 or 0.5", self.seconds))?;
        Ok((PoolOptions { threads, wait: self.wait }, time))
    }
}

impl Task<'_> {
    /// Whether to go on.
    fn check_on(&self) -> Result<(), Box<dyn Error>> {
        if self.interrupted.load(Ordering::Relaxed) { Err("interrupted".into()) } else { Ok(()) }
    }

    fn measure(&self) -> Result<Row, Box<dyn Error>> {
        let (measured, threads) = match self.mode {
            Mode::Engine => (engine::measure(self)?, 1),
            Mode::Embedded | Mode::Attached => (pool::measure(self)?, self.options.threads),
        };
        let seconds = measured.time.as_secs_f64();
        Ok(Row {
            scenario: self.scenario.name.clone(),
            policy: self.policy,
            mode: self.mode,
            threads,
            envs: self.envs,
            batch_size: self.batch_size,
            steps_per_s: measured.steps as f64 / seconds,
            ns_per_unit_tick: seconds * 1e9 / measured.unit_ticks as f64,
            rss_bytes: measured.rss_bytes,
        })
    }
}

impl Row {
    fn cells(&self) -> Vec<String> {
        vec![
            self.scenario.clone(),
            word(self.policy),
            word(self.mode),
            self.threads.to_string(),
            self.envs.to_string(),
            format!("{:.0}", self.steps_per_s),
            format!("{:.0}", self.ns_per_unit_tick),
            super::megabytes(self.rss_bytes as usize),
        ]
    }
}

/// An option's value as it is typed.
fn word(value: impl ValueEnum) -> String {
    value.to_possible_value().map_or(String::new(), |v| v.get_name().to_owned())
}

/// Resident memory of a process, 0 if the system does not tell.
fn resident_bytes(pid: u32) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmRSS:"));
    line.and_then(|l| l.trim().trim_end_matches(" kB").parse::<u64>().ok()).map_or(0, |kb| kb * 1024)
}
