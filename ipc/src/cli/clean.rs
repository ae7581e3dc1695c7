//! `smaclite-pool clean`: remove what pools and learners that were killed left behind.

use super::{Outcome, place};
use crate::services::enter;
use crate::supervisor::NameLock;
use clap::Args;

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
        for name in place.names_left() {
            // Whoever holds the lock takes the files away when it lets go; a running pool keeps it.
            drop(NameLock::try_take(&place, &name)?);
        }
        place.tidy()?;
        if !place.left_overs().is_empty() {
            // Others use the place; entering has iceoryx2 look for those of them that died.
            drop(enter(&place, "clean")?);
        }
        let after = place.left_overs().len();
        let removed = before.saturating_sub(after);
        if self.json {
            out!("{}", serde_json::json!({ "removed_files": removed, "files_in_use": after }))?;
        } else {
            out!("left-over files removed: {removed}; files of running pools and learners: {after}")?;
        }
        Ok(())
    }
}
