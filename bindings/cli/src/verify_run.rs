//! `smaclite-pool verify-run`: play the recorded evaluations of a run again, and compare every number.

use super::CommandResult;
use crate::number::Threads;
use crate::process::interruption;
use clap::{Args, ValueEnum};
use smaclite_lab::verify;
use smaclite_learn::{FileError, RunDescription, refuse_both, runs_in};
use std::path::{Path, PathBuf};

/// Evaluations that are played again, if not all are to be.
const SAMPLE: usize = 3;

#[derive(Args)]
#[command(after_help = "\
Examples:
  smaclite-pool verify-run runs/2s3z
  smaclite-pool verify-run runs/ten --evaluations all

The weights and the seeds of every evaluation are in the folder of a run, so its numbers can be checked \
to the last bit on a CPU with the same vector instructions (docs/how-to/benchmark.md). Exit status 1 if \
one differs.")]
pub(super) struct VerifyRun {
    /// Folders of runs of `smaclite-pool train --evaluate-every`, or of its --seeds
    #[arg(required = true, value_name = "FOLDER")]
    folders: Vec<PathBuf>,
    /// Which evaluations to play again, besides the final one: three of them, the last one among those; all;
    /// or final, for none
    #[arg(long, value_enum, default_value = "sample")]
    evaluations: Which,
    #[command(flatten)]
    threads: Threads,
}

#[derive(Clone, Copy, ValueEnum)]
enum Which {
    Sample,
    All,
    Final,
}

impl VerifyRun {
    pub(super) fn run(self) -> CommandResult {
        let interrupted = interruption()?;
        for folder in &self.folders {
            for folder in runs_of(folder)? {
                self.verify(&folder, &mut || interrupted())?;
            }
        }
        Ok(())
    }

    fn verify(&self, folder: &Path, interrupted: &mut dyn FnMut() -> bool) -> CommandResult {
        let evaluations = match self.evaluations {
            Which::Sample => SAMPLE,
            Which::All => usize::MAX,
            Which::Final => 0,
        };
        let verified = verify(folder, evaluations, self.threads.number(), interrupted)?;
        let (of_end, missing) = match verified.is_final {
            true => (" and the final one", ""),
            false => ("", "; the run has no final episodes (final.json), which it has when it is complete"),
        };
        out!(
            "{}: {} evaluations{of_end} played again, {} episodes: every return, length and win is \
             equal{missing}",
            folder.display(),
            verified.evaluations,
            verified.episodes
        )?;
        Ok(())
    }
}

/// The run in a folder, or those in its subfolders.
fn runs_of(folder: &Path) -> Result<Vec<PathBuf>, FileError> {
    if !folder.join("run.json").exists() && folder.is_dir() {
        let runs: Vec<PathBuf> = runs_in(folder)?.into_iter().map(|(path, _)| path).collect();
        if !runs.is_empty() {
            return Ok(runs);
        }
    }
    RunDescription::read(folder)?;
    refuse_both(folder)?;
    Ok(vec![folder.to_owned()])
}
