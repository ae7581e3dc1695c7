//! `smaclite-pool clean`: remove the files that killed pools and learners left behind.

use super::{CommandResult, runtime_dir};
use clap::Args;
use smaclite_ipc::CleanReport;

#[derive(Args)]
pub(super) struct Clean {
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl Clean {
    pub(super) fn run(self) -> CommandResult {
        let CleanReport { removed, in_use } = smaclite_ipc::clean(&runtime_dir()?)?;
        if self.json {
            out!("{}", serde_json::json!({ "removed_files": removed, "files_in_use": in_use }))?;
        } else {
            out!(
                "removed {removed} left-over files; {in_use} files are in use by running pools and learners"
            )?;
        }
        Ok(())
    }
}
