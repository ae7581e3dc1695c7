//! `smaclite-pool clean`: remove what pools and learners that were killed left behind.

use super::{Outcome, place};
use crate::services::enter;
use clap::Args;
use rustix::fs::{FlockOperation, flock};
use std::fs::File;
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
        let before = place.left_overs().len();
        for name in place.pool_names() {
            if lock_is_free(&place.lock(&name)) {
                let _ = std::fs::remove_file(place.socket(&name));
                let _ = std::fs::remove_file(place.lock(&name));
            }
        }
        // Entering and leaving has iceoryx2 look for dead nodes, and removes the rest if nobody else is there.
        drop(enter(&place, "clean")?);
        let after = place.left_overs().len();
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
