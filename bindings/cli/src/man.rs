//! `smaclite-pool man`: the help of all commands as man pages.

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
        write_pages(program, &folder).map_err(|error| format!("{}: {error}", folder.display()))?;
        Ok(())
    }
}

/// Writes the pages into the folder when all of them exist: a full disk leaves the folder as it was.
fn write_pages(program: clap::Command, folder: &Path) -> io::Result<()> {
    let is_new = !folder.exists();
    fs::create_dir_all(folder)?;
    let written = tempfile::tempdir_in(folder).and_then(|temporary| {
        clap_mangen::generate_to(program, &temporary)?;
        let pages = fs::read_dir(&temporary)?.collect::<io::Result<Vec<_>>>()?;
        for page in &pages {
            // To the disk before any page of the folder is replaced.
            fs::File::open(page.path())?.sync_all()?;
        }
        pages.iter().try_for_each(|page| fs::rename(page.path(), folder.join(page.file_name())))
    });
    if written.is_err() && is_new {
        let _ = fs::remove_dir(folder); // unless it has files by now
    }
    written
}
