//! Errors of iceoryx2. Its own texts say little ("InternalError"), so each is kept as the source of an error
//! that says what was being done and, where it can be measured, which shortage is its likely cause.

use crate::runtime_dir::RuntimeDir;
use rustix::fs::{StatVfsMountFlags, statvfs};
use rustix::io::Errno;
use rustix::process::{Resource, getrlimit};
use std::error::Error;
use std::fmt::Display;

/// Fewer free file descriptors than this were too few: iceoryx2 closes what it opened before it reports a
/// failure.
const FEW_DESCRIPTORS: u64 = 16;

/// Fewer bytes than one segment or file of iceoryx2 needs.
const FEW_BYTES: u64 = 64 << 10;

/// An error of iceoryx2, with what was being done and its likely cause.
#[derive(Debug, thiserror::Error)]
#[error("{doing} failed: {source}; {advice}")]
pub struct IpcError {
    doing: String,
    source: Box<dyn Error + Send + Sync>,
    advice: String,
}

/// Adds what was being done to an error of iceoryx2.
pub(crate) fn doing<E: Error + Send + Sync + 'static>(
    doing: impl Into<String>,
) -> impl FnOnce(E) -> IpcError {
    move |source| {
        let shortage = few_descriptors()
            .or_else(|| full("/dev/shm", "give it more (`mount -o remount,size=...`)"))
            .or_else(limited_files);
        let otherwise = || "set IOX2_LOG_LEVEL=debug for the log of iceoryx2".to_owned();
        IpcError { doing: doing.into(), source: Box::new(source), advice: shortage.unwrap_or_else(otherwise) }
    }
}

impl IpcError {
    /// An error that iceoryx2 does not name.
    pub(crate) fn new(doing: impl Into<String>, what: &str, advice: &str) -> IpcError {
        IpcError { doing: doing.into(), source: what.into(), advice: advice.to_owned() }
    }

    /// The same error, for an operation that a full disk of the runtime folder can make fail.
    pub(crate) fn at(self, runtime_dir: &RuntimeDir) -> IpcError {
        let full =
            full(runtime_dir.root().display(), "make room there or set SMACLITE_POOL_ROOT to another folder");
        IpcError { advice: full.unwrap_or(self.advice), ..self }
    }
}

fn few_descriptors() -> Option<String> {
    let limit = getrlimit(Resource::Nofile).current?;
    // The listing itself uses a file descriptor.
    let open = std::fs::read_dir("/proc/self/fd").map_or(limit, |entries| entries.count() as u64 - 1);
    (open + FEW_DESCRIPTORS > limit).then(|| {
        format!("{open} file descriptors are open, and the limit is {limit}: raise it (`ulimit -n`)")
    })
}

/// The remedy for an error of the operating system, as the end of a message; empty if there is none.
pub(crate) fn remedy(error: &std::io::Error) -> String {
    let is = |errno: Errno| error.raw_os_error() == Some(errno.raw_os_error());
    // Errors to which a path was added have no number any more.
    let text = error.to_string();
    if is(Errno::MFILE) || text.contains("Too many open files") {
        format!("; {}", few_descriptors().unwrap_or_else(|| "raise the limit (`ulimit -n`)".to_owned()))
    } else if is(Errno::FBIG) || text.contains("File too large") {
        limited_files().map_or(String::new(), |limit| format!("; {limit}"))
    } else {
        String::new()
    }
}

/// A limit on the size of files counts for shared memory too.
fn limited_files() -> Option<String> {
    let limit = getrlimit(Resource::Fsize).current?;
    Some(format!("this process may write files of at most {limit} bytes: `ulimit -f unlimited`"))
}

fn full(folder: impl Display, remedy: &str) -> Option<String> {
    let stat = statvfs(folder.to_string()).ok()?;
    let free = stat.f_bavail * stat.f_frsize;
    if stat.f_flag.contains(StatVfsMountFlags::RDONLY) {
        Some(format!("{folder} is on a read-only file system: {remedy}"))
    } else if free < FEW_BYTES {
        Some(format!("{folder} has {free} bytes free: {remedy}"))
    } else if stat.f_files > 0 && stat.f_favail == 0 {
        Some(format!("{folder} has no room for another file: {remedy}"))
    } else {
        None
    }
}
