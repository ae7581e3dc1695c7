//! `smaclite-pool bench --against`: other programs and this one, measured in turn. `peers` runs them; here
//! are the options and the table.

use super::null;
use super::peers::{Comparison, Found, Peer, PeerError};
use super::this_program::{python_interpreter, serve_command};
use super::throughput::{MeasureError, Workload};
use crate::CommandResult;
use crate::number::count;
use crate::table::Table;
use clap::Args;
use std::error::Error;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

#[derive(Args)]
pub(super) struct Against {
    /// Measure other programs too, in turn with this one, and print how many times as many steps/s this one
    /// reaches. Each is measured in the given scenarios that it has [without a value: all]
    #[arg(
        long,
        value_name = "PEER,...",
        value_delimiter = ',',
        num_args = 0..,
        require_equals = true,
        default_missing_values = ["published", "smax", "envpool", "pufferlib"]
    )]
    against: Option<Vec<Peer>>,
    /// Python interpreter that can import the peers; several times for several, the first that can is used
    /// [default: the one that runs this program, otherwise python3]
    #[arg(long, value_name = "PATH", requires = "against")]
    python: Vec<PathBuf>,
    /// Rounds of measurements in turn; each result is the median over them
    #[arg(long, value_name = "N", default_value_t = 3, requires = "against", value_parser = count(1..=1000))]
    rounds: usize,
}

impl Against {
    pub(super) fn is_given(&self) -> bool {
        self.against.is_some()
    }

    /// Prints a row per peer and scenario. A peer that is not installed or fails is a line at the end.
    pub(super) fn run(&self, workloads: &[Workload], json: bool, interrupted: &AtomicBool) -> CommandResult {
        let mut report = Report { table: Table::new(&HEADINGS), notes: Vec::new(), json, results: 0 };
        for peer in self.against.iter().flatten() {
            match peer.find(&self.interpreters()) {
                Ok(found) => {
                    report.notes.push(format!("{}: {}", peer.name(), found.versions()));
                    self.compare(*peer, &found, workloads, interrupted, &mut report)?;
                }
                Err(error) => report.failed(&error, interrupted)?,
            }
        }
        report.print(workloads)
    }

    fn interpreters(&self) -> Vec<PathBuf> {
        if self.python.is_empty() {
            vec![python_interpreter().unwrap_or_else(|| "python3".into())]
        } else {
            self.python.clone()
        }
    }

    fn compare(
        &self,
        peer: Peer,
        found: &Found,
        workloads: &[Workload],
        interrupted: &AtomicBool,
        report: &mut Report,
    ) -> CommandResult {
        let rounds = self.rounds;
        let Some(scenarios) = found.scenarios() else {
            let Some(Workload { options, num_envs, time, .. }) = workloads.first().cloned() else {
                return Ok(());
            };
            let mut here = || null::steps_per_s(num_envs, options, time);
            return report.add(found.compare("no work", rounds, time, &mut here), interrupted);
        };
        let common: Vec<_> = workloads.iter().filter(|w| scenarios.contains(&w.scenario_argument)).collect();
        if common.is_empty() {
            report.notes.push(format!("{}: it has none of the scenarios; it has {scenarios:?}", peer.name()));
        }
        for workload in common {
            let mut here = || Ok(workload.measure(&serve_command, interrupted)?.steps_per_s);
            let result = found.compare(&workload.scenario_argument, rounds, workload.time, &mut here);
            report.add(result, interrupted)?;
        }
        Ok(())
    }
}

const HEADINGS: [&str; 6] = ["scenario", "peer", "steps/s", "here", "ratio", "configuration of the peer"];

struct Report {
    table: Table,
    notes: Vec<String>,
    json: bool,
    results: usize,
}

impl Report {
    fn add(&mut self, result: Result<Comparison, PeerError>, interrupted: &AtomicBool) -> CommandResult {
        let result = match result {
            Ok(result) => result,
            Err(error) => return self.failed(&error, interrupted),
        };
        self.results += 1;
        if self.json {
            return Ok(out!("{}", serde_json::to_string(&result)?)?);
        }
        let Comparison { scenario, peer, configuration, peer_steps_per_s, steps_per_s, ratio } = result;
        let (peer, ratio) = (peer.name(), format!("{ratio:.2} x"));
        eprintln!("{scenario}, {peer}: {peer_steps_per_s:.0} steps/s, {ratio} here"); // progress
        let [theirs, ours] = [peer_steps_per_s, steps_per_s].map(|steps| format!("{steps:.0}"));
        self.table.push([scenario, peer, theirs, ours, ratio, configuration]);
        Ok(())
    }

    /// Goes on with the next peer, unless the program was interrupted.
    fn failed(&mut self, error: &PeerError, interrupted: &AtomicBool) -> CommandResult {
        if interrupted.load(Ordering::Relaxed) {
            return Err(MeasureError::Interrupted.into());
        }
        self.notes.push(error.to_string());
        Ok(())
    }

    fn print(self, workloads: &[Workload]) -> CommandResult {
        if self.json {
            self.notes.iter().for_each(|note| eprintln!("{note}"));
        } else {
            if self.results > 0 {
                self.table.print()?;
                out!()?;
            }
            self.notes.iter().try_for_each(|note| out!("{note}"))?;
            if let (1.., Some(workload)) = (self.results, workloads.first()) {
                out!("here: {}", configuration(workload))?;
            }
        }
        if self.results == 0 {
            Err(Box::<dyn Error>::from("no other program could be measured"))
        } else {
            Ok(())
        }
    }
}

/// The configuration of this program, the same for all scenarios.
fn configuration(workload: &Workload) -> String {
    let Workload { options, num_envs, batch_size, policy, mode, .. } = workload;
    format!(
        "{}, {} threads, {num_envs} environments in batches of {batch_size}, policy {}",
        mode.name(),
        options.threads,
        policy.name()
    )
}
