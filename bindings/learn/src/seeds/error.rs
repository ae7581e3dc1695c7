//! Why runs of several seeds could not begin or continue.

use crate::tensors::FileError;
use crate::training::TrainError;
use std::path::PathBuf;

/// Why runs of several seeds could not begin or continue.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum SeedsError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    Train(#[from] TrainError),
    #[error(
        "`{}` is no run of `train --seeds`, which would be in a folder of the name `seed-{seed}`; continue \
         runs that were not trained together one by one", run.display()
    )]
    OtherName { run: PathBuf, seed: u64 },
    #[error(
        "`{}` differs from `{}` in {differences}, but runs of one `train --seeds` differ in their seeds \
         alone; continue runs that were not trained together one by one", second.display(), first.display()
    )]
    Differ { first: PathBuf, second: PathBuf, differences: String },
    #[error(
        "`{}` and `{}` are runs of {} and of {} steps; --steps says how many all of them are to make",
        first.display(), second.display(), steps[0], steps[1]
    )]
    OtherSteps { first: PathBuf, second: PathBuf, steps: [u64; 2] },
    #[error(
        "`{}` has seeds from {first} to {last}: --seeds must be at least {}, got {count}",
        folder.display(), (last - first).saturating_add(1)
    )]
    TooFew { folder: PathBuf, first: u64, last: u64, count: u64 },
    #[error("the last of {count} seeds from {seed} on would be above {}", u64::MAX)]
    TooHigh { seed: u64, count: u64 },
    #[error("the number of seeds must be at least 1, got 0")]
    None,
    #[error(
        "the run with seed {seed} could not begin: {source}\n`train --resume {} --seeds {count}` begins the \
         missing runs and continues the others", folder.display()
    )]
    NotBegun { seed: u64, folder: PathBuf, count: u64, source: Box<TrainError> },
    #[error(
        "interrupted when {begun} of {count} seeds had begun; `train --resume {} --seeds {count}` begins the \
         missing runs and continues the others", folder.display()
    )]
    Interrupted { folder: PathBuf, begun: usize, count: u64 },
}
