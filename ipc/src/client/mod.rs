//! A learner's end of a lane: attach, reset, send, receive. The supervisor may be another process or threads
//! of this one; in that case the learner's thread steps environments while it waits (caller runs).
//!
//! `attach` opens a lane, `order` is what a learner can ask for, `sending` and `receiving` are the two
//! directions of a step, `outstanding` knows which environments work on a request, and `sampler` draws random
//! actions.

mod attach;
mod error;
mod order;
mod outstanding;
mod receiving;
mod sampler;
mod sending;

pub(crate) use attach::{checked_layout, connect_ports};
pub use error::{ClientError, ConnectError};
pub use order::Order;

use crate::batch::Batch;
use crate::control::client::ControlClient;
use crate::control::protocol::LaneDescription;
use crate::folder_use::FolderUse;
use crate::process_owned::ProcessOwned;
use crate::services::RequestLoan;
use crate::transport::Iceoryx;
use crate::wait_options::WaitOptions;
use attach::Ports;
use outstanding::Outstanding;
use sampler::Sampler;
use smaclite_pool::layout::Layout;
use smaclite_pool::transport::{Epoch, RequestNumber, SessionId};
use smaclite_pool::{LocalLearner, Polling, Rejection};
use std::collections::VecDeque;
use std::fmt;
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
/// let wait = WaitOptions::forever();
/// let mut client = Client::connect(&runtime_dir, "train", None, Default::default(), wait)?;
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
/// - **An action that is not available** is an error of the `recv` after it, and a request to an environment
///   that is still busy one of its `send`. Both name it, and nothing of the request happens.
/// - **A wait** ends with a batch, by its timeout, by `interrupted`, or when the pool dies. A timeout cancels
///   nothing: the batch can be received later.
/// - **Held batches** are limited (`max_held_batches` of the lane): with that many, `recv` is an error until
///   one is dropped.
/// - **A failed lane**, whose environment panicked, reports its failure in this call and all later ones.
/// - **A forked child** has a copy that cannot be used: every call is an error, and its drop does nothing.
pub struct Client {
    lane: ProcessOwned<AttachedLane>,
}

impl fmt::Debug for Client {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Client").finish_non_exhaustive()
    }
}

/// Dropped in this order: the ports before the control connection, so that the supervisor notices the end
/// when everything else is given back.
struct AttachedLane {
    /// Memory of a step as long as the last one, loaned while the pool carries that out.
    next_request: Option<RequestLoan>,
    /// Of a learner in the process of its pool.
    local: Option<LocalLearner<Iceoryx>>,
    ports: Ports,
    control: ControlClient,
    description: LaneDescription,
    /// Of the frames as this learner reads them.
    layout: Arc<Layout>,
    /// `[num_envs]`: the ids of all environments.
    all_ids: Arc<[i32]>,
    session: SessionId,
    /// The last reset of all environments. Frames of earlier ones are dropped.
    epoch: Option<RequestNumber>,
    /// Frames of this epoch that did not arrive, if there are any.
    lost: Option<(u64, u64)>,
    /// Of the last frame of this epoch.
    sequence: Option<u64>,
    outstanding: Outstanding,
    /// Requests that were refused, which `recv` is still to report.
    refused: VecDeque<(RequestNumber, Rejection)>,
    /// The pool, in another process, may keep more of them.
    may_be_more: bool,
    sampler: Sampler,
    /// The batch that was received last, which actions are sampled by.
    newest: Option<Arc<Batch>>,
    last_request: RequestNumber,
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

    /// Its use of the folder of the pool's files, which every batch prolongs.
    pub fn folder_use(&self) -> FolderUse {
        self.lane.ports.frames.folder_use()
    }

    /// Where each field of a batch lies.
    pub fn layout(&self) -> &Layout {
        &self.lane.layout
    }

    /// Sends an order to the environments of `env_ids`, or to all in order.
    ///
    /// Returns at once, unless the supervisor has stopped reading: after 5 seconds, or the timeout of `wait`
    /// if that is shorter, that is [`ClientError::NotAccepted`]. In the process of the pool, a reset of every
    /// environment first carries out what is outstanding, on this thread too.
    ///
    /// If the lane refuses the order, no environment changed, and the next [`recv`](Client::recv) says why.
    ///
    /// # Errors
    /// If the order is not one of this lane, results of these environments are to come, or the pool ended or
    /// does not accept it in time. Then nothing was sent.
    pub fn send(
        &mut self,
        order: Order<'_>,
        env_ids: Option<&[i32]>,
        wait: WaitOptions<'_>,
    ) -> Result<(), ClientError> {
        let sent = self.begin(order, env_ids, wait);
        self.leave();
        sent
    }

    /// As [`send`](Client::send), but the thread of a learner in the process of its pool stays at work:
    /// [`recv`](Client::recv) or [`leave`](Client::leave) should follow at once. Until then its
    /// [`Supervisor`](crate::Supervisor) does not end: dropped on the same thread, it waits for ever.
    ///
    /// # Errors
    /// As [`send`](Client::send).
    pub fn begin(
        &mut self,
        order: Order<'_>,
        env_ids: Option<&[i32]>,
        mut wait: WaitOptions<'_>,
    ) -> Result<(), ClientError> {
        let sent = self.attached()?.send_order(order, env_ids, &mut wait);
        if sent.is_err() {
            self.leave();
        }
        sent
    }

    /// Waits for the next batch.
    ///
    /// # Errors
    /// Also the lane's refusal of an earlier order, of which then nothing was carried out.
    pub fn recv(&mut self, mut wait: WaitOptions<'_>) -> Result<Arc<Batch>, ClientError> {
        let received = self.attached()?.recv(Instant::now(), &mut wait);
        self.leave();
        received
    }

    /// Whether a batch arrives after an order to these environments, also if nothing follows.
    ///
    /// # Errors
    /// If too few results would be outstanding.
    pub fn check_is_answered(&self, env_ids: Option<&[i32]>) -> Result<(), ClientError> {
        let (lane, settings) = (&self.lane, &self.lane.description.settings);
        let (outstanding, batch_size) =
            (lane.outstanding.results() + lane.count(env_ids), settings.batch_size);
        // The batches of a synchronous lane always have all environments.
        if settings.is_synchronous() || outstanding >= batch_size {
            return Ok(());
        }
        lane.outstanding.check_was_reset()?; // else the first reset must be of all
        Err(ClientError::TooFewForBatch { outstanding, batch_size })
    }

    /// [`send`](Client::send) and [`recv`](Client::recv), in the time of one wait.
    ///
    /// # Errors
    /// Also, before anything is sent, those of [`check_is_answered`](Client::check_is_answered).
    pub fn request(
        &mut self,
        order: Order<'_>,
        env_ids: Option<&[i32]>,
        mut wait: WaitOptions<'_>,
    ) -> Result<Arc<Batch>, ClientError> {
        let begin = Instant::now();
        self.check_is_answered(env_ids)?;
        let lane = self.attached()?;
        let sent = lane.send_order(order, env_ids, &mut wait);
        let received = sent.and_then(|()| lane.recv(begin, &mut wait));
        self.leave();
        received
    }

    /// The [`request`](Client::request) of [`Order::Reset`] to the units of the scenario.
    ///
    /// # Errors
    /// As [`request`](Client::request).
    pub fn reset(
        &mut self,
        seed: Option<u64>,
        env_ids: Option<&[i32]>,
        wait: WaitOptions<'_>,
    ) -> Result<Arc<Batch>, ClientError> {
        self.request(Order::reset(seed), env_ids, wait)
    }

    /// The [`request`](Client::request) of [`Order::Step`].
    ///
    /// # Errors
    /// As [`request`](Client::request).
    pub fn step(
        &mut self,
        actions: &[i32],
        env_ids: Option<&[i32]>,
        wait: WaitOptions<'_>,
    ) -> Result<Arc<Batch>, ClientError> {
        self.request(Order::Step(actions), env_ids, wait)
    }

    /// Whether a batch is of the present session, and not from before its last reset of all environments.
    pub fn is_current(&self, batch: &Batch) -> bool {
        batch.header().epoch() == Epoch { session: self.lane.session, reset: self.lane.epoch }
    }

    /// The batch that was received last.
    pub fn newest(&self) -> Option<&Arc<Batch>> {
        self.lane.newest.as_ref()
    }

    /// Draws uniformly random available actions into `out`, `[count, n_actors]`, for the environments of
    /// `env_ids`, which must be in the newest batch, or for all in order.
    ///
    /// # Errors
    /// If `out` has another length, or the newest batch has not these environments.
    pub fn sample_actions(&mut self, env_ids: Option<&[i32]>, out: &mut [i32]) -> Result<(), ClientError> {
        let lane = self.lane.get_mut()?;
        lane.check_length(out.len(), env_ids)?;
        lane.outstanding.check_was_reset()?;
        let batch = lane.newest.as_ref().ok_or(ClientError::NoBatch)?;
        lane.sampler.fill(batch, env_ids, lane.description.settings.num_envs, out)
    }

    /// Seeds the generator of [`sample_actions`](Client::sample_actions).
    pub fn seed_sampler(&mut self, seed: u64) {
        if let Ok(lane) = self.lane.get_mut() {
            lane.sampler = Sampler::new(seed);
        }
    }

    /// From now on this learner takes part in the pool of its own process.
    pub(crate) fn take_part(&mut self, learner: impl FnOnce(SessionId) -> Option<LocalLearner<Iceoryx>>) {
        if let Ok(lane) = self.lane.get_mut() {
            lane.local = learner(lane.session);
        }
    }

    /// Ends the work of this thread in a pool of its process. All other methods do that themselves before
    /// they return, but [`begin`](Client::begin).
    pub fn leave(&mut self) {
        if let Ok(lane) = self.lane.get_mut() {
            lane.local.as_mut().map(LocalLearner::leave);
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

impl AttachedLane {
    /// Does an array of actions have `n_actors` for every environment?
    fn check_length(&self, given: usize, env_ids: Option<&[i32]>) -> Result<(), ClientError> {
        let envs = self.count(env_ids);
        let sizes = self.description.sizes;
        let expected = envs * sizes.n_actors();
        if given == expected {
            Ok(())
        } else {
            Err(ClientError::WrongLength { given, envs, sizes, expected })
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
