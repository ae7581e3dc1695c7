//! Following environments of a lane step by step, without being their learner: what is needed to play their
//! episodes again, tick by tick.

use crate::client::{ClientError, ConnectError};
use crate::control::client::ControlClient;
use crate::control::protocol::{ControlError, ControlRequest, ControlResponse, LaneDescription};
use crate::process_owned::ProcessOwned;
use crate::runtime_dir::RuntimeDir;
use crate::wait_options::WaitOptions;
use smaclite_engine::{Arena, Rules};
use smaclite_pool::EpisodePart;
use smaclite_scenarios::{Problems, Scenario, ScenarioFiles};

/// The scenario of a lane's battles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LaneScenario {
    /// The texts of its files.
    pub files: ScenarioFiles,
    /// The rule set.
    pub rules: Rules,
    /// Steps after which an episode is truncated; it may differ from that of the scenario file.
    pub episode_limit: Option<u32>,
}

impl LaneScenario {
    /// The scenario, and the arena in which the lane's battles are played.
    ///
    /// # Errors
    /// If this release cannot read the scenario.
    pub fn arena(&self) -> Result<(Scenario, Arena), Problems> {
        let scenario = self.files.scenario()?;
        let arena = Arena::new(&scenario, self.rules).with_episode_limit(self.episode_limit);
        Ok((scenario, arena))
    }
}

/// The scenario of a lane, of the only lane if none is named.
///
/// # Errors
/// If the pool cannot be reached, or the lane has no battles.
pub fn lane_scenario(
    runtime_dir: &RuntimeDir,
    pool: &str,
    lane: Option<&str>,
) -> Result<LaneScenario, ConnectError> {
    let request = ControlRequest::Scenario { lane: lane.map(str::to_owned) };
    let (_, response) = ControlClient::request(runtime_dir, pool, &request, WaitOptions::for_response())?;
    Ok(scenario_of(response)?.1)
}

/// Follows environments: receives the states in which their episodes begin and their joint actions. The
/// supervisor keeps what was not read, as much as fits its limit; then the oldest episodes are missing.
///
/// With the [`scenario`](Follower::scenario) that is all that is needed to play the battles again, to the
/// bit and tick by tick: `smaclite_view::Recorder` does so, for replays and for the page of a running pool.
/// To see only the newest observations, a [`Spectator`](crate::Spectator) is cheaper.
///
/// # Example
///
/// ```
/// use smaclite_ipc::{Client, Follower, WaitOptions};
/// # use smaclite_ipc::{LaneConfig, RuntimeDir, Supervisor, SupervisorConfig};
/// # use smaclite_scenarios::ScenarioFiles;
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let folder = tempfile::tempdir()?;
/// # let runtime_dir = RuntimeDir::at(folder.path().to_owned())?;
/// # let lanes = vec![LaneConfig::new("3m", ScenarioFiles::resolve("3m")?, 2)];
/// # let (name, options) = ("train".to_owned(), Default::default());
/// # let config = SupervisorConfig { name, lanes, options, runtime_dir: runtime_dir.clone() };
/// # let supervisor = Supervisor::start(config)?;
///
/// let mut follower = Follower::connect(&runtime_dir, "train", None, &[1])?;
/// let mut client = Client::connect(&runtime_dir, "train", None, Default::default())?;
/// client.reset(Some(1), None, WaitOptions::forever())?;
/// let mut actions = vec![0; 2 * 3];
/// client.sample_actions(None, &mut actions)?;
/// client.step(&actions, None, WaitOptions::forever())?;
/// let parts = follower.read()?;
/// assert!(parts.iter().all(|part| part.env_id == 1));
/// # assert!(!parts.is_empty());
/// # drop((client, follower));
/// # drop(supervisor);
/// # Ok(())
/// # }
/// ```
///
/// # At the edges
///
/// The first part begins with the present state, which may be in the middle of an episode. Lanes of
/// environments other than battles cannot be followed: [`connect`](Follower::connect) is an error.
pub struct Follower {
    connection: ProcessOwned<ControlClient>,
    description: LaneDescription,
    scenario: LaneScenario,
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
        let (description, scenario) = scenario_of(response)?;
        Ok(Follower { connection: ProcessOwned::new(connection), description, scenario })
    }

    /// The lane.
    pub fn description(&self) -> &LaneDescription {
        &self.description
    }

    /// The scenario of its battles.
    pub fn scenario(&self) -> &LaneScenario {
        &self.scenario
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

fn scenario_of(response: ControlResponse) -> Result<(LaneDescription, LaneScenario), ControlError> {
    match response {
        ControlResponse::Scenario { lane, files } => {
            let rules = lane.rules.parse().map_err(|error| ControlError::Malformed {
                what: format!("rules of lane `{}`: {error}", lane.lane),
            })?;
            let scenario = LaneScenario { files: *files, rules, episode_limit: lane.episode_limit };
            Ok((*lane, scenario))
        }
        ControlResponse::Refused(refusal) => Err(refusal),
        other => Err(ControlError::unexpected(&other)),
    }
}
