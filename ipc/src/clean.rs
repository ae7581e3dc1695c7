//! The files that killed pools and learners left behind: counting and removing them.

use crate::control::client::running_pools;
use crate::error::remedy_at;
use crate::os::NameLock;
use crate::runtime_dir::RuntimeDir;
use crate::services::{IpcError, open_node};
use std::fs::DirEntry;
use std::path::Path;

/// What [`clean`] did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CleanReport {
    /// Files that were removed.
    pub removed: usize,
    /// Files that remain, because running pools and learners use them.
    pub in_use: usize,
}

/// Why left-over files could not be removed.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum CleanError {
    #[error("{source}{remedy}")]
    Io { source: std::io::Error, remedy: String },
    #[error(transparent)]
    Ipc(#[from] IpcError),
}

/// Removes what killed pools and learners left in the runtime directory and in `/dev/shm`. Running ones are
/// not affected.
///
/// # Errors
/// If files or iceoryx2 cannot be read.
pub fn clean(runtime_dir: &RuntimeDir) -> Result<CleanReport, CleanError> {
    let failed = |source| CleanError::Io { remedy: remedy_at(&source, runtime_dir), source };
    let before = count_files(runtime_dir);
    for name in runtime_dir.stale_names() {
        // The owner of a lock removes the pool's files when it releases the lock; a running pool keeps it.
        drop(NameLock::try_take(runtime_dir, &name).map_err(failed)?);
    }
    runtime_dir.remove_stale().map_err(failed)?;
    if !runtime_dir.shm_dirs().is_empty() {
        // Other processes use the directory: a new node makes iceoryx2 remove the files of the dead ones.
        drop(open_node(runtime_dir, "clean")?);
    }
    let in_use = count_files(runtime_dir);
    Ok(CleanReport { removed: before.saturating_sub(in_use), in_use })
}

/// How many files [`clean`] would remove, at least: of pools that do not run, and of folders in `/dev/shm`
/// that no process uses. Removes nothing.
pub fn left_over_files(runtime_dir: &RuntimeDir) -> usize {
    let running = running_pools(runtime_dir);
    let pools = runtime_dir.stale_names().into_iter().filter(|name| !running.contains(name)).count();
    pools + runtime_dir.unused_shm_dirs().iter().map(|dir| files_in(dir)).sum::<usize>()
}

/// Files in shared memory, and pools with a lock or a socket.
fn count_files(runtime_dir: &RuntimeDir) -> usize {
    runtime_dir.shm_dirs().iter().map(|dir| files_in(dir)).sum::<usize>() + runtime_dir.stale_names().len()
}

fn files_in(dir: &Path) -> usize {
    let entries = std::fs::read_dir(dir).into_iter().flatten().flatten();
    let count = |entry: DirEntry| match entry.file_type() {
        Ok(kind) if kind.is_dir() => files_in(&entry.path()),
        _ => 1,
    };
    entries.map(count).sum()
}
