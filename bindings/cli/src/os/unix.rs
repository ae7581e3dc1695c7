//! Linux and macOS.

use rustix::process::{Pid, Resource, Rlimit, Signal, getrlimit, kill_process, setrlimit};
use signal_hook::consts::{SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::iterator::Signals;
use std::fs::OpenOptions;
use std::io::Result;
use std::os::fd::AsFd;
use std::os::unix::fs::OpenOptionsExt;
use std::process::Child;
use std::sync::Arc;
use tokio::signal::unix::{SignalKind, signal};

/// Raises the limit on file descriptors as far as this user may. The low limit that shells set is for
/// programs that call `select`, which this one does not and the process of a learner may, so the library
/// leaves it alone.
pub(crate) fn use_all_descriptors() {
    let limit = getrlimit(Resource::Nofile);
    // If it is refused, the limit stays, and an error names it where it is too low.
    let _ = setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit });
}

/// A limit on the size of files (`ulimit -f`) makes writing fail with an error, instead of ending the program
/// without a word by SIGXFSZ.
pub(crate) fn report_large_files() {
    // Any handler does; nothing reads the flag. If the system refuses it, the signal ends the program.
    let _ = signal_hook::flag::register(SIGXFSZ, Arc::default());
}

/// SIGINT and SIGTERM, which no longer end the program.
pub(crate) struct StopSignals(Signals);

impl StopSignals {
    pub fn new() -> Result<StopSignals> {
        Ok(StopSignals(Signals::new([SIGINT, SIGTERM])?))
    }

    /// Whether one has come.
    pub fn has_come(&mut self) -> bool {
        self.0.pending().next().is_some()
    }

    /// Blocks until one comes.
    pub fn wait(&mut self) {
        self.0.forever().next();
    }
}

/// Ends when SIGINT or SIGTERM comes, which no longer end the program once this was called.
pub(crate) fn stopped() -> Result<impl Future<Output = ()>> {
    let (mut interrupted, mut terminated) =
        (signal(SignalKind::interrupt())?, signal(SignalKind::terminate())?);
    Ok(async move {
        tokio::select! {
            _ = interrupted.recv() => {}
            _ = terminated.recv() => {}
        }
    })
}

/// Asks a process to end.
pub(crate) fn end(child: &mut Child) {
    let _ = kill_process(Pid::from_child(child), Signal::TERM);
}

/// To write a file that no other user can read.
pub(crate) fn private_file() -> OpenOptions {
    let mut options = OpenOptions::new();
    options.write(true).mode(0o600);
    options
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
