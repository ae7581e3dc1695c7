//! `smaclite-pool bench`: steps per second of the engine or of a pool. Here are the options and the tables;
//! the modules measure. The program `smaclite-benches` uses those that are public.

pub mod policy;
pub(crate) mod this_program;
pub mod throughput;

use crate::number::count;
use crate::output::print_json;
use crate::process::interrupt_flag;
use crate::table::Table;
use crate::usage::first_given;
use crate::{CommandResult, THREADS, completions, megabytes};
use clap::Args;
use policy::Policy;
use smaclite_engine::Rules;
use smaclite_ipc::WaitStrategy;
use smaclite_pool::{MAX_ENVS, PoolOptions};
use smaclite_scenarios::Scenario;
use std::error::Error;
use std::time::Duration;
use this_program::serve_command;
use throughput::{Mode, Throughput, Workload};

#[derive(Args)]
pub(super) struct Bench {
    /// Scenarios: standard names or files [default: the 23 maps of SMAC]
    #[arg(value_name = "SCENARIO", add = completions::scenario())]
    scenarios: Vec<String>,
    /// Rules of the battles: smaclite (as the published environment plays), paper (as its paper describes) or
    /// starcraft (nearer to the real battles)
    #[arg(long, default_value = "smaclite")]
    rules: Rules,
    /// How the agents choose their actions
    #[arg(long, value_enum, default_value = "sampled")]
    policy: Policy,
    /// What is measured
    #[arg(long, value_enum, default_value = "embedded")]
    mode: Mode,
    /// Number of threads of a pool, 1 to 1024 [default: the CPU cores available to this process, in the mode
    /// `attached` minus one for the learner]
    #[arg(long, value_name = "N", value_parser = count(THREADS))]
    threads: Option<usize>,
    /// Number of environments
    #[arg(long, default_value_t = 64, value_name = "N", value_parser = count(1..=MAX_ENVS))]
    num_envs: usize,
    /// Environments per batch; fewer than --num-envs means asynchronous stepping, which needs the policy
    /// `sampled` [default: --num-envs]
    #[arg(long, value_name = "M", value_parser = count(1..=MAX_ENVS))]
    batch_size: Option<usize>,
    /// Seconds to measure per scenario, 0 to 1000000
    #[arg(long, default_value_t = 3.0)]
    seconds: f64,
    /// How idle threads of a pool wait: adaptive, spin or block [default: adaptive]
    #[arg(long, value_name = "STRATEGY")]
    wait: Option<WaitStrategy>,
    /// Print one JSON object per scenario
    #[arg(long)]
    json: bool,
}

impl Bench {
    pub(super) fn run(self) -> CommandResult {
        let workloads = self.workloads()?;
        let interrupted = interrupt_flag()?;
        let mut table = Table::new(
            "scenario|policy|mode|threads|environments|batch size|steps/s|ns per unit and tick|memory"
                .split('|'),
        );
        for workload in &workloads {
            let result = workload.measure(&serve_command, &interrupted)?;
            if self.json {
                print_json(&result)?;
            } else {
                err!("{}: {:.0} steps/s", result.scenario, result.steps_per_s); // progress
                table.push(cells(&result));
            }
        }
        if !self.json {
            table.print()?;
        }
        Ok(())
    }

    fn workloads(&self) -> Result<Vec<Workload>, Box<dyn Error>> {
        let default = match self.mode {
            Mode::Attached => PoolOptions::for_other_processes(),
            Mode::Embedded | Mode::Engine | Mode::InTurn => PoolOptions::default(),
        };
        if let Mode::Engine | Mode::InTurn = self.mode {
            let of_pools = [
                ("--threads", self.threads.is_some()),
                ("--batch-size", self.batch_size.is_some()),
                ("--wait", self.wait.is_some()),
            ];
            if let Some(option) = first_given(of_pools) {
                let mode = self.mode.name();
                return Err(format!("{option} has no effect in the mode `{mode}`, which has no pool").into());
            }
        }
        let threads = self.threads.unwrap_or(default.threads);
        let num_envs = self.num_envs;
        let batch_size = self.batch_size.unwrap_or(num_envs);
        if batch_size > num_envs {
            return Err(format!("--batch-size must be between 1 and {num_envs}, got {batch_size}").into());
        }
        if !(0.0..=1e6).contains(&self.seconds) {
            return Err(
                format!("--seconds must be a number from 0 to 1000000, got {:?}", self.seconds).into()
            );
        }
        let time = Duration::from_secs_f64(self.seconds);
        let standard = || Scenario::standard_names().map(str::to_owned).collect();
        let names: Vec<String> = if self.scenarios.is_empty() { standard() } else { self.scenarios.clone() };
        let options = PoolOptions { threads, wait: self.wait.unwrap_or(default.wait) };
        let (policy, mode) = (self.policy, self.mode);
        let workload = |name: &String| -> Result<Workload, Box<dyn Error>> {
            Ok(Workload {
                rules: self.rules,
                policy,
                mode,
                num_envs,
                batch_size,
                options,
                time,
                ..Workload::new(name)?
            })
        };
        names.iter().map(workload).collect()
    }
}

fn cells(result: &Throughput) -> [String; 9] {
    [
        result.scenario.clone(),
        result.policy.name(),
        result.mode.name(),
        result.threads.to_string(),
        result.num_envs.to_string(),
        result.batch_size.to_string(),
        format!("{:.0}", result.steps_per_s),
        format!("{:.0}", result.ns_per_unit_tick),
        megabytes(result.rss_bytes),
    ]
}
