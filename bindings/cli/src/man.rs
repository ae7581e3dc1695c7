//! `smaclite-pool man`: the help of all commands as man pages.

use super::{Cli, CommandResult};
use clap::{Args, CommandFactory};
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "\
Examples:
  smaclite-pool man | man -l -
  smaclite-pool man --out ~/.local/share/man/man1")]
pub(super) struct Man {
    /// Write a page per command to this folder, which is created if it does not exist, instead of printing
    /// the page of the program
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
}

impl Man {
    pub(super) fn run(self) -> CommandResult {
        let program = Cli::command().disable_help_subcommand(true); // `help` gets no page
        let Some(folder) = self.out else {
            return Ok(clap_mangen::Man::new(program).render(&mut std::io::stdout())?);
        };
        std::fs::create_dir_all(&folder)
            .and_then(|()| clap_mangen::generate_to(program, &folder))
            .map_err(|error| format!("{}: {error}", folder.display()))?;
        Ok(())
    }
}
