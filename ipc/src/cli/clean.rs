//! `smaclite-pool clean`: remove what pools and learners that were killed left behind.

use super::{Outcome, place};
use crate::Place;
use crate::services::{Ipc, node};
use clap::Args;
use iceoryx2::prelude::{CallbackProgression, Node, NodeState};
use rustix::fs::{FlockOperation, flock};
use std::fs::File;
use std::path::{Path, PathBuf};

#[derive(Args)]
pub(super) struct Clean {
    /// As JSON
    #[arg(long)]
    json: bool,
}

impl Clean {
    pub(super) fn run(self) -> Outcome {
        let place = place()?;
        let before = left_overs(&place).len();
        for name in place.pool_names() {
            if lock_is_free(&place.lock(&name)) {
                let _ = std::fs::remove_file(place.socket(&name));
                let _ = std::fs::remove_file(place.lock(&name));
            }
        }
        // Creating and dropping a node has iceoryx2 look for dead ones and take their files away.
        drop(node(&place, "clean")?);
        let alone = living_nodes(&place) == 0;
        if alone {
            // Nobody is left who could use what its clean-up did not recognise.
            left_overs(&place).iter().for_each(|file| drop(std::fs::remove_file(file)));
        }
        let after = left_overs(&place).len();
        let removed = before.saturating_sub(after);
        if self.json {
            println!("{}", serde_json::json!({ "removed_files": removed, "files_in_use": after }));
        } else {
            println!("removed {removed} files; {after} belong to running pools and learners");
        }
        Ok(())
    }
}

fn lock_is_free(path: &Path) -> bool {
    File::open(path).map_or(true, |file| flock(&file, FlockOperation::NonBlockingLockShared).is_ok())
}

fn living_nodes(place: &Place) -> usize {
    let mut living = 0;
    let listed = Node::<Ipc>::list(&place.iceoryx(), |state| {
        living += usize::from(!matches!(state, NodeState::Dead(_)));
        CallbackProgression::Continue
    });
    if listed.is_ok() { living } else { usize::MAX }
}

/// Files in `/dev/shm` and below the root, but for the folders and locks themselves.
fn left_overs(place: &Place) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let shm = std::fs::read_dir("/dev/shm").into_iter().flatten().flatten().map(|entry| entry.path());
    let ours = |path: &PathBuf| {
        path.file_name().and_then(|n| n.to_str()).is_some_and(|name| name.starts_with(place.shm_prefix()))
    };
    files.extend(shm.filter(ours));
    collect_files(place.root(), &mut files);
    files
}

fn collect_files(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            collect_files(&entry.path(), files);
        } else {
            files.push(entry.path());
        }
    }
}
