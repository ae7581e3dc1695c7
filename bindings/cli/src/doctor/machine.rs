//! What a bug report needs to say about the program and the machine. What cannot be read is `None`.

use crate::{HostVersion, megabytes};
use procfs::Current;
use procfs::process::{MountInfo, Process};
use rustix::process::{Resource, getrlimit};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The file system of shared memory.
pub(super) const SHM: &str = "/dev/shm";

#[derive(Serialize)]
pub(super) struct Machine {
    version: &'static str,
    target: &'static str,
    profile: &'static str,
    /// What the compiler could assume of every processor.
    target_features: &'static str,
    /// What the engine uses of this processor.
    instruction_set: &'static str,
    /// What the program runs in.
    host: BTreeMap<&'static str, String>,
    kernel: String,
    distribution: Option<String>,
    /// Containers, virtual machines and job schedulers that left a trace.
    inside: Vec<String>,
    /// Identities of the namespaces that processes of a pool must share.
    namespaces: BTreeMap<&'static str, String>,
    /// `off`, `strict` or `filter`.
    seccomp: Option<&'static str>,
    processor: Option<String>,
    pub(super) cores: Cores,
    pub(super) memory: Memory,
    pub(super) shared_memory: Option<SharedMemory>,
    pub(super) limits: BTreeMap<&'static str, Limit>,
    /// Environment variables of this program.
    environment: BTreeMap<String, String>,
}

#[derive(Serialize)]
pub(super) struct Cores {
    online: Option<usize>,
    /// To which this process is bound.
    affinity: Option<u32>,
    /// With the quota of its control group too; what the defaults of threads are computed from.
    pub(super) usable: usize,
}

/// Bytes.
#[derive(Serialize)]
pub(super) struct Memory {
    total: Option<u64>,
    available: Option<u64>,
    /// The limit of the control group that leaves this process least, and how much of it is used.
    cgroup_limit: Option<u64>,
    cgroup_used: Option<u64>,
}

impl Memory {
    /// What this process may still use.
    pub(super) fn free(&self) -> Option<u64> {
        let in_cgroup = self.cgroup_limit.map(|limit| limit.saturating_sub(self.cgroup_used.unwrap_or(0)));
        [self.available, in_cgroup].into_iter().flatten().min()
    }
}

#[derive(Serialize)]
pub(super) struct SharedMemory {
    pub(super) bytes: u64,
    pub(super) free: u64,
    pub(super) file_system: Option<String>,
    options: Option<String>,
    pub(super) is_read_only: bool,
    pub(super) is_writable: bool,
}

/// A limit of this process; `None` is unlimited.
#[derive(Clone, Copy, Serialize)]
pub(super) struct Limit {
    pub(super) soft: Option<u64>,
    hard: Option<u64>,
}

impl Machine {
    pub(super) fn read(host: &[HostVersion]) -> Machine {
        let this = Process::myself().ok();
        let uname = rustix::system::uname();
        let text = |part: &std::ffi::CStr| part.to_string_lossy().into_owned();
        Machine {
            version: env!("CARGO_PKG_VERSION"),
            target: env!("BUILD_TARGET"),
            profile: env!("BUILD_PROFILE"),
            target_features: env!("BUILD_CARGO_CFG_TARGET_FEATURE"),
            instruction_set: smaclite_engine::instruction_set(),
            host: host.iter().cloned().collect(),
            kernel: format!("{} {} {}", text(uname.sysname()), text(uname.release()), text(uname.machine())),
            distribution: distribution(),
            inside: inside(&text(uname.release())),
            namespaces: ["pid", "ipc", "mnt", "user"].into_iter().filter_map(namespace).collect(),
            seccomp: this.as_ref().and_then(seccomp),
            processor: processor(),
            cores: cores(),
            memory: memory(this.as_ref()),
            shared_memory: shared_memory(this.as_ref()),
            limits: limits(),
            environment: environment(),
        }
    }

    /// Names and values, for people.
    pub(super) fn lines(&self) -> Vec<(&'static str, String)> {
        let unknown = || "unknown".to_owned();
        let list = |map: &BTreeMap<&str, String>| {
            map.iter().map(|(name, value)| format!("{name} {value}")).collect::<Vec<_>>().join(", ")
        };
        let mut lines = vec![
            ("smaclite-pool", format!("{}, {}, {}", self.version, self.target, self.profile)),
            ("built for", self.target_features.to_owned()),
            ("engine uses", self.instruction_set.to_owned()),
            ("run by", list(&self.host)),
            ("kernel", self.kernel.clone()),
            ("distribution", self.distribution.clone().unwrap_or_else(unknown)),
            ("inside", self.inside.join(", ")),
            ("namespaces", list(&self.namespaces)),
            ("seccomp", self.seccomp.map_or_else(unknown, str::to_owned)),
            ("processor", self.processor.clone().unwrap_or_else(unknown)),
            ("cores", self.cores.to_string()),
            ("memory", self.memory.to_string()),
            (SHM, self.shared_memory.as_ref().map_or_else(|| "not found".to_owned(), ToString::to_string)),
        ];
        lines.extend(self.limits.iter().map(|(name, limit)| (*name, limit.to_string())));
        let variables = self.environment.iter().map(|(name, value)| format!("{name}={value}"));
        lines.push(("environment", variables.collect::<Vec<_>>().join(", ")));
        lines.retain(|(_, value)| !value.is_empty());
        lines
    }
}

impl std::fmt::Display for Cores {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Cores { online, affinity, usable } = self;
        write!(f, "{usable} usable")?;
        online.map_or(Ok(()), |n| write!(f, ", {n} online"))?;
        affinity.map_or(Ok(()), |n| write!(f, ", bound to {n}"))
    }
}

impl std::fmt::Display for Memory {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let or_unknown = |bytes: Option<u64>| bytes.map_or_else(|| "unknown".to_owned(), shown);
        write!(f, "{}, {} available", or_unknown(self.total), or_unknown(self.available))?;
        match self.cgroup_limit {
            Some(limit) => {
                write!(f, ", control group: {} of {} used", or_unknown(self.cgroup_used), shown(limit))
            }
            None => write!(f, ", control group: no limit"),
        }
    }
}

impl std::fmt::Display for SharedMemory {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let file_system = self.file_system.as_deref().unwrap_or("unknown file system");
        write!(f, "{file_system}, {}, {} free", shown(self.bytes), shown(self.free))?;
        self.options.as_ref().map_or(Ok(()), |options| write!(f, ", {options}"))
    }
}

impl std::fmt::Display for Limit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let text = |limit: Option<u64>| limit.map_or_else(|| "unlimited".to_owned(), |n| n.to_string());
        write!(f, "{} (at most {})", text(self.soft), text(self.hard))
    }
}

pub(super) fn shown(bytes: u64) -> String {
    megabytes(usize::try_from(bytes).unwrap_or(usize::MAX))
}

/// The name of the distribution, from os-release(5).
fn distribution() -> Option<String> {
    let text = std::fs::read_to_string("/etc/os-release").ok()?;
    let name = text.lines().find_map(|line| line.strip_prefix("PRETTY_NAME="))?;
    Some(name.trim_matches(['"', '\'']).to_owned())
}

fn inside(kernel: &str) -> Vec<String> {
    let files = [("/.dockerenv", "Docker"), ("/run/.containerenv", "Podman")];
    let variables = [
        ("KUBERNETES_SERVICE_HOST", "Kubernetes"),
        ("APPTAINER_CONTAINER", "Apptainer"),
        ("SLURM_JOB_ID", "a SLURM job"),
    ];
    let of_files = files.into_iter().filter(|(file, _)| Path::new(file).exists()).map(|(_, name)| name);
    let of_variables = variables.into_iter().filter(|(name, _)| std::env::var_os(name).is_some());
    let wsl = kernel.to_lowercase().contains("microsoft").then_some("WSL");
    let mut found: Vec<String> =
        of_files.chain(of_variables.map(|(_, name)| name)).chain(wsl).map(str::to_owned).collect();
    // Set by systemd-nspawn, LXC, Podman and others (systemd's "Container Interface").
    found.extend(std::env::var("container"));
    found
}

/// A namespace of this process by its number, which two processes can compare. The first ones of a machine
/// have the numbers of `include/linux/proc_ns.h`.
fn namespace(kind: &'static str) -> Option<(&'static str, String)> {
    let link = std::fs::read_link(format!("/proc/self/ns/{kind}")).ok()?;
    let link = link.to_str()?;
    let number = link.split_once('[')?.1.trim_end_matches(']');
    let is_first =
        matches!((kind, number), ("pid", "4026531836") | ("ipc", "4026531839") | ("user", "4026531837"));
    Some((kind, if is_first { format!("{number} (the machine's)") } else { number.to_owned() }))
}

/// The numbers of proc_pid_status(5).
fn seccomp(this: &Process) -> Option<&'static str> {
    match this.status().ok()?.seccomp? {
        0 => Some("off"),
        1 => Some("strict"),
        _ => Some("filter"),
    }
}

fn processor() -> Option<String> {
    let info = procfs::CpuInfo::current().ok()?;
    let arm =
        || Some(format!("{} {}", info.get_field(0, "CPU implementer")?, info.get_field(0, "CPU part")?));
    info.model_name(0).map(str::to_owned).or_else(arm)
}

fn cores() -> Cores {
    Cores {
        online: procfs::CpuInfo::current().ok().map(|info| info.num_cores()),
        affinity: rustix::thread::sched_getaffinity(None).ok().map(|set| set.count()),
        usable: std::thread::available_parallelism().map_or(1, |cores| cores.get()),
    }
}

fn memory(this: Option<&Process>) -> Memory {
    let info = procfs::Meminfo::current().ok();
    let (cgroup_limit, cgroup_used) = this.and_then(cgroup_memory).unzip();
    Memory {
        total: info.as_ref().map(|info| info.mem_total),
        available: info.as_ref().and_then(|info| info.mem_available),
        cgroup_limit,
        cgroup_used,
    }
}

/// Limit and use of the control group that leaves least, of that of this process and those above it, in
/// either version of control groups.
fn cgroup_memory(this: &Process) -> Option<(u64, u64)> {
    let number = |file: PathBuf| std::fs::read_to_string(file).ok()?.trim().parse::<u64>().ok();
    let groups = this.cgroups().ok()?;
    let limits = groups.into_iter().flat_map(|group| {
        let (root, limit, used) = if group.hierarchy == 0 {
            ("/sys/fs/cgroup", "memory.max", "memory.current")
        } else if group.controllers.iter().any(|controller| controller == "memory") {
            ("/sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes")
        } else {
            return Vec::new();
        };
        let path = group.pathname.trim_start_matches('/').to_owned();
        let folders = Path::new(&path).ancestors().map(|path| Path::new(root).join(path));
        let of = |folder: PathBuf| {
            let used = number(folder.join(used))?;
            Some((number(folder.join(limit))?, used_without_cache(&folder, used)))
        };
        folders.filter_map(of).collect()
    });
    // Version 1 says "no limit" by a number near the largest one.
    let limited = limits.filter(|(limit, _)| *limit < i64::MAX as u64 / 2);
    limited.min_by_key(|(limit, used)| limit.saturating_sub(*used))
}

/// What a control group has in use, without the file cache, which the kernel drops when memory is short.
fn used_without_cache(folder: &Path, used: u64) -> u64 {
    let statistics = std::fs::read_to_string(folder.join("memory.stat")).unwrap_or_default();
    let of = |name: &str| {
        let line = statistics.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '))?;
        line.trim().parse::<u64>().ok()
    };
    // `total_` in version 1 includes the groups below, as `memory.usage_in_bytes` does.
    used.saturating_sub(of("total_inactive_file").or_else(|| of("inactive_file")).unwrap_or(0))
}

fn shared_memory(this: Option<&Process>) -> Option<SharedMemory> {
    let stat = rustix::fs::statvfs(SHM).ok()?;
    let mount = this.and_then(|this| mount_of(this, Path::new(SHM)));
    let options = mount.as_ref().map(|mount| {
        let all = mount.mount_options.iter().chain(&mount.super_options);
        let mut all: Vec<String> = all
            .map(|(name, value)| value.as_ref().map_or(name.clone(), |value| format!("{name}={value}")))
            .collect();
        all.sort();
        all.dedup();
        all.join(",")
    });
    Some(SharedMemory {
        bytes: stat.f_blocks * stat.f_frsize,
        free: stat.f_bavail * stat.f_frsize,
        file_system: mount.map(|mount| mount.fs_type),
        options,
        is_read_only: stat.f_flag.contains(rustix::fs::StatVfsMountFlags::RDONLY),
        is_writable: rustix::fs::access(SHM, rustix::fs::Access::WRITE_OK | rustix::fs::Access::EXEC_OK)
            .is_ok(),
    })
}

/// The mount that contains a path: the deepest, and of several at one place the last.
fn mount_of(this: &Process, path: &Path) -> Option<MountInfo> {
    let path = path.canonicalize().ok()?;
    let mounts = this.mountinfo().ok()?;
    let containing = mounts.into_iter().filter(|mount| path.starts_with(&mount.mount_point));
    containing.max_by_key(|mount| mount.mount_point.components().count())
}

fn limits() -> BTreeMap<&'static str, Limit> {
    let kinds = [
        ("open files", Resource::Nofile),
        ("locked memory", Resource::Memlock),
        ("address space", Resource::As),
        ("core file", Resource::Core),
    ];
    let limit = |kind| getrlimit(kind);
    kinds
        .into_iter()
        .map(|(name, kind)| (name, Limit { soft: limit(kind).current, hard: limit(kind).maximum }))
        .collect()
}

fn environment() -> BTreeMap<String, String> {
    let all = std::env::vars_os().map(|(name, value)| (name, value.to_string_lossy().into_owned()));
    let text = all.filter_map(|(name, value)| Some((name.into_string().ok()?, value)));
    text.filter(|(name, _)| name.starts_with("SMACLITE_")).collect()
}
