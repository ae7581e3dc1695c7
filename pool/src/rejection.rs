//! Why a learner's request was refused. The client raises these errors before it sends, and the lane when it
//! receives; the lane's travel to the client as JSON in a frame.

use serde::{Deserialize, Serialize};
use smaclite_engine::Actor;

/// A refused request. No environment was stepped or reset.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[allow(missing_docs)] // the messages say it
pub enum Rejection {
    #[error("environment {env}, {actor}: action {action} is not available; available: {available:?}")]
    UnavailableAction { env: usize, actor: Actor, action: i32, available: Vec<usize> },
    #[error(
        "environment {env} does not exist; this lane has environments 0 to {last}",
        last = num_envs.saturating_sub(1)
    )]
    UnknownEnv { env: i64, num_envs: usize },
    #[error("a request must name at least one environment, got none")]
    NoEnv,
    #[error("environment {env} appears twice in one request")]
    DuplicateEnv { env: usize },
    #[error("environment {env} still works on an earlier request; receive its result first")]
    BusyEnv { env: usize },
    #[error("environment {env} has finished its episode and autoreset is disabled; reset it first")]
    FinishedEnv { env: usize },
    #[error("a synchronous lane steps all {expected} environments at once, got {given}")]
    IncompleteBatch { given: usize, expected: usize },
    #[error("no environment was reset since this learner attached; call reset first, for all of them")]
    NotReset,
    #[error("environment {env} cannot be restored: {why}")]
    BadSnapshot { env: usize, why: String },
    #[error("environment {env} cannot begin with this level: {why}")]
    BadLevel { env: usize, why: String },
    #[error("malformed request: {what}")]
    Malformed { what: String },
    #[error("the lane failed and is out of service: {text}")]
    LaneFailed { text: String },
}
