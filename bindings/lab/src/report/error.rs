//! Why a report could not be made.

use smaclite_learn::{FileError, parallel::Interrupted};
use std::path::PathBuf;

/// Why a report could not be made.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum ReportError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error(
        "`{}` has no runs: expected the folder of a run (with run.json or options.json), or one with such \
         folders in it", .0.display()
    )]
    NoRuns(PathBuf),
    #[error(
        "`{}` has no evaluations: expected evaluations.csv, as `smaclite-pool train --evaluate-every N` \
         writes it", .0.display()
    )]
    NoEvaluations(PathBuf),
    #[error(
        "`{}` is not complete: its final episodes (final.json) are missing, or of an earlier end; resume the \
         run until its end, or leave it out", .0.display()
    )]
    Incomplete(PathBuf),
    #[error(
        "`{}` and `{}` are both runs of {algorithm} on {task} with seed {seed}: expected one run per \
         algorithm, task and seed; name another algorithm, as `NAME={}`", first.display(), second.display(),
         second.display()
    )]
    Twice { algorithm: String, task: String, seed: u64, first: PathBuf, second: PathBuf },
    #[error(
        "`{}` and `{}` are runs of {algorithm} on {task}, but were evaluated at other steps, {steps}: \
         expected equal ones; name another algorithm, as `NAME={}`",
        first.display(), second.display(), second.display()
    )]
    OtherSteps { algorithm: String, task: String, first: PathBuf, second: PathBuf, steps: String },
    #[error(
        "`{}` and `{}` play {task}, but not the same battles: their run.json, or options.json, differ in the \
         scenario, the episode limit or the opponents; report them separately",
        first.display(), second.display()
    )]
    OtherBattles { task: String, first: PathBuf, second: PathBuf },
    #[error("{0}\nThe weights of all evaluations play to find out when the team first won")]
    NoTime(FileError),
    #[error("interrupted")]
    Interrupted,
}

impl From<Interrupted> for ReportError {
    fn from(_: Interrupted) -> ReportError {
        ReportError::Interrupted
    }
}
