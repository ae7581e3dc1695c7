//! Why a learner's request was refused. The client raises these errors before it sends, and the lane when it
//! receives; the lane's travel to the client as JSON in a frame.

use serde::{Deserialize, Serialize};
use smaclite_engine::{Actor, Faction};

/// A refused request. No environment was stepped or reset.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[allow(missing_docs)] // the messages say it
pub enum Rejection {
    #[error(
        "environment {env}, {actor}: action {action} is not available; available: {available:?}",
        actor = actor_name(*actor, *has_sides)
    )]
    UnavailableAction {
        env: usize,
        actor: Actor,
        action: i32,
        available: Vec<usize>,
        /// The lane has a learner for each side. Both get this error, and call their own units agents.
        #[serde(default)]
        has_sides: bool,
    },
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
    #[error("no environment was reset since this learner attached; call reset first")]
    NotReset,
    #[error("environment {env} cannot be restored: {why}")]
    BadSnapshot { env: usize, why: String },
    #[error("environment {env} cannot begin with this level: {why}")]
    BadLevel { env: usize, why: String },
    #[error(
        "the two learners of the lane sent different requests, number {number}: both must step, or both must \
         reset the same environments; reset both now"
    )]
    DifferentRequests { number: u64 },
    #[error("the learner of the {} left; close and connect again to go on", side_name(*side))]
    OtherLearnerLeft { side: Faction },
    #[error(
        "{waiting} requests of the learner of the {} already wait for those of the other learner; receive a \
         result first",
        side_name(*side)
    )]
    TooFarAhead { side: Faction, waiting: usize },
    #[error("malformed request: {what}")]
    Malformed { what: String },
    #[error("the lane failed and is out of service: {text}")]
    LaneFailed { text: String },
}

fn actor_name(actor: Actor, has_sides: bool) -> String {
    match actor {
        Actor::Agent(unit) if has_sides => format!("agent {unit} of the learner of the allies"),
        Actor::Enemy(unit) if has_sides => format!("agent {unit} of the learner of the enemies"),
        actor => actor.to_string(),
    }
}

/// As users name the side.
pub fn side_name(side: Faction) -> &'static str {
    match side {
        Faction::Ally => "allies",
        Faction::Enemy => "enemies",
    }
}
