//! Following environments of a lane step by step, without being their learner: what is needed to play their
//! episodes again, tick by tick.

use crate::client::{ClientError, ConnectError};
use crate::control::client::ControlClient;
use crate::control::protocol::{ControlError, ControlRequest, ControlResponse, LaneDescription};
use crate::lane_scenario::setup_in;
use crate::process_owned::ProcessOwned;
use crate::runtime_dir::RuntimeDir;
use crate::wait_options::WaitOptions;
use smaclite_engine::BattleSetup;
use smaclite_pool::EpisodePart;

/// Follows environments: receives the states in which their episodes begin and their joint actions. The
/// supervisor keeps what was not read, as much as fits its limit; then the oldest episodes are missing.
pub struct Follower {
    connection: ProcessOwned<ControlClient>,
    description: LaneDescription,
    setup: BattleSetup,
}

/// A part of an episode of a followed environment.
#[derive(Clone, Debug, PartialEq)]
pub struct FollowedPart {
    /// The environment.
    pub env_id: usize,
    /// What it did.
    pub part: EpisodePart,
}

impl Follower {
    /// Follows environments of a lane, of the only lane if none is named. Each log begins with the present
    /// state.
    ///
    /// # Errors
    /// If the pool cannot be reached, the lane has no battles, or no such environment, or too many
    /// followers.
    pub fn connect(
        runtime_dir: &RuntimeDir,
        pool: &str,
        lane: Option<&str>,
        env_ids: &[usize],
    ) -> Result<Follower, ConnectError> {
        let request = ControlRequest::Follow { lane: lane.map(str::to_owned), env_ids: env_ids.to_vec() };
        let (connection, response) =
            ControlClient::request(runtime_dir, pool, &request, WaitOptions::for_response())?;
        let (description, setup) = setup_in(response)?;
        Ok(Follower { connection: ProcessOwned::new(connection), description, setup })
    }

    /// The lane.
    pub fn description(&self) -> &LaneDescription {
        &self.description
    }

    /// What its battles are played with.
    pub fn setup(&self) -> &BattleSetup {
        &self.setup
    }

    /// What the environments did since the last call, by environment and in order. The pool has 10 seconds to
    /// answer.
    ///
    /// # Errors
    /// If the pool is gone or does not answer.
    pub fn read(&mut self) -> Result<Vec<FollowedPart>, ClientError> {
        let connection = self.connection.get_mut()?;
        let response = connection.ask(&ControlRequest::ReadEpisodes, WaitOptions::for_response());
        match response.map_err(ClientError::of_socket)? {
            ControlResponse::Episodes { parts } => {
                Ok(parts.into_iter().map(FollowedPart::try_from).collect::<Result<_, _>>()?)
            }
            ControlResponse::Refused(refusal) => Err(refusal.into()),
            other => Err(ControlError::unexpected(&other).into()),
        }
    }
}
