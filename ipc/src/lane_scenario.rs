//! What the battles of a lane are played with, as its pool says.

use crate::client::ConnectError;
use crate::control::client::ControlClient;
use crate::control::protocol::{ControlError, ControlRequest, ControlResponse, LaneDescription};
use crate::runtime_dir::RuntimeDir;
use crate::wait_options::WaitOptions;
use smaclite_engine::{BattleSetup, Sides};

/// A lane, the only one if none is named, and what its battles are played with. The episode limit is a number
/// or none.
///
/// # Errors
/// If the pool cannot be reached, or has no such lane.
pub fn lane_scenario(
    runtime_dir: &RuntimeDir,
    pool: &str,
    lane: Option<&str>,
    wait: WaitOptions<'_>,
) -> Result<(LaneDescription, BattleSetup), ConnectError> {
    let request = ControlRequest::Scenario { lane: lane.map(str::to_owned) };
    let (_, response) = ControlClient::request(runtime_dir, pool, &request, wait)?;
    Ok(setup_in(response)?)
}

/// The lane and its setup in the response to [`ControlRequest::Scenario`] or [`ControlRequest::Follow`].
pub(crate) fn setup_in(response: ControlResponse) -> Result<(LaneDescription, BattleSetup), ControlError> {
    match response {
        ControlResponse::Scenario { lane, files } => {
            let rules = lane.rules.parse().map_err(|error| ControlError::Malformed {
                what: format!("rules of lane `{}`: {error}", lane.lane),
            })?;
            let (episode_limit, opponents) = (lane.episode_limit.into(), lane.opponents.clone());
            // Its battles have both sides if a team plays one; to followers, the actions are of both.
            let sides = if lane.opponent_team.is_some() { Sides::Mirrored } else { lane.sides };
            let setup = BattleSetup { files: *files, rules, episode_limit, opponents, sides };
            Ok((*lane, setup))
        }
        ControlResponse::Refused(refusal) => Err(refusal),
        other => Err(ControlError::unexpected(&other)),
    }
}
