//! The figures that `benches/README.md` records: each is a ratio of two measurements made in turn, medians
//! over rounds. What steps real battles is measured by `smaclite-pool bench`, which this program calls; what
//! is compared with bare iceoryx2 or with an environment that costs nothing is measured here.

#![forbid(unsafe_code)]

mod battles;
mod engine;
mod null;
mod ping_pong;
mod transport;

use clap::{Parser, Subcommand};
use std::error::Error;

#[derive(Parser)]
#[command(about = "Measures the figures in benches/README.md")]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Rounds; each figure is the median
    #[arg(long, default_value_t = 5, global = true)]
    rounds: usize,
}

#[derive(Subcommand)]
enum Command {
    /// A lane whose environments cost nothing, across two processes, beside a bare iceoryx2 ping-pong
    Transport,
    /// Steps/s of a pool over threads times steps/s of one bare engine
    Efficiency {
        /// Names or files of scenarios
        #[arg(default_value = "3s5z")]
        scenarios: Vec<String>,
    },
    /// Asynchronous beside synchronous stepping, where steps cost unevenly
    Asynchronous,
    /// 64 to 10,000 environments in one lane
    Many,
    /// What a living unit costs in a tick, in every scenario
    Engine {
        #[command(flatten)]
        plays: engine::Plays,
        /// Seconds for each scenario
        #[arg(long, default_value_t = 1.0)]
        seconds: f64,
    },
    /// Instructions of each phase of a step, counted by callgrind
    Instructions(engine::Plays),
    /// The other side of a measurement
    #[command(hide = true)]
    Peer {
        #[command(subcommand)]
        peer: Peer,
    },
}

#[derive(Subcommand)]
enum Peer {
    /// Answers pings until it is killed
    Pong { name: String, wait: String },
    /// Plays a battle once, under callgrind
    Play { scenario: String, policy: String, steps: usize },
    /// Serves a lane of environments that cost nothing
    Null { name: String, envs: usize, threads: usize, wait: String },
}

fn main() -> Result<(), Box<dyn Error>> {
    let cli = Cli::parse();
    match cli.command {
        Command::Transport => transport::stats(cli.rounds),
        Command::Efficiency { scenarios } => battles::efficiency(cli.rounds, &scenarios),
        Command::Asynchronous => battles::asynchronous(cli.rounds),
        Command::Many => battles::many(cli.rounds),
        Command::Engine { plays, seconds } => engine::times(&plays, seconds),
        Command::Instructions(plays) => engine::instructions(&plays),
        Command::Peer { peer: Peer::Pong { name, wait } } => ping_pong::serve(&name, wait.parse()?),
        Command::Peer { peer: Peer::Play { scenario, policy, steps } } => {
            engine::play_once(&scenario, &policy, steps)
        }
        Command::Peer { peer: Peer::Null { name, envs, threads, wait } } => {
            null::serve(&name, envs, threads, wait.parse()?)
        }
    }
}

/// The middle of some measurements.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Another process of this program, killed when the measurement is over.
struct PeerProcess(std::process::Child);

impl PeerProcess {
    fn start(args: &[&str]) -> std::io::Result<PeerProcess> {
        let child = std::process::Command::new(std::env::current_exe()?).arg("peer").args(args).spawn()?;
        Ok(PeerProcess(child))
    }
}

impl Drop for PeerProcess {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
