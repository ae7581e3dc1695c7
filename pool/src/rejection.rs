//! Why a request of a learner was refused. The same type is raised by the client before it sends and by the lane
//! when it receives, and travels from the one to the other as the text of an error frame.

use serde::{Deserialize, Serialize};

/// A refused request. Nothing was stepped.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[allow(missing_docs)] // the messages say it
pub enum Rejection {
    #[error("environment {env}, agent {agent}: action {action} is not available; available: {available:?}")]
    UnavailableAction { env: usize, agent: usize, action: i32, available: Vec<usize> },
    #[error("environment {env} does not exist; this lane has environments 0 to {last}", last = num_envs.saturating_sub(1))]
    UnknownEnv { env: i64, num_envs: usize },
    #[error("no environment was chosen; expected at least one")]
    NoEnv,
    #[error("environment {env} is given twice in one request")]
    DuplicateEnv { env: usize },
    #[error("environment {env} is still working on an earlier request; receive its result first")]
    BusyEnv { env: usize },
    #[error("environment {env} has finished its episode and autoreset is disabled; reset it first")]
    FinishedEnv { env: usize },
    #[error("{given} environments were given; a synchronous lane takes all {expected} at once")]
    IncompleteBatch { given: usize, expected: usize },
    #[error("nothing was reset since this learner attached; call reset first")]
    NotReset,
    #[error("malformed request: {what}")]
    Malformed { what: String },
    #[error("the lane failed and serves no more: {text}")]
    LaneFailed { text: String },
}
