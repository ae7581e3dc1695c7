//! Why a pool could not start.

use crate::control::client::of_process;
use crate::error::{remedy, remedy_at};
use crate::name::NameError;
use crate::os::memory::TooLittleMemory;
use crate::runtime_dir::{RuntimeDir, RuntimeDirError};
use crate::services::IpcError;
use smaclite_engine::MAX_LAST_ACTIONS;
use smaclite_pool::{LaneSettingsError, PoolStartError};
use smaclite_scenarios::Problems;

/// Most threads of a pool.
pub(super) const MAX_THREADS: usize = 1024;

/// Why a supervisor did not start. Nothing of it is left.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum StartError {
    #[error("pool name: {0}")]
    Name(#[from] NameError),
    #[error("a pool named `{pool}` runs already{}; choose another name or stop it", of_process(*pid))]
    NameTaken { pool: String, pid: Option<u32> },
    #[error("threads must be between 1 and {MAX_THREADS}, got {0}")]
    Threads(usize),
    #[error("a pool needs at least one lane")]
    NoLanes,
    #[error("lane `{lane}`: {source}")]
    Lane { lane: String, source: LaneConfigError },
    #[error(transparent)]
    RuntimeDir(#[from] RuntimeDirError),
    #[error(transparent)]
    Memory(#[from] TooLittleMemory),
    #[error(transparent)]
    Ipc(#[from] IpcError),
    #[error("{error}{}", thread_remedy(.0), error = .0)]
    Pool(#[from] PoolStartError),
    #[error("the start was interrupted")]
    Interrupted,
    #[error("{doing}: {source}{remedy}")]
    System { doing: String, source: std::io::Error, remedy: String },
}

/// What is wrong with the configuration of a lane.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum LaneConfigError {
    #[error(transparent)]
    Name(#[from] NameError),
    #[error("two lanes have this name; name one differently (NAME=SCENARIO:N)")]
    SameName,
    #[error(transparent)]
    Settings(#[from] LaneSettingsError),
    #[error("scenario: {0}")]
    Scenario(#[from] Problems),
    #[error(transparent)]
    Opponents(#[from] smaclite_engine::OpponentsError),
    #[error("a team plays the enemies of mirrored sides, `Sides::Mirrored`; set the setup's sides to that")]
    TeamSides,
    #[error("the team observes {0} of its own last actions; expected at most {MAX_LAST_ACTIONS}")]
    TeamLastActions(usize),
    #[error("max_held_batches must be between 2 and 1024, got {0}")]
    MaxHeldBatches(usize),
    #[error("spectators must be between 0 and 64, got {0}")]
    Spectators(usize),
}

/// The remedy for a thread that was refused.
fn thread_remedy(error: &PoolStartError) -> String {
    match error {
        PoolStartError::Thread(source) => remedy(source),
        PoolStartError::Transport(_) => String::new(),
    }
}

/// Adds what was being done to an error of the operating system.
pub(super) fn system(doing: impl Into<String>) -> impl FnOnce(std::io::Error) -> StartError {
    move |source| StartError::System { doing: doing.into(), remedy: remedy(&source), source }
}

/// As [`system`], for a file in the runtime folder.
pub(super) fn at(
    runtime_dir: &RuntimeDir,
    doing: impl Into<String>,
) -> impl FnOnce(std::io::Error) -> StartError {
    move |source| StartError::System { doing: doing.into(), remedy: remedy_at(&source, runtime_dir), source }
}
