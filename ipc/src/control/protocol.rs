//! The messages of the control socket: one JSON object per line, requests from the client and responses from
//! the supervisor. Each begins with the release and the protocol version of its sender ([`Message`]).

use crate::capacity::Capacity;
pub use crate::connections::PeerPorts;
pub use crate::refusals::Refusal;
use serde::{Deserialize, Serialize};
use smaclite_engine::{Faction, Opponents, Rewards, Sides, Sizes};
use smaclite_pool::fields::FIELDS;
use smaclite_pool::layout::Layout;
use smaclite_pool::{LaneSettings, LaneStats};
use smaclite_scenarios::ScenarioFiles;

/// Increased whenever a request or response changes, what is played again from it, or how services are
/// opened.
pub const PROTOCOL_VERSION: u32 = 11;

/// The release of this program.
pub const RELEASE: &str = env!("CARGO_PKG_VERSION");

/// A request or a response with its sender. These two keys never change, so that programs of different
/// releases can name both.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Message<T> {
    /// The sender's [`PROTOCOL_VERSION`].
    pub version: u32,
    /// The sender's release.
    pub release: String,
    /// The request or response.
    #[serde(flatten)]
    pub body: T,
}

/// What a message of any release has.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Sender {
    pub(crate) version: u32,
    #[serde(default = "unknown_release")]
    pub(crate) release: String,
}

fn unknown_release() -> String {
    "unknown".to_owned()
}

impl<T> Message<T> {
    /// A message of this program.
    pub fn new(body: T) -> Message<T> {
        Message { version: PROTOCOL_VERSION, release: RELEASE.to_owned(), body }
    }
}

/// Such as `release 0.1.0 (protocol 1)`.
pub(crate) fn release_text(release: &str, version: u32) -> String {
    format!("release {} (protocol {version})", release.escape_default())
}

/// Bytes of the longest request that a supervisor reads; the longest valid one names a lane and environments.
pub(crate) const MAX_REQUEST: usize = 1 << 16;

/// Bytes of the longest response that a client reads: the status of more lanes than a process has file
/// descriptors for.
pub(crate) const MAX_RESPONSE: usize = 1 << 30;

/// A request to a supervisor.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(tag = "request", rename_all = "snake_case")]
pub enum ControlRequest {
    /// Everything about the pool.
    Status,
    /// Become the learner of a lane, or of the only lane if none is named, until the connection ends.
    Attach {
        /// The lane's name.
        lane: Option<String>,
    },
    /// Connect to the ports of the learner or spectator that this connection became; its second request.
    Connect(PeerPorts),
    /// Become a spectator of a lane, or of the only lane if none is named, until the connection ends.
    Watch {
        /// The lane's name.
        lane: Option<String>,
    },
    /// The scenario of a lane, or of the only lane if none is named.
    Scenario {
        /// The lane's name.
        lane: Option<String>,
    },
    /// Become a follower of environments of a lane, or of the only lane if none is named, until the
    /// connection ends.
    Follow {
        /// The lane's name.
        lane: Option<String>,
        /// The environments.
        env_ids: Vec<usize>,
    },
    /// What the followed environments did since the last such request of this connection, or a piece of it.
    ReadEpisodes,
    /// Of a learner that has received a refusal as a frame: those that came after it.
    ReadRefusals,
}

/// A part of an episode as the socket carries it ([`EpisodePart`](smaclite_pool::EpisodePart)).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpisodeMessage {
    /// The environment.
    pub env_id: usize,
    /// The number of the episode.
    pub number: u64,
    /// The record of the state in which it began, as base64.
    pub start: Option<String>,
    /// The joint actions, `[steps, n_actors]`.
    pub actions: Vec<u16>,
    /// Whether the episode ended with the last of these steps.
    pub is_over: bool,
    /// Episodes that were dropped since the last part.
    pub lost: u64,
}

/// A supervisor's response.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(tag = "response", rename_all = "snake_case")]
pub enum ControlResponse {
    /// To [`ControlRequest::Status`].
    Status(PoolStatus),
    /// To [`ControlRequest::Attach`].
    Attached {
        /// The session; part of every request of the learner.
        session: u64,
        /// The lane.
        lane: Box<LaneDescription>,
    },
    /// To [`ControlRequest::Connect`]: the pool reads the learner's requests, and its frames arrive.
    Connected,
    /// To [`ControlRequest::Watch`].
    Lane(Box<LaneDescription>),
    /// To [`ControlRequest::Scenario`] and [`ControlRequest::Follow`].
    Scenario {
        /// The lane.
        lane: Box<LaneDescription>,
        /// The scenario of its battles.
        files: Box<ScenarioFiles>,
    },
    /// To [`ControlRequest::ReadEpisodes`].
    Episodes {
        /// What happened, by environment and in order.
        parts: Vec<EpisodeMessage>,
        /// There is more: the request is to be repeated.
        more: bool,
    },
    /// To [`ControlRequest::ReadRefusals`].
    Refusals {
        /// In the order of the requests.
        refusals: Vec<Refusal>,
    },
    /// To any request that was refused.
    Refused(ControlError),
}

/// Why a control request was refused.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[serde(tag = "error", rename_all = "snake_case")]
#[allow(missing_docs)] // the messages say it
pub enum ControlError {
    #[error("lane `{lane}` already has a learner: process {learner_pid}")]
    LaneTaken { lane: String, learner_pid: u32 },
    #[error("lane `{lane}` already has its {limit} spectators; serve it with more (--spectators)")]
    TooManySpectators { lane: String, limit: usize },
    #[error("lane `{lane}` already has its {limit} followers; end one of them")]
    TooManyFollowers { lane: String, limit: usize },
    #[error(
        "the logs of lane `{lane}` have room for {limit} followed environments of its size; follow fewer"
    )]
    TooManyFollowed { lane: String, limit: usize },
    #[error("a follower must follow between 1 and {limit} environments, got {given}")]
    FollowedEnvs { given: usize, limit: usize },
    #[error("env_id must be below {num_envs}, the number of environments of lane `{lane}`, got {env_id}")]
    NoSuchEnv { lane: String, env_id: usize, num_envs: usize },
    #[error("there is no lane `{lane}`; the pool has {}", names(lanes))]
    NoSuchLane { lane: String, lanes: Vec<String> },
    #[error("the pool has several lanes; name one, by `lane=` or --lane: {}", names(lanes))]
    WhichLane { lanes: Vec<String> },
    #[error("pool `{pool}` (process {pid}) could not open the shared memory of this process: {cause}")]
    NotConnected { pool: String, pid: u32, cause: String },
    #[error("pool `{pool}` (process {pid}) cannot accept a connection: {cause}")]
    NotAccepted { pool: String, pid: u32, cause: String },
    #[error("{message}")]
    OtherRelease { message: String },
    #[error("lane `{lane}` failed and no longer serves: {text}")]
    LaneFailed { lane: String, text: String },
    #[error(
        "this process runs in another process namespace than pool `{pool}`, which could not notice its end; \
         run both in the same one (`docker run --pid=container:NAME`)"
    )]
    OtherNamespace { pool: String },
    #[error("not understood: {what}")]
    Malformed { what: String },
}

impl ControlError {
    /// A response that does not fit the request.
    pub(crate) fn unexpected(answer: &ControlResponse) -> ControlError {
        ControlError::Malformed { what: format!("unexpected answer {answer:?}") }
    }

    /// Whether it is over as soon as a connection ends that another process has, or had.
    pub(crate) fn may_be_over(&self) -> bool {
        matches!(
            self,
            ControlError::LaneTaken { .. }
                | ControlError::TooManySpectators { .. }
                | ControlError::TooManyFollowers { .. }
                | ControlError::TooManyFollowed { .. }
        )
    }
}

fn names(lanes: &[String]) -> String {
    lanes.iter().map(|l| format!("`{l}`")).collect::<Vec<_>>().join(", ")
}

/// A pool and its lanes.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PoolStatus {
    /// The name learners connect by.
    pub pool: String,
    /// The supervisor's process.
    pub pid: u32,
    /// Worker threads.
    pub threads: usize,
    /// Seconds since the supervisor started.
    pub uptime_s: f64,
    /// Bytes of shared memory set aside for frames.
    pub shared_memory: usize,
    /// The lanes, in the order they were given.
    pub lanes: Vec<LaneStatus>,
}

/// The current state of a lane.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LaneStatus {
    /// Its constant part.
    pub description: LaneDescription,
    /// The process of its learner, if it has one.
    pub learner_pid: Option<u32>,
    /// Spectators that watch it.
    pub spectators: usize,
    /// Counts since the supervisor started.
    pub stats: LaneStats,
    /// Steps of single environments in the last second.
    pub steps_per_s: f64,
    /// Microseconds that a request waited until it was received, on average over the last second.
    pub queue_wait_us: f64,
    /// Why it failed, if it did.
    pub failure: Option<String>,
}

/// The description of a lane: enough to find its services and read its frames.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LaneDescription {
    /// The pool's name.
    pub pool: String,
    /// The supervisor's process.
    pub pid: u32,
    /// First part of the names of its iceoryx2 services.
    pub instance: String,
    /// The lane's name.
    pub lane: String,
    /// The scenario's name.
    pub scenario: String,
    /// Sizes of the lane's frames: `obs_size` includes what the lane appends to observations.
    #[serde(flatten)]
    pub sizes: Sizes,
    /// How many environments there are, and how they are stepped.
    #[serde(flatten)]
    pub settings: LaneSettings,
    /// Steps after which an episode is truncated.
    pub episode_limit: Option<u32>,
    /// The rules of its battles: `smaclite`, `paper` or `starcraft-1`.
    pub rules: String,
    /// Who plays the enemies; `learner` is the team, if one plays them.
    pub opponents: Opponents,
    /// The team that plays the enemies: a team of the zoo, such as `zoo:3m`, or the folder of a run.
    pub opponent_team: Option<String>,
    /// Which sides of its battles joint actions of learners play.
    pub sides: Sides,
    /// What both sides of its battles are rewarded for.
    pub rewards: Rewards,
    /// [`Layout::hash`]: whether reader and writer agree on all offsets.
    pub layout_hash: u64,
    /// How many frames and requests its memory has room for.
    pub capacity: Capacity,
    /// Worker threads of the pool, which all lanes share.
    pub threads: usize,
}

impl LaneDescription {
    /// Where each field of a frame lies. Computed from the sizes, not received from the supervisor; the hash
    /// says whether both computed the same.
    ///
    /// # Errors
    /// [`ControlError::Malformed`] for sizes and settings that no lane has.
    pub fn layout(&self) -> Result<Layout, ControlError> {
        let malformed = |what: String| ControlError::Malformed { what };
        self.settings.check().map_err(|error| malformed(error.to_string()))?;
        let most = u128::from(u64::MAX) / FIELDS.len() as u128 / 2;
        for sizes in [Faction::Ally, Faction::Enemy].into_iter().filter_map(|side| self.sizes.of(side)) {
            let Sizes { n_agents, n_actions, obs_size, state_size, .. } = sizes;
            let widest = obs_size.max(state_size).max(n_actions);
            // No field is larger than this, so no sum of them overflows.
            let field = [self.settings.num_envs, n_agents, widest, size_of::<f32>()];
            let field = field.iter().fold(1u128, |product, size| product.saturating_mul(*size as u128));
            if n_agents == 0 || n_actions == 0 || field > most {
                return Err(malformed(format!("no lane has {:?}", self.sizes)));
            }
        }
        Ok(self.settings.layout(self.sizes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use smaclite_pool::MAX_ENVS;
    use smaclite_pool::fields::FieldSet;

    /// A lane of 2s3z with as many environments as there can be.
    fn lane() -> LaneDescription {
        let settings = LaneSettings::new(MAX_ENVS);
        LaneDescription {
            pool: "train".to_owned(),
            pid: 1,
            instance: "train.1.0".to_owned(),
            lane: "2s3z".to_owned(),
            scenario: "2s3z".to_owned(),
            sizes: Sizes {
                n_agents: 5,
                n_enemies: 5,
                n_actions: 11,
                obs_size: 80,
                state_size: 120,
                perception_size: 0,
                n_phases: 0,
                enemies: None,
            },
            settings,
            episode_limit: None,
            rules: "smaclite".to_owned(),
            opponents: Opponents::default(),
            opponent_team: None,
            sides: Sides::default(),
            rewards: Rewards::DEFAULT,
            layout_hash: 0,
            capacity: Capacity::new(&settings, 1, 2, 0),
            threads: 2,
        }
    }

    #[test]
    fn sizes_that_no_lane_has_are_refused_and_not_multiplied() {
        let lane = lane();
        let (sizes, settings) = (lane.sizes, lane.settings);
        assert!(lane.layout().is_ok());
        let of_sizes = |sizes| LaneDescription { sizes, ..lane.clone() };
        let of_settings = |settings| LaneDescription { settings, ..lane.clone() };
        let lies = [
            of_sizes(Sizes { n_agents: 0, ..sizes }),
            of_sizes(Sizes { n_actions: 0, ..sizes }),
            of_sizes(Sizes { obs_size: usize::MAX, ..sizes }),
            of_sizes(Sizes { state_size: usize::MAX / 4, ..sizes }),
            of_settings(LaneSettings { batch_size: 0, ..settings }),
            of_settings(LaneSettings { batch_size: MAX_ENVS + 1, ..settings }),
            of_settings(LaneSettings { num_envs: usize::MAX, ..settings }),
            of_settings(LaneSettings { obs_last_actions: 17, ..settings }),
        ];
        lies.iter().for_each(|lie| assert!(lie.layout().is_err(), "{lie:?}"));
    }

    #[test]
    fn sizes_and_settings_are_keys_of_the_description() {
        let keys = serde_json::to_value(lane()).unwrap();
        assert_eq!((&keys["n_agents"], &keys["batch_size"]), (&5.into(), &MAX_ENVS.into()), "{keys}");
        assert_eq!((&keys["obs_last_actions"], &keys["obs_agent_id"]), (&0.into(), &false.into()), "{keys}");
        let with_fields = |names: &[&str]| {
            let mut keys = keys.clone();
            keys["fields"] = names.into();
            serde_json::from_value::<LaneDescription>(keys)
        };
        assert_eq!(with_fields(&["obs"]).unwrap().settings.fields, FieldSet::from_names(["obs"]).unwrap());
        assert!(with_fields(&["obz"]).unwrap_err().to_string().contains("unknown field `obz`"));
    }
}
