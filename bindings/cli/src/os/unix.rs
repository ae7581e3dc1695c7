//! Linux and macOS.

use rustix::process::{Pid, Resource, Rlimit, Signal, getrlimit, kill_process, setrlimit};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use std::io::Result;
use std::os::fd::AsFd;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Raises the limit on file descriptors as far as this user may. The low limit that shells set is for
/// programs that call `select`, which this one does not and the process of a learner may, so the library
/// leaves it alone.
pub(crate) fn use_all_descriptors() {
    let limit = getrlimit(Resource::Nofile);
    // If it is refused, the limit stays, and an error names it where it is too low.
    let _ = setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit });
}

/// A limit on the size of files (`ulimit -f`) makes writing fail with an error, instead of ending the program
/// by SIGXFSZ, which says nothing.
pub(crate) fn report_large_files() {
    // Any handler does; nothing reads the flag. If the system refuses it, the signal ends the program.
    let _ = signal_hook::flag::register(SIGXFSZ, Arc::default());
}

/// The signals that ask a program to end: Ctrl-C, `kill`, and the terminal that was closed, unless the
/// program is to outlive that (`nohup`).
pub(crate) fn stop_signals() -> impl Iterator<Item = i32> {
    [SIGINT, SIGTERM].into_iter().chain((!outlives_terminal()).then_some(SIGHUP))
}

/// Whether SIGHUP is ignored. Where the system does not say, it keeps the meaning that it has.
fn outlives_terminal() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    ignored.is_none_or(|mask| mask & 1 << (SIGHUP - 1) != 0)
}

/// The standard input of a second process: none.
pub(crate) fn second_input() -> Stdio {
    Stdio::null()
}

/// Ends this process, by SIGTERM, when its parent ends, if that is still the one of this id.
#[cfg(target_os = "linux")]
pub(crate) fn end_with_parent(parent: u32, _ended: &AtomicBool) {
    let is_parent = || {
        rustix::process::getppid().is_some_and(|id| u32::try_from(id.as_raw_nonzero().get()) == Ok(parent))
    };
    if is_parent() {
        // If it is refused, the parent has to end this process, as it does unless it is killed.
        let _ = rustix::process::set_parent_process_death_signal(Some(Signal::TERM));
        if !is_parent() {
            let _ = kill_process(rustix::process::getpid(), Signal::TERM); // it ended meanwhile
        }
    }
}

/// The system has no signal for it.
#[cfg(not(target_os = "linux"))]
pub(crate) fn end_with_parent(_parent: u32, _ended: &AtomicBool) {}

/// Becomes another program, which gets the signals of this one; returns only if that cannot be started.
pub(crate) fn hand_over(command: &mut Command) -> Result<ExitStatus> {
    Err(command.exec())
}

/// Asks a process to end.
pub(crate) fn end(child: &mut Child) {
    let _ = kill_process(Pid::from_child(child), Signal::TERM);
}

/// Another descriptor of a connection.
pub(crate) fn clone_of(stream: &tokio::net::TcpStream) -> Result<std::net::TcpStream> {
    Ok(std::net::TcpStream::from(stream.as_fd().try_clone_to_owned()?))
}

/// The system, its release and the machine.
pub(crate) fn kernel() -> Option<String> {
    let uname = rustix::system::uname();
    let [system, release, machine] = [uname.sysname(), uname.release(), uname.machine()];
    Some([system, release, machine].map(|part| part.to_string_lossy()).join(" "))
}

/// The limits of this process on open files and on address space.
pub(crate) fn limits() -> [Option<String>; 2] {
    let limit =
        |kind| getrlimit(kind).current.map_or_else(|| "unlimited".to_owned(), |limit| limit.to_string());
    [Some(limit(Resource::Nofile)), Some(limit(Resource::As))]
}

/// The bytes of a file system, and how many of them are free.
pub(crate) fn room(folder: &str) -> Option<[u64; 2]> {
    let stat = rustix::fs::statvfs(folder).ok()?;
    Some([stat.f_blocks, stat.f_bavail].map(|blocks| blocks * stat.f_frsize))
}
