//! Errors of recording, reading and expanding datasets.

use super::quality::QualityError;
use smaclite_engine::IllegalAction;
use smaclite_learn::FileError;
use smaclite_scenarios::Problems;
use smaclite_units::file::shown_reason;
use std::io;

/// Why a dataset cannot be recorded, read or expanded. Episodes and steps are numbered from 0.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum DatasetError {
    #[error("{file}: {error}")]
    Io { file: String, error: io::Error },
    #[error("{file}: expected a dataset of `smaclite-pool dataset record`: {}", shown_reason(reason))]
    NotADataset { file: String, reason: String },
    #[error("{file}: `version` must be {supported}, got {given}; it was written by {program}")]
    Version { file: String, given: u64, supported: u64, program: String },
    #[error("{file}: `{key}` must be {expected}, got {given}")]
    Invalid { file: String, key: String, expected: String, given: String },
    #[error("{file}: episode {episode}, step {step}: {error}; the dataset was recorded by {program}")]
    IllegalAction { file: String, episode: usize, step: usize, error: IllegalAction, program: String },
    #[error(
        "{file}: episode {episode} {recorded} as recorded by {program}, but this version plays it otherwise: \
         {played} after step {step}"
    )]
    Diverged {
        file: String,
        episode: usize,
        step: usize,
        recorded: String,
        played: &'static str,
        program: String,
    },
    #[error(
        "{file}: array `{array}` has the hash {played}, but {recorded} as recorded by {program}: this \
         version plays the episodes otherwise, or the file was changed"
    )]
    OtherBits { file: String, array: &'static str, recorded: String, played: String, program: String },
    #[error("{folder}: exists; the arrays must be written to a new folder")]
    FolderExists { folder: String },
    #[error("a dataset needs at least one step or episode, got 0")]
    Nothing,
    #[error("a dataset needs battles that end: the scenario or the run must have an episode limit")]
    NoLimit,
    #[error("a dataset has the actions of the agents only, but in this run joint actions play both sides")]
    BothSides,
    #[error(
        "the policy {policy} reads the types of units in states, but these do not tell apart the types that \
         each episode draws: give each a number (`num_unit_types` and `unit_type_ids`)"
    )]
    EqualTypes { policy: &'static str },
    #[error("the policy {policy} reads the units of states, but `obs_instead_of_state` of `smacv2` is true")]
    NoUnits { policy: &'static str },
    #[error("a dataset must have at most {max} steps; record fewer")]
    TooManySteps { max: usize },
    #[error("a dataset must have at most {max} policies, got {given} evaluations")]
    TooManyPolicies { max: usize, given: usize },
    #[error(
        "the arrays need {bytes} bytes of memory, more than there is; expand fewer of them, or to a folder, \
         whose files NumPy maps"
    )]
    Memory { bytes: usize },
    #[error("scenario: {0}")]
    Scenario(#[from] Problems),
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    Quality(#[from] QualityError),
    #[error("interrupted")]
    Interrupted,
}
