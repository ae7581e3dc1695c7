//! `smaclite-pool clean`: remove what pools and learners that were killed left behind.

use super::{Outcome, place};
use crate::Place;
use crate::services::enter;
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
        let place = place()?;
        let before = files_left(&place);
        for name in place.names_left() {
            // Whoever holds the lock takes the files away when it lets go; a running pool keeps it.
            drop(NameLock::try_take(&place, &name)?);
        }
        place.tidy()?;
        if !place.shm_folders().is_empty() {
            // Others use the place; entering has iceoryx2 look for those of them that died.
            drop(enter(&place, "clean")?);
        }
        let after = files_left(&place);
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
fn files_left(place: &Place) -> usize {
    place.shm_folders().iter().map(|folder| files_in(folder)).sum::<usize>() + place.names_left().len()
}

fn files_in(folder: &Path) -> usize {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let count = |entry: DirEntry| match entry.file_type() {
        Ok(kind) if kind.is_dir() => files_in(&entry.path()),
        _ => 1,
    };
    entries.map(count).sum()
}
