//! Following environments of a lane step by step, without being their learner: what is needed to play their
//! episodes again, tick by tick.

use crate::client::{ClientError, ConnectError};
use crate::control::client::ControlClient;
use crate::control::protocol::{
    ControlError, ControlRequest, ControlResponse, EpisodeMessage, LaneDescription,
};
use crate::lane_scenario::setup_in;
use crate::process_owned::ProcessOwned;
use crate::runtime_dir::RuntimeDir;
use crate::wait_options::WaitOptions;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use smaclite_engine::{Arena, BattleSetup, Snapshot};
use std::sync::Arc;

/// Follows environments: receives the states in which their episodes begin and their joint actions. The
/// supervisor keeps what was not read, as much as fits its limit; then the oldest episodes are missing.
///
/// With the [`setup`](Follower::setup) that is all that is needed to play the battles again, to the
/// bit and tick by tick: `smaclite_view::Recorder` does so, for replays and for the page of a running pool.
/// To see only the newest observations, a [`Spectator`](crate::Spectator) is cheaper.
///
/// # Example
///
/// ```
/// use smaclite_ipc::{Client, Follower, WaitOptions};
/// # use smaclite_ipc::{LaneConfig, RuntimeDir, Supervisor, SupervisorConfig};
/// # use smaclite_engine::BattleSetup;
/// # use smaclite_scenarios::ScenarioFiles;
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let folder = tempfile::tempdir()?;
/// # let runtime_dir = RuntimeDir::at(folder.path().to_owned())?;
/// # let (_, files) = ScenarioFiles::resolve("3m")?;
/// # let lanes = vec![LaneConfig::new("3m", BattleSetup::new(files), 2)];
/// # let (name, options) = ("train".to_owned(), Default::default());
/// # let config = SupervisorConfig { name, lanes, options, runtime_dir: runtime_dir.clone() };
/// # let supervisor = Supervisor::start(config)?;
///
/// let mut follower = Follower::connect(&runtime_dir, "train", None, &[1], WaitOptions::forever())?;
/// let wait = WaitOptions::forever();
/// let mut client = Client::connect(&runtime_dir, "train", None, Default::default(), wait)?;
/// client.reset(Some(1), None, WaitOptions::forever())?;
/// let mut actions = vec![0; 2 * 3];
/// client.sample_actions(None, &mut actions)?;
/// client.step(&actions, None, WaitOptions::forever())?;
/// let piece = follower.read(WaitOptions::forever())?;
/// assert!(piece.parts.iter().all(|part| part.env_id == 1) && !piece.more);
/// # assert!(!piece.parts.is_empty());
/// # drop((client, follower));
/// # drop(supervisor);
/// # Ok(())
/// # }
/// ```
///
/// # At the edges
///
/// The first part begins with the present state, which may be in the middle of an episode.
pub struct Follower {
    connection: ProcessOwned<ControlClient>,
    description: LaneDescription,
    setup: BattleSetup,
    arena: Arc<Arena>,
}

/// A piece of what followed environments did.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece {
    /// By environment and in order.
    pub parts: Vec<FollowedPart>,
    /// There is more, which the next call returns.
    pub more: bool,
}

/// A part of an episode of a followed environment.
#[derive(Clone, Debug, PartialEq)]
pub struct FollowedPart {
    /// The environment.
    pub env_id: usize,
    /// Counts the episodes of the environment since it has followers, from 0.
    pub number: u64,
    /// The state in which the episode began, or in which the log of it begins; in its first part only.
    pub start: Option<Snapshot>,
    /// The joint actions since the last part, `[steps, n_actors]`.
    pub actions: Vec<u16>,
    /// The episode ended with the last of these steps. An episode that is reset before its end has no such
    /// part.
    pub is_over: bool,
    /// Episodes between the last part and this one that the log dropped, because the follower had not read
    /// them in time; all of them or their ends.
    pub lost: u64,
}

impl FollowedPart {
    fn new(message: EpisodeMessage, arena: &Arena) -> Result<FollowedPart, ControlError> {
        let EpisodeMessage { env_id, number, start, actions, is_over, lost } = message;
        let start = start.map(|text| snapshot(&text, arena)).transpose()?;
        Ok(FollowedPart { env_id, number, start, actions, is_over, lost })
    }
}

/// The state of a record as base64.
fn snapshot(text: &str, arena: &Arena) -> Result<Snapshot, ControlError> {
    let malformed =
        |error: String| ControlError::Malformed { what: format!("the start of an episode: {error}") };
    let record = STANDARD.decode(text).map_err(|error| malformed(error.to_string()))?;
    let mut snapshot = Snapshot::default();
    let read = snapshot.read_record(arena, 0, &record, &mut Vec::new());
    read.map_err(|error| malformed(error.to_string()))?;
    Ok(snapshot)
}

impl Follower {
    /// Follows environments of a lane of a pool that runs, of its only lane if none is named. Each log begins
    /// with the present state. Waits for the pool's answer.
    ///
    /// # Errors
    /// If the pool cannot be reached, its battles are not those of this release, the lane has no such
    /// environment, or too many followers.
    pub fn connect(
        runtime_dir: &RuntimeDir,
        pool: &str,
        lane: Option<&str>,
        env_ids: &[usize],
        wait: WaitOptions<'_>,
    ) -> Result<Follower, ConnectError> {
        let request = ControlRequest::Follow { lane: lane.map(str::to_owned), env_ids: env_ids.to_vec() };
        let (connection, response) = ControlClient::request(runtime_dir, pool, &request, wait)?;
        let (description, setup) = setup_in(response)?;
        let arena = setup.arena().map_err(|problems| ControlError::Malformed {
            what: format!("scenario of lane `{}`: {problems}", description.lane),
        })?;
        let arena = Arc::new(arena.1);
        Ok(Follower { connection: ProcessOwned::new(connection), description, setup, arena })
    }

    /// The lane.
    pub fn description(&self) -> &LaneDescription {
        &self.description
    }

    /// What its battles are played with.
    pub fn setup(&self) -> &BattleSetup {
        &self.setup
    }

    /// The same, for battles.
    pub fn arena(&self) -> &Arc<Arena> {
        &self.arena
    }

    /// The next piece of what the environments did since the last call: some 100 kB, or less if that is all.
    /// Waits for the pool's answer.
    ///
    /// # Errors
    /// If the pool is gone or does not answer. Nothing is lost: the next call returns what the pool answers
    /// late.
    pub fn read(&mut self, wait: WaitOptions<'_>) -> Result<Piece, ClientError> {
        let connection = self.connection.get_mut()?;
        let response = connection.repeat(&ControlRequest::ReadEpisodes, wait);
        let (response, is_late) = response.map_err(ClientError::of_socket)?;
        match response {
            ControlResponse::Episodes { parts, more } => {
                let parts = parts.into_iter().map(|part| FollowedPart::new(part, &self.arena));
                let parts = parts.collect::<Result<_, _>>()?;
                Ok(Piece { parts, more: more || is_late })
            }
            ControlResponse::Refused(refusal) => Err(refusal.into()),
            other => Err(ControlError::unexpected(&other).into()),
        }
    }
}
