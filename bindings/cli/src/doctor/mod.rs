//! `smaclite-pool doctor`: what a bug report needs, and whether pools work on this machine.
//! `machine` reads what there is to know; the checks are here.

mod machine;

use super::{CommandResult, HostVersion, list};
use crate::bench::this_program::serve_command;
use crate::bench::throughput::{Mode, Workload};
use crate::process::interrupt_flag;
use clap::Args;
use machine::{Limit, Machine, SHM, SharedMemory, shown};
use serde::Serialize;
use smaclite_ipc::{PoolStatus, ROOT_VARIABLE, RuntimeDir, left_over_files};
use smaclite_pool::PoolOptions;
use std::error::Error;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

#[derive(Args)]
#[command(after_help = "\
The pools of the checks are small, run for a moment, and end. As at the start of every pool, files that \
killed pools left in /dev/shm are removed. The exit status is 1 if a check failed.")]
pub(super) struct Doctor {
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// What is printed.
#[derive(Serialize)]
struct Report {
    machine: Machine,
    pools: Vec<PoolStatus>,
    checks: Vec<Check>,
}

#[derive(Serialize)]
struct Check {
    name: &'static str,
    result: Outcome,
    found: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    remedy: Option<String>,
}

#[derive(Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
enum Outcome {
    Ok,
    Warning,
    Failed,
}

impl Outcome {
    fn name(self) -> &'static str {
        match self {
            Outcome::Ok => "ok",
            Outcome::Warning => "warning",
            Outcome::Failed => "FAILED",
        }
    }
}

impl Check {
    fn ok(name: &'static str, found: impl Into<String>) -> Check {
        Check { name, result: Outcome::Ok, found: found.into(), remedy: None }
    }

    fn warning(name: &'static str, found: impl Into<String>, remedy: impl Into<String>) -> Check {
        Check { name, result: Outcome::Warning, found: found.into(), remedy: Some(remedy.into()) }
    }

    fn failed(name: &'static str, found: impl Into<String>, remedy: impl Into<String>) -> Check {
        Check { name, result: Outcome::Failed, found: found.into(), remedy: Some(remedy.into()) }
    }
}

/// Docker's default size of `/dev/shm`, which many a pool does not fit into.
const SMALL_SHM: u64 = 64 << 20;

/// Less than this is soon used up by a pool and a learner.
const LITTLE_MEMORY: u64 = 256 << 20;

/// Shared memory and stacks of threads take address space before they are used, some GB for large pools and
/// for frameworks.
const LITTLE_ADDRESS_SPACE: u64 = 16 << 30;

/// A process opens about ten files per lane; Python and its libraries have theirs.
const FEW_FILES: u64 = 256;

/// The pool of a check.
const SCENARIO: &str = "2s3z";
const NUM_ENVS: usize = 4;
const STEPPING: Duration = Duration::from_millis(100);

impl Doctor {
    pub(super) fn run(self, host: &[HostVersion]) -> CommandResult {
        let interrupted = interrupt_flag()?;
        let report = Report::make(host, &interrupted);
        if interrupted.load(Ordering::Relaxed) {
            return Err("interrupted".into());
        }
        if self.json {
            out!("{}", serde_json::to_string_pretty(&report)?)?
        } else {
            report.print()?
        }
        match report.checks.iter().filter(|check| check.result == Outcome::Failed).count() {
            0 => Ok(()),
            failed => Err(format!("{failed} of {} checks failed", report.checks.len()).into()),
        }
    }
}

impl Report {
    fn make(host: &[HostVersion], interrupted: &AtomicBool) -> Report {
        let machine = Machine::read(host);
        let mut checks = vec![
            shared_memory(machine.shared_memory.as_ref()),
            memory(machine.memory.free()),
            cores(machine.cores.usable),
            open_files(machine.limits["open files"]),
            address_space(machine.limits["address space"]),
        ];
        let mut pools = Vec::new();
        match RuntimeDir::for_current_user() {
            Ok(runtime_dir) => {
                checks.push(Check::ok("runtime folder", runtime_dir.root().display().to_string()));
                let (answered, errors) = list::request_all(&runtime_dir, interrupted);
                pools = answered;
                checks.push(running_pools(pools.len(), &errors));
                checks.push(left_over(&runtime_dir)); // before the next two, which remove what is left over
                checks.push(pool("pool in this process", Mode::Embedded, interrupted));
                checks.push(pool("pool in another process", Mode::Attached, interrupted));
            }
            Err(error) => {
                let remedy = format!("pools need a private folder; {ROOT_VARIABLE} names another one");
                checks.push(Check::failed("runtime folder", error.to_string(), remedy));
            }
        }
        Report { machine, pools, checks }
    }

    fn print(&self) -> std::io::Result<()> {
        for (name, value) in self.machine.lines() {
            out!("{name:<15}{value}")?;
        }
        out!()?;
        if !self.pools.is_empty() {
            list::print_pools(&self.pools)?;
            out!()?;
        }
        for Check { name, result, found, remedy } in &self.checks {
            out!("{:<9}{name}: {found}", result.name())?;
            remedy.as_ref().map_or(Ok(()), |remedy| out!("{:9}{remedy}", ""))?;
        }
        Ok(())
    }
}

fn shared_memory(found: Option<&SharedMemory>) -> Check {
    let name = "shared memory";
    let Some(found) = found else {
        let remedy = format!("mount a tmpfs there: `mount -t tmpfs -o mode=1777,nosuid,nodev tmpfs {SHM}`");
        return Check::failed(name, format!("{SHM} does not exist"), remedy);
    };
    if found.is_read_only {
        return Check::failed(name, format!("{SHM} is read-only"), format!("`mount -o remount,rw {SHM}`"));
    }
    if !found.is_writable {
        return Check::failed(name, format!("{SHM} is not writable"), format!("`chmod 1777 {SHM}`"));
    }
    if found.file_system.as_deref().is_some_and(|kind| kind != "tmpfs") {
        let kind = found.file_system.as_deref().unwrap_or_default();
        let remedy = "mount a tmpfs there, or pools will be as slow as that file system";
        return Check::warning(name, format!("{SHM} is no tmpfs, but {kind}"), remedy);
    }
    if found.free <= SMALL_SHM {
        let sizes = format!("{SHM} has {} free of {}", shown(found.free), shown(found.bytes));
        let remedy = "give a container more (`docker run --shm-size=1g`), or remount it (`mount -o \
             remount,size=1g /dev/shm`); large pools do not start";
        return Check::warning(name, sizes, remedy);
    }
    Check::ok(name, format!("{SHM} has {} free", shown(found.free)))
}

fn memory(free: Option<u64>) -> Check {
    match free {
        Some(free) if free < LITTLE_MEMORY => {
            let remedy =
                "end other programs, or raise the limit of the control group; shared memory counts too";
            Check::warning("memory", format!("{} available", shown(free)), remedy)
        }
        Some(free) => Check::ok("memory", format!("{} available", shown(free))),
        None => Check::ok("memory", "unknown"),
    }
}

fn cores(usable: usize) -> Check {
    if usable > 1 {
        return Check::ok("cores", format!("{usable} usable"));
    }
    let remedy =
        "pools work, but learner and workers take turns; give the process more cores (`--cpus`, taskset)";
    Check::warning("cores", "1 usable", remedy)
}

fn open_files(limit: Limit) -> Check {
    match limit.soft {
        Some(limit) if limit < FEW_FILES => {
            let remedy =
                format!("`ulimit -n 4096`; a process opens about ten files per lane, and needs {FEW_FILES}");
            Check::warning("open files", format!("at most {limit}"), remedy)
        }
        _ => Check::ok("open files", "the limit is high enough"),
    }
}

fn address_space(limit: Limit) -> Check {
    match limit.soft {
        Some(limit) if limit < LITTLE_ADDRESS_SPACE => {
            let remedy = "`ulimit -v unlimited`; shared memory and the stacks of threads count, used or not";
            Check::warning("address space", format!("at most {}", shown(limit)), remedy)
        }
        Some(limit) => Check::ok("address space", format!("at most {}", shown(limit))),
        None => Check::ok("address space", "unlimited"),
    }
}

fn running_pools(answered: usize, errors: &[impl Error]) -> Check {
    if errors.is_empty() {
        return Check::ok("running pools", answered.to_string());
    }
    let messages = errors.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ");
    Check::warning("running pools", messages, "end these pools, or wait until they answer")
}

fn left_over(runtime_dir: &RuntimeDir) -> Check {
    match left_over_files(runtime_dir) {
        0 => Check::ok("left-over files", "none"),
        files => {
            let remedy =
                "`smaclite-pool clean` removes them; those in /dev/shm are gone after the checks below";
            Check::warning("left-over files", format!("{files} of killed pools or learners"), remedy)
        }
    }
}

/// Starts a pool, steps it through shared memory and ends it.
fn pool(name: &'static str, mode: Mode, interrupted: &AtomicBool) -> Check {
    let play = || -> Result<(), Box<dyn Error>> {
        let options = PoolOptions { threads: 1, ..PoolOptions::default() };
        let workload = Workload {
            mode,
            options,
            num_envs: NUM_ENVS,
            batch_size: NUM_ENVS,
            time: STEPPING,
            ..Workload::new(SCENARIO)?
        };
        workload.measure(&serve_command, interrupted)?;
        Ok(())
    };
    match play() {
        Ok(()) => Check::ok(name, format!("{NUM_ENVS} x {SCENARIO} started, stepped and ended")),
        Err(error) => {
            let remedy =
                "the FAQ (docs/faq.md) lists messages; if this one is not there, please report all of this";
            Check::failed(name, error.to_string(), remedy)
        }
    }
}
