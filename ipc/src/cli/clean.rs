//! `smaclite-pool clean`: remove what pools and learners that were killed left behind.

use super::{Outcome, runtime_dir};
use crate::RuntimeDir;
use crate::services::open_node;
use crate::supervisor::NameLock;
use clap::Args;
use std::fs::DirEntry;
use std::path::Path;

#[derive(Args)]
pub(super) struct Clean {
    /// As JSON
    #[arg(long)]
    json: bool,
}

impl Clean {
    pub(super) fn run(self) -> Outcome {
        let runtime_dir = runtime_dir()?;
        let before = files_left(&runtime_dir);
        for name in runtime_dir.stale_names() {
            // Whoever holds the lock takes the files away when it lets go; a running pool keeps it.
            drop(NameLock::try_take(&runtime_dir, &name)?);
        }
        runtime_dir.remove_stale()?;
        if !runtime_dir.shm_dirs().is_empty() {
            // Others use the place; entering has iceoryx2 look for those of them that died.
            drop(open_node(&runtime_dir, "clean")?);
        }
        let after = files_left(&runtime_dir);
        let removed = before.saturating_sub(after);
        if self.json {
            out!("{}", serde_json::json!({ "removed_files": removed, "files_in_use": after }))?;
        } else {
            out!("left-over files removed: {removed}; files of running pools and learners: {after}")?;
        }
        Ok(())
    }
}

/// Files in shared memory, and names with a lock or a socket.
fn files_left(runtime_dir: &RuntimeDir) -> usize {
    runtime_dir.shm_dirs().iter().map(|folder| files_in(folder)).sum::<usize>()
        + runtime_dir.stale_names().len()
}

fn files_in(folder: &Path) -> usize {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let count = |entry: DirEntry| match entry.file_type() {
        Ok(kind) if kind.is_dir() => files_in(&entry.path()),
        _ => 1,
    };
    entries.map(count).sum()
}
