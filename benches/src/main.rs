//! The program that produces the results in `benches/README.md`. What is compared is measured in turn, and
//! each result is the median over rounds.

#![forbid(unsafe_code)]

mod beside;
mod branching;
mod engine;
mod instructions;
mod null;
mod paper;
mod ping_pong;
mod policies;
mod pools;
mod recorded_instructions;
mod step_times;
mod symmetry;
mod transport;

use clap::{Parser, Subcommand};
use smaclite_cli::bench::policy::Policy;
use smaclite_cli::bench::throughput::Workload;
use smaclite_cli::process::{end_with_first_process, wait_for_termination};
use smaclite_engine::Rules;
use smaclite_ipc::{RuntimeDir, WaitStrategy};
use smaclite_pool::PoolOptions;
use std::error::Error;
use std::num::NonZeroUsize;
use std::process::{Command, ExitCode};
use std::time::Duration;

/// Produce the results in benches/README.md.
#[derive(Parser)]
struct Cli {
    #[command(subcommand)]
    command: Measurement,
    /// Rounds; each result is the median over them
    #[arg(long, default_value = "5", global = true)]
    rounds: NonZeroUsize,
}

#[derive(Subcommand)]
enum Measurement {
    /// Round trips of environments that do nothing, between two processes, compared with bare iceoryx2
    Transport,
    /// Steps/s of pools, divided by the number of threads times the steps/s of the engine alone
    Efficiency {
        /// Names or files of scenarios
        #[arg(default_value = "3s5z", value_name = "SCENARIO")]
        scenarios: Vec<String>,
    },
    /// Steps/s of an embedded pool of 64 environments that do nothing, as JSON (for peers.py)
    Idle {
        /// Seconds to measure
        #[arg(long, default_value_t = 3.0)]
        seconds: f64,
    },
    /// Asynchronous compared with synchronous stepping, where some steps take much longer than others
    Asynchronous,
    /// 64 to 10,000 environments in one lane
    Many,
    /// Latency of a lane with one environment while another lane of its pool steps 1024
    Beside,
    /// Forks and restores of 64 environments, compared with their steps
    Branching,
    /// Time per living unit and tick in each scenario, of fresh battles and of one that is replayed
    Engine {
        #[command(flatten)]
        plays: engine::Plays,
        /// Seconds per scenario, for fresh battles and for the replayed one each
        #[arg(long, default_value_t = 1.0, allow_negative_numbers = true)]
        seconds: f64,
    },
    /// Time per step on the maps of the paper's table, measured as there
    Paper,
    /// Instructions of each phase of a step, counted by callgrind
    Instructions {
        #[command(flatten)]
        plays: engine::Plays,
        /// Count the scenarios of benches/instructions.csv with both policies and write it anew
        #[arg(long, conflicts_with_all = ["check", "policy", "steps", "scenarios"])]
        record: bool,
        /// Fail if a count exceeds the one in benches/instructions.csv by more than 3 %
        #[arg(long, conflicts_with_all = ["policy", "steps"])]
        check: bool,
    },
    /// Returns and win rates of the scripted policies, as a Markdown table (docs/reference/policies.md)
    Policies(policies::Games),
    /// Wins of scripted policies against themselves in the mirror, as a Markdown table
    Symmetry(symmetry::Games),
    /// The second process of a measurement
    #[command(hide = true)]
    Second {
        #[command(subcommand)]
        process: SecondProcess,
    },
}

#[derive(Subcommand)]
enum SecondProcess {
    /// Answers pings until it is terminated
    Pong { name: String, wait: WaitStrategy },
    /// Plays a battle once, under callgrind
    Play { scenario: String, rules: Rules, policy: Policy, steps: usize },
    /// Forks a battle, under callgrind
    Fork { scenario: String, forks: usize },
    /// Prints which extensions of the instruction set the processor has
    Extensions,
    /// Serves environments that do nothing
    Null { name: String, num_envs: usize, threads: usize, wait: WaitStrategy },
    /// Serves the pool of a workload
    Pool {
        name: String,
        scenario: String,
        num_envs: usize,
        batch_size: usize,
        threads: usize,
        wait: WaitStrategy,
    },
}

fn main() -> ExitCode {
    match run(Cli::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("smaclite-benches: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(cli: Cli) -> Result<(), Box<dyn Error>> {
    let rounds = cli.rounds.get();
    match cli.command {
        Measurement::Transport => transport::measure(rounds),
        Measurement::Efficiency { scenarios } => pools::efficiency(rounds, &scenarios),
        Measurement::Idle { seconds } => {
            let time = Duration::try_from_secs_f64(seconds)?;
            let steps_per_s = null::steps_per_s(64, PoolOptions::default(), time)?;
            println!("{{\"steps_per_s\": {steps_per_s}}}");
            Ok(())
        }
        Measurement::Asynchronous => pools::asynchronous(rounds),
        Measurement::Many => pools::many(rounds),
        Measurement::Beside => beside::measure(rounds),
        Measurement::Branching => branching::measure(rounds),
        Measurement::Engine { plays, seconds } => step_times::measure(&plays, seconds),
        Measurement::Paper => paper::measure(),
        Measurement::Instructions { record: true, .. } => recorded_instructions::record(),
        Measurement::Instructions { plays, check: true, .. } => {
            recorded_instructions::check(&plays.scenarios)
        }
        Measurement::Instructions { plays, .. } => instructions::measure(&plays),
        Measurement::Policies(games) => policies::measure(&games),
        Measurement::Symmetry(games) => symmetry::measure(&games),
        Measurement::Second { process } => run_second(process),
    }
}

fn run_second(process: SecondProcess) -> Result<(), Box<dyn Error>> {
    end_with_first_process();
    match process {
        SecondProcess::Pong { name, wait } => ping_pong::serve(&name, wait),
        SecondProcess::Play { scenario, rules, policy, steps } => {
            instructions::play_once(&scenario, rules, policy, steps)
        }
        SecondProcess::Fork { scenario, forks } => instructions::fork_once(&scenario, forks),
        SecondProcess::Extensions => {
            recorded_instructions::print_extensions();
            Ok(())
        }
        SecondProcess::Null { name, num_envs, threads, wait } => null::serve(&name, num_envs, threads, wait),
        SecondProcess::Pool { name, scenario, num_envs, batch_size, threads, wait } => {
            let options = PoolOptions { threads, wait };
            let workload = Workload { num_envs, batch_size, options, ..Workload::new(&scenario)? };
            let _supervisor = workload.serve(&RuntimeDir::for_current_user()?, &name)?;
            Ok(wait_for_termination()?)
        }
    }
}

/// This program as a second process.
fn second_process(arguments: &[&str]) -> std::io::Result<Command> {
    let mut command = Command::new(std::env::current_exe()?);
    command.arg("second").args(arguments);
    Ok(command)
}
