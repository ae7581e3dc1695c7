//! Errors of iceoryx2. Its own texts say little ("InternalError"), so each is kept as the source of an error
//! that says what was being done and, where it can be measured, which shortage is its likely cause.

use crate::os::shortage;
use crate::runtime_dir::RuntimeDir;
use std::error::Error;
use std::io::ErrorKind;

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
    move |source| IpcError { doing: doing.into(), source: Box::new(source), advice: cause() }
}

/// The likely cause of an error of iceoryx2 that just happened on this thread, and its remedy.
pub(crate) fn cause() -> String {
    shortage::likely().unwrap_or_else(|| "set IOX2_LOG_LEVEL=debug for the log of iceoryx2".to_owned())
}

impl IpcError {
    /// An error that iceoryx2 does not name.
    pub(crate) fn new(doing: impl Into<String>, what: &str, advice: &str) -> IpcError {
        IpcError { doing: doing.into(), source: what.into(), advice: advice.to_owned() }
    }

    /// The same error, for an operation that a full disk of the runtime folder can make fail.
    pub(crate) fn at(self, runtime_dir: &RuntimeDir) -> IpcError {
        IpcError { advice: full(runtime_dir).unwrap_or(self.advice), ..self }
    }
}

/// That the disk of the runtime folder is full, and the remedy, if it is.
fn full(runtime_dir: &RuntimeDir) -> Option<String> {
    let remedy = "make room there or set SMACLITE_POOL_ROOT to another folder";
    shortage::full(runtime_dir.root().display(), remedy)
}

/// As [`remedy`], for a file in the runtime folder.
pub(crate) fn remedy_at(error: &std::io::Error, runtime_dir: &RuntimeDir) -> String {
    if let Some(full) = full(runtime_dir) {
        return format!("; {full}");
    }
    if error.kind() == ErrorKind::PermissionDenied {
        let root = runtime_dir.root().display();
        return format!("; this user must be able to write to {root}: `chmod u+rwx {root}`");
    }
    remedy(error)
}

/// The remedy for an error of the operating system, as the end of a message; empty if there is none.
pub(crate) fn remedy(error: &std::io::Error) -> String {
    shortage::of(error).map_or(String::new(), |shortage| format!("; {shortage}"))
}
