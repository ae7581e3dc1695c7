//! `smaclite-pool doctor`: what a bug report needs, and whether pools work on this machine. What is wrong
//! with a machine is said by the errors of the pools that it starts.

use super::{CommandResult, HostVersion, megabytes};
use crate::bench::this_program::serve_command;
use crate::bench::throughput::{Mode, Workload};
use crate::os;
use crate::process::interrupt_flag;
use clap::Args;
use serde::Serialize;
use smaclite_ipc::{RuntimeDir, left_over_files};
use smaclite_pool::PoolOptions;
use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;
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
    /// Names and what was found, in the order in which they are printed.
    #[serde(serialize_with = "as_object")]
    facts: Vec<(&'static str, String)>,
    /// Environment variables of this program.
    environment: BTreeMap<String, String>,
    checks: Vec<Check>,
}

#[derive(Serialize)]
struct Check {
    name: &'static str,
    /// Why it failed.
    error: Option<String>,
}

/// The pool of a check.
const SCENARIO: &str = "2s3z";
const NUM_ENVS: usize = 4;
const STEPPING: Duration = Duration::from_millis(100);

const SHM: &str = "/dev/shm";

fn as_object<S: serde::Serializer>(facts: &[(&str, String)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(facts.iter().map(|(name, value)| (name, value)))
}

impl Doctor {
    pub(super) fn run(self, host: &[HostVersion]) -> CommandResult {
        let interrupted = interrupt_flag()?;
        let runtime_dir = RuntimeDir::for_current_user();
        // Before the checks, which remove what killed pools left in shared memory.
        let facts = facts(host, runtime_dir.as_ref().ok());
        let check = |name, mode| Check { name, error: error_of_pool(mode, &interrupted) };
        let checks = match runtime_dir {
            Ok(_) => {
                vec![
                    check("pool in this process", Mode::Embedded),
                    check("pool in another process", Mode::Attached),
                ]
            }
            Err(error) => vec![Check { name: "runtime folder", error: Some(error.to_string()) }],
        };
        let report = Report { facts, environment: environment(), checks };
        if interrupted.load(Ordering::Relaxed) {
            return Err("interrupted".into());
        }
        match self.json {
            true => out!("{}", serde_json::to_string_pretty(&report)?)?,
            false => report.print()?,
        }
        match report.checks.iter().filter(|check| check.error.is_some()).count() {
            0 => Ok(()),
            failed => Err(format!("{failed} of {} checks failed", report.checks.len()).into()),
        }
    }
}

impl Report {
    fn print(&self) -> std::io::Result<()> {
        let variables = self.environment.iter().map(|(name, value)| (name.as_str(), value));
        for (name, value) in self.facts.iter().map(|(name, value)| (*name, value)).chain(variables) {
            out!("{name:<16} {value}")?;
        }
        out!()?;
        for Check { name, error } in &self.checks {
            match error {
                None => out!("ok      {name}: {NUM_ENVS} x {SCENARIO} started, stepped and ended")?,
                Some(error) => out!(
                    "FAILED  {name}: {error}\n        the FAQ (docs/faq.md) lists messages; if this one is \
                     not there, please report all of this"
                )?,
            }
        }
        Ok(())
    }
}

/// Starts a pool, steps it through shared memory and ends it. Returns why it could not.
fn error_of_pool(mode: Mode, interrupted: &AtomicBool) -> Option<String> {
    let play = || -> CommandResult {
        let options = PoolOptions { threads: 1, ..PoolOptions::default() };
        let sizes = Workload { num_envs: NUM_ENVS, batch_size: NUM_ENVS, ..Workload::new(SCENARIO)? };
        let workload = Workload { mode, options, time: STEPPING, ..sizes };
        workload.measure(&serve_command, interrupted).map(drop).map_err(Box::<dyn Error>::from)
    };
    play().err().map(|error| error.to_string())
}

/// What can be read of the program and the machine.
fn facts(host: &[HostVersion], runtime_dir: Option<&RuntimeDir>) -> Vec<(&'static str, String)> {
    let cores = std::thread::available_parallelism().map_or(1, |cores| cores.get());
    let [open_files, address_space] = os::limits();
    let built = [env!("CARGO_PKG_VERSION"), env!("BUILD_TARGET"), env!("BUILD_PROFILE")].join(", ");
    let host = host.iter().map(|(name, version)| format!("{name} {version}")).collect::<Vec<_>>().join(", ");
    let facts = [
        ("smaclite-pool", Some(built)),
        ("engine uses", Some(smaclite_engine::instruction_set().to_owned())),
        ("run by", Some(host)),
        ("kernel", os::kernel()),
        ("distribution", field("/etc/os-release", "PRETTY_NAME=").map(|name| name.replace('"', ""))),
        ("container", container()),
        (
            "namespaces",
            Path::new("/proc/self/ns")
                .exists()
                .then(|| ["pid", "ipc", "mnt", "user"].map(namespace).join(", ")),
        ),
        ("processor", field("/proc/cpuinfo", "model name")),
        ("usable cores", Some(cores.to_string())),
        ("memory", field("/proc/meminfo", "MemTotal")),
        ("available memory", field("/proc/meminfo", "MemAvailable")),
        ("cgroup's limit", read("/sys/fs/cgroup/memory.max").map(|limit| limit.trim().to_owned())),
        (SHM, shared_memory()),
        ("open files", open_files),
        ("address space", address_space),
        ("runtime folder", runtime_dir.map(|folder| folder.root().display().to_string())),
        ("left-over files", runtime_dir.map(left_over)),
    ];
    let known = facts.into_iter().filter_map(|(name, value)| Some((name, value?)));
    known.filter(|(_, value)| !value.is_empty()).collect()
}

fn read(path: &str) -> Option<String> {
    std::fs::read_to_string(path).ok()
}

/// What follows a name, and a colon if there is one, in the first line of a file that begins with it.
fn field(path: &str, name: &str) -> Option<String> {
    let text = read(path)?;
    let rest = text.lines().find_map(|line| line.strip_prefix(name))?;
    Some(rest.trim_start_matches([' ', '\t', ':']).to_owned())
}

/// What says that this is a container or the job of a scheduler.
fn container() -> Option<String> {
    let files = ["/.dockerenv", "/run/.containerenv"].into_iter().filter(|file| Path::new(file).exists());
    let names = ["container", "KUBERNETES_SERVICE_HOST", "APPTAINER_CONTAINER", "SLURM_JOB_ID"];
    let variables = names.into_iter().filter(|name| std::env::var_os(name).is_some());
    Some(files.chain(variables).collect::<Vec<_>>().join(", "))
}

/// A namespace of this process, which all processes of a pool must share.
fn namespace(kind: &str) -> String {
    let link = std::fs::read_link(format!("/proc/self/ns/{kind}"));
    link.map_or_else(|_| format!("{kind}: unknown"), |link| link.display().to_string())
}

fn shared_memory() -> Option<String> {
    let room = os::room(SHM)?;
    let mounts = read("/proc/mounts").unwrap_or_default();
    let of_shm = |line: &&str| line.split(' ').nth(1) == Some(SHM);
    let mount = mounts.lines().rfind(of_shm).unwrap_or("no mount of its own");
    let [size, free] = room.map(|bytes| megabytes(bytes as usize));
    Some(format!("{size}, {free} free, {mount}"))
}

fn left_over(runtime_dir: &RuntimeDir) -> String {
    match left_over_files(runtime_dir) {
        0 => "none".to_owned(),
        files => format!("{files} of killed pools or learners; `smaclite-pool clean` removes them"),
    }
}

fn environment() -> BTreeMap<String, String> {
    let all = std::env::vars_os().map(|(name, value)| (name, value.to_string_lossy().into_owned()));
    let text = all.filter_map(|(name, value)| Some((name.into_string().ok()?, value)));
    text.filter(|(name, _)| name.starts_with("SMACLITE_")).collect()
}
