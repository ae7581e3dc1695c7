//! A learner's end of a lane: attach, reset, send, receive. The supervisor may be another process or threads
//! of this one; in that case the learner's thread works for it instead of waiting.
//!
//! `attach` opens a lane, `sending` and `receiving` are the two directions of a step, `request_validator`
//! checks a request before it is sent, and `sampler` draws random actions.

mod attach;
mod error;
mod receiving;
mod request_validator;
mod sampler;
mod sending;

pub(crate) use attach::checked_layout;
pub use error::{ClientError, ConnectError};

use crate::batch::Batch;
use crate::control::client::ControlClient;
use crate::control::protocol::LaneDescription;
use crate::process_owned::ProcessOwned;
use crate::transport::Iceoryx;
use crate::wait_options::WaitOptions;
use attach::Ports;
use request_validator::RequestValidator;
use sampler::Sampler;
use smaclite_pool::Helper;
use smaclite_pool::layout::Layout;
use smaclite_pool::transport::{Epoch, RequestNumber, SessionId};
use smaclite_pool::{Polling, Rejection};
use std::sync::Arc;
use std::time::Instant;

/// A learner attached to a lane: it sends actions and receives batches.
///
/// A lane has one learner at a time; another one is refused until this one is dropped or its process ends.
/// To read batches without sending actions, use a [`Spectator`](crate::Spectator), and to see whole episodes
/// tick by tick a [`Follower`](crate::Follower). One battle in the own thread needs no pool: use
/// `smaclite_engine::Battle`.
///
/// # Example
///
/// ```
/// use smaclite_ipc::{Client, WaitOptions};
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
/// let mut client = Client::connect(&runtime_dir, "train", None, Default::default())?;
/// let n_agents = client.description().sizes.n_agents;
/// client.reset(Some(1), None, WaitOptions::forever())?;
/// let mut actions = vec![0; 2 * n_agents];
/// for _ in 0..10 {
///     client.sample_actions(None, &mut actions)?; // instead of a policy
///     let batch = client.step(&actions, None, WaitOptions::forever())?;
///     assert_eq!(batch.reward().len(), 2);
/// }
/// # drop(client);
/// # drop(supervisor);
/// # Ok(())
/// # }
/// ```
///
/// # At the edges
///
/// - **Before the first reset** every step is an error. A later reset of all environments begins a new epoch:
///   results of earlier requests that were not received are dropped.
/// - **An action that is not available**, or a request to an environment that is still busy, is an error that
///   names it, and nothing of the request happens.
/// - **A wait** ends with a batch, by its timeout, by `interrupted`, or when the pool dies. A timeout cancels
///   nothing: the batch can be received later.
/// - **Held batches** are limited (`max_held_batches` of the lane): with that many, `recv` is an error until
///   one is dropped.
/// - **A failed lane**, whose environment panicked, reports its failure in this call and all later ones.
/// - **A forked child** has a copy that cannot be used: every call is an error, and its drop does nothing.
pub struct Client {
    lane: ProcessOwned<AttachedLane>,
}

/// Dropped in this order: the ports before the control connection, so that the supervisor notices the end
/// when everything else is given back.
struct AttachedLane {
    /// Of a learner that works for the pool of its own process.
    helper: Option<Helper<Iceoryx>>,
    ports: Ports,
    control: ControlClient,
    description: LaneDescription,
    layout: Arc<Layout>,
    validator: RequestValidator,
    sampler: Sampler,
    epoch: Epoch,
    last_request: RequestNumber,
    /// The sequence number of the last frame; `None` before the first of this epoch.
    sequence: Option<u64>,
    /// Why the lane failed. Reported once by the lane, and by every later call.
    failure: Option<Rejection>,
    /// How to poll for a frame before blocking.
    polling: Polling,
}

impl Client {
    /// The lane that this learner is attached to.
    pub fn description(&self) -> &LaneDescription {
        &self.lane.description
    }

    /// Where each field of a batch lies.
    pub fn layout(&self) -> &Layout {
        &self.lane.layout
    }

    /// Requests a new episode in every environment, or in those of `env_ids`. With a seed, environment `i` is
    /// seeded with `seed + i`; without one its generator continues, except that a session's first reset uses
    /// the lane's seed. A reset of every environment drops the results of earlier requests that were not
    /// received.
    ///
    /// Returns at once, unless the supervisor has stopped reading: after 5 seconds, or the timeout of `wait`
    /// if that is shorter, that is [`ClientError::NotAccepted`].
    pub fn send_reset(
        &mut self,
        seed: Option<u64>,
        env_ids: Option<&[i32]>,
        mut wait: WaitOptions<'_>,
    ) -> Result<(), ClientError> {
        self.attached()?.send_reset(seed, env_ids, &mut wait)
    }

    /// Sends actions, `[count, n_agents]`, to the environments of `env_ids` or to all in order. Returns as
    /// [`send_reset`](Client::send_reset) does.
    pub fn send(
        &mut self,
        actions: &[i32],
        env_ids: Option<&[i32]>,
        mut wait: WaitOptions<'_>,
    ) -> Result<(), ClientError> {
        self.attached()?.send_step(actions, env_ids, &mut wait)
    }

    /// Waits for the next batch.
    pub fn recv(&mut self, mut wait: WaitOptions<'_>) -> Result<Batch, ClientError> {
        Seat::new(self.attached()?).lane.recv(Instant::now(), &mut wait)
    }

    /// [`send_reset`](Client::send_reset) and [`recv`](Client::recv).
    pub fn reset(
        &mut self,
        seed: Option<u64>,
        env_ids: Option<&[i32]>,
        mut wait: WaitOptions<'_>,
    ) -> Result<Batch, ClientError> {
        let begin = Instant::now();
        let seat = Seat::new(self.attached()?);
        seat.lane.send_reset(seed, env_ids, &mut wait)?;
        seat.lane.recv(begin, &mut wait)
    }

    /// [`send`](Client::send) and [`recv`](Client::recv).
    pub fn step(
        &mut self,
        actions: &[i32],
        env_ids: Option<&[i32]>,
        mut wait: WaitOptions<'_>,
    ) -> Result<Batch, ClientError> {
        let begin = Instant::now();
        let seat = Seat::new(self.attached()?);
        seat.lane.send_step(actions, env_ids, &mut wait)?;
        seat.lane.recv(begin, &mut wait)
    }

    /// Draws uniformly random available actions into `out`, `[count, n_agents]`, for the environments of
    /// `env_ids` or for all in order, by the masks that were last received of each.
    pub fn sample_actions(&mut self, env_ids: Option<&[i32]>, out: &mut [i32]) -> Result<(), ClientError> {
        let lane = self.lane.get_mut()?;
        lane.check_length(out.len(), env_ids)?;
        Ok(lane.sampler.fill(&lane.validator, env_ids, out)?)
    }

    /// Seeds the generator of [`sample_actions`](Client::sample_actions).
    pub fn seed_sampler(&mut self, seed: u64) {
        if let Ok(lane) = self.lane.get_mut() {
            lane.sampler = Sampler::new(seed);
        }
    }

    /// From now on this learner works for the pool of its own process.
    pub(crate) fn help(&mut self, helper: impl FnOnce(SessionId) -> Option<Helper<Iceoryx>>) {
        if let Ok(lane) = self.lane.get_mut() {
            lane.helper = helper(lane.epoch.session);
        }
    }

    /// The lane, if this process may use it and it has not failed.
    fn attached(&mut self) -> Result<&mut AttachedLane, ClientError> {
        let lane = self.lane.get_mut()?;
        match &lane.failure {
            Some(failure) => Err(failure.clone().into()),
            None => Ok(lane),
        }
    }
}

/// A lane whose learner has a seat in the pool of its own process, if there is one.
struct Seat<'a> {
    lane: &'a mut AttachedLane,
}

impl<'a> Seat<'a> {
    fn new(lane: &'a mut AttachedLane) -> Seat<'a> {
        if let Some(helper) = &mut lane.helper {
            helper.sit_down();
        }
        Seat { lane }
    }
}

impl Drop for Seat<'_> {
    fn drop(&mut self) {
        if let Some(helper) = &mut self.lane.helper {
            helper.stand_up();
        }
    }
}

impl AttachedLane {
    /// Does an array of actions have `n_agents` for every environment?
    fn check_length(&self, given: usize, env_ids: Option<&[i32]>) -> Result<(), ClientError> {
        let envs = self.count(env_ids);
        let n_agents = self.description.sizes.n_agents;
        let expected = envs * n_agents;
        if given == expected {
            Ok(())
        } else {
            Err(ClientError::WrongLength { given, envs, n_agents, expected })
        }
    }

    /// How many environments a request is about.
    fn count(&self, env_ids: Option<&[i32]>) -> usize {
        env_ids.map_or(self.description.settings.num_envs, <[i32]>::len)
    }

    fn pool_died(&self) -> ClientError {
        ClientError::PoolDied { pool: self.description.pool.clone() }
    }
}
