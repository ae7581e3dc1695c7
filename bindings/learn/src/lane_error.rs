//! Why a team cannot play on lanes.

use crate::config::ConfigError;
use smaclite_ipc::{ClientError, ConnectError, StartError};
use smaclite_pool::Autoreset;
use smaclite_scenarios::{Problems, Scenario};
use std::path::Path;

/// A team for every map cannot play the enemies of a scenario.
#[derive(Debug, thiserror::Error)]
#[error(
    "opponent `{0}` is a team for every map, which sees the enemies as its own units: it plays them where \
     both sides have the same units and shields"
)]
pub struct UnequalUnits(String);

/// Checks that a team for every map can play the enemies of a scenario.
pub(crate) fn check_equal_sides(team: &Path, scenario: &Scenario) -> Result<(), UnequalUnits> {
    if scenario.has_equal_sides() { Ok(()) } else { Err(UnequalUnits(team.display().to_string())) }
}

/// Why a team cannot play on lanes.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum LaneError {
    #[error("lane `{lane}` does not serve the field `{field}`; name it among the `--fields` of `serve`")]
    MissingField { lane: String, field: &'static str },
    #[error(
        "lane `{lane}` has autoreset_mode `{given}`, but a team plays with `NextStep`, the default of `serve`"
    )]
    Autoreset { lane: String, given: Autoreset },
    #[error(
        "lane `{lane}` is asynchronous: its batches have {batch_size} of {num_envs} environments; serve it \
         without `--batch-size`"
    )]
    Asynchronous { lane: String, batch_size: usize, num_envs: usize },
    #[error("lane `{lane}` plays {given}, but {name} was expected; they differ in {differences}")]
    OtherScenario { lane: String, given: String, name: String, differences: String },
    #[error("lane `{lane}` has {n_agents} agents and {n_actions} actions; a team can have 65535 of each")]
    TooLarge { lane: String, n_agents: usize, n_actions: usize },
    #[error("the lanes have {given} environments, but the run has {expected}")]
    NumEnvs { given: usize, expected: usize },
    #[error("two maps of the run are called `{name}`; each must have a name of its own")]
    SameName { name: String },
    #[error("the run has {expected} maps, but lanes were given for {given}")]
    Maps { given: usize, expected: usize },
    #[error("the maps have {given:?} environments, but those of the checkpoint {expected:?}")]
    EnvsOfMaps { given: Vec<usize>, expected: Vec<usize> },
    #[error(
        "lane `{lane}` appends {given} last actions to observations, but the run has {expected}; serve it \
         with `--obs-last-actions {expected}`"
    )]
    LastActions { lane: String, given: usize, expected: usize },
    #[error("lane `{lane}` appends agent numbers, which no network reads; serve it without `--obs-agent-id`")]
    AgentId { lane: String },
    #[error(
        "a team can play both sides if they have equal sizes, but in {scenario} the agents are {agents}, and \
         the enemies {enemies}"
    )]
    UnequalSides { scenario: String, agents: String, enemies: String },
    #[error(
        "the team of `{folder}` plays {given}, but the enemies of {scenario}, with {last_actions} own last \
         actions in observations, are {expected}"
    )]
    OtherTeam { folder: String, given: String, scenario: String, last_actions: usize, expected: String },
    #[error(transparent)]
    UnequalUnits(#[from] UnequalUnits),
    #[error("lane `{lane}` is named twice")]
    Twice { lane: String },
    #[error("lane `{lane}` plays sides `{given}`, but the run needs `{expected}`")]
    Sides { lane: String, given: &'static str, expected: &'static str },
    #[error(transparent)]
    Config(#[from] ConfigError),
    #[error("scenario: {0}")]
    Scenario(#[from] Problems),
    #[error(transparent)]
    Start(#[from] StartError),
    #[error(transparent)]
    Connect(#[from] ConnectError),
    #[error(transparent)]
    Client(#[from] ClientError),
}
