//! `smaclite-pool man`: the help of all commands as man pages.

use super::files::write_files;
use super::{Cli, CommandResult};
use clap::{Args, CommandFactory};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

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
            return Ok(clap_mangen::Man::new(program).render(&mut crate::output::Output)?);
        };
        write_pages(program, &folder)
    }
}

/// Writes the pages when all of them exist: a full disk changes no page in the folder.
fn write_pages(program: clap::Command, folder: &Path) -> CommandResult {
    let made = tempfile::tempdir()?;
    clap_mangen::generate_to(program, &made)?;
    let read = |page: io::Result<fs::DirEntry>| {
        let page = page?;
        Ok((page.file_name(), fs::read(page.path())?))
    };
    let pages = fs::read_dir(&made)?.map(read).collect::<io::Result<Vec<_>>>()?;
    fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    write_files(folder, &pages)
}
