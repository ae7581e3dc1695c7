//! `smaclite-pool edit`: the scenario editor, a page in the browser.

use crate::web::editor::{Editor, Start};
use crate::web::{ServeOptions, serve};
use crate::{CommandResult, completions};
use clap::Args;

#[derive(Args)]
#[command(after_help = "\
Examples:
    smaclite-pool edit my_scenario.json --open   a file; if it does not exist, `Save` creates it
    smaclite-pool edit 2s3z                      begin with a standard scenario, which is saved as a download

The page writes FILE and its unit files, which must be in the folder of FILE, and no other files.")]
pub(super) struct Edit {
    /// A scenario file, or a standard scenario to begin with [default: a new scenario]
    #[arg(value_name = "FILE", add = completions::scenario())]
    file: Option<String>,
    #[command(flatten)]
    serve: ServeOptions,
}

impl Edit {
    pub(super) fn run(self) -> CommandResult {
        let start = self.file.as_deref().map_or(Ok(Start::New), Start::of)?;
        serve(&self.serve, Editor::new(start))
    }
}
