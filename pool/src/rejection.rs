//! Why a learner's request was refused. The client raises these errors before it sends, and the lane when it
//! receives; the lane's travel to the client as JSON in a frame.

use serde::{Deserialize, Serialize};
use smaclite_engine::Actor;

/// Actions that an error lists.
const MOST_LISTED: usize = 24;

/// A refused request. No environment was stepped or reset.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[allow(missing_docs)] // the messages say it
pub enum Rejection {
    #[error("environment {env}, {actor}: action {action} is not available; available: {}", list(available))]
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

/// The first numbers of a list, and how many follow.
fn list(numbers: &[usize]) -> String {
    let shown = &numbers[..numbers.len().min(MOST_LISTED)];
    match numbers.len() - shown.len() {
        0 => format!("{shown:?}"),
        more => format!("{shown:?} and {more} more"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::MIN_FRAME_BYTES;

    /// A list of 1366 actions did not fit into a frame: the reason was a piece of JSON.
    #[test]
    fn a_list_of_all_actions_of_the_largest_scenario_fits_into_a_frame_and_is_shown_in_part() {
        let rejection = Rejection::UnavailableAction {
            env: 999_999,
            actor: Actor::Agent(359),
            action: i32::MIN,
            available: (1..6 + 360 + 1000).collect(),
        };
        assert!(serde_json::to_vec(&rejection).unwrap().len() <= MIN_FRAME_BYTES);
        let text = rejection.to_string();
        assert!(text.ends_with("22, 23, 24] and 1341 more"), "{text}");
    }
}
