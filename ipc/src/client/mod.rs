//! A learner's end of a lane: attach, reset, send, receive. The same for a supervisor in another process and
//! for one in this process.

mod error;

pub use error::{ClientError, ConnectError};

use crate::batch::Batch;
use crate::control::client::{ControlClient, ControlSocketError, RESPONSE_TIMEOUT};
use crate::control::protocol::{
    ControlError, ControlRequest, ControlResponse, LaneDescription, PROTOCOL_VERSION,
};
use crate::memory::{PORTS, check_room, reserve_segments};
use crate::request_validator::RequestValidator;
use crate::runtime_dir::RuntimeDir;
use crate::services::{
    FramePort, FrameSample, IpcListener, IpcNode, IpcNotifier, LaneServices, RequestPublisher, WorkEvent,
    doing, open_node,
};
use crate::wire::{Content, RequestHeader, actions_offset, frames_lost, read_frame, step_bytes};
use iceoryx2::port::ReceiveError;
use smaclite_pool::layout::Layout;
use smaclite_pool::transport::RequestKind;
use smaclite_pool::{Rejection, WaitStrategy};
use std::mem::ManuallyDrop;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A blocked client looks this often whether its supervisor lives and its caller wants to stop.
const CHECK_INTERVAL: Duration = Duration::from_millis(100);

/// How often a learner looks for a pool that is not there yet.
const RETRY_INTERVAL: Duration = Duration::from_millis(20);

/// Workers take requests between two runs of environments; a supervisor that does not is stopped.
const SEND_TIMEOUT: Duration = Duration::from_secs(5);

/// How to wait.
pub struct WaitOptions<'a> {
    /// Give up after this long.
    pub timeout: Option<Duration>,
    /// Asked at least every 100 ms while blocked; `true` ends the wait.
    pub interrupted: &'a mut dyn FnMut() -> bool,
}

impl WaitOptions<'static> {
    /// Without a timeout, and not to be interrupted.
    pub fn forever() -> Self {
        // A closure that captures nothing takes no memory, so nothing leaks.
        WaitOptions { timeout: None, interrupted: Box::leak(Box::new(|| false)) }
    }
}

impl WaitOptions<'_> {
    /// The same, for one of several waits in a row.
    fn reborrow(&mut self) -> WaitOptions<'_> {
        WaitOptions { timeout: self.timeout, interrupted: &mut *self.interrupted }
    }
}

/// A learner attached to a lane.
pub struct Client {
    parts: ManuallyDrop<Parts>,
    owner: u32,
}

/// Dropped in this order: ports before their node, and the control connection last, so that the supervisor
/// hears of the end when everything else is given back.
struct Parts {
    publisher: RequestPublisher,
    frames: Arc<FramePort>,
    listener: IpcListener,
    work: IpcNotifier,
    _services: (LaneServices, WorkEvent),
    _ipc_node: IpcNode,
    control: ControlClient,
    description: LaneDescription,
    layout: Arc<Layout>,
    validator: RequestValidator,
    session: u64,
    epoch: u64,
    requests: u64,
    /// Number of the last frame of this round, 0 before the first.
    sequence: u64,
    /// The lane failed, which is reported once and stays so.
    failure: Option<Rejection>,
    /// For how long to look for a frame before blocking; `None` is for ever.
    spin: Option<Duration>,
}

impl Client {
    /// Attaches to a lane of a running pool: to its only lane, if none is named. The pool has 10 seconds to
    /// answer.
    pub fn connect(
        runtime_dir: &RuntimeDir,
        pool: &str,
        lane: Option<&str>,
        strategy: WaitStrategy,
    ) -> Result<Client, ConnectError> {
        let wait = WaitOptions { timeout: Some(Duration::ZERO), interrupted: &mut || false };
        Client::connect_within(runtime_dir, pool, lane, strategy, wait)
    }

    /// Attaches to a lane of a pool, and waits until the pool appears and answers. With a timeout of zero it
    /// must run already, and has 10 seconds to answer.
    pub fn connect_within(
        runtime_dir: &RuntimeDir,
        pool: &str,
        lane: Option<&str>,
        strategy: WaitStrategy,
        wait: WaitOptions<'_>,
    ) -> Result<Client, ConnectError> {
        let WaitOptions { timeout, interrupted } = wait;
        let begin = Instant::now();
        loop {
            let left = timeout.map(|time| time.saturating_sub(begin.elapsed()));
            let for_answer = match timeout {
                Some(Duration::ZERO) => Some(RESPONSE_TIMEOUT),
                _ => left.map(|left| left.max(CHECK_INTERVAL)),
            };
            let wait = WaitOptions { timeout: for_answer, interrupted: &mut *interrupted };
            match Client::attach(runtime_dir, pool, lane, strategy, wait) {
                Err(ConnectError::Control(
                    ControlSocketError::NoSuchPool { .. } | ControlSocketError::Gone { .. },
                )) if left != Some(Duration::ZERO) => {
                    if interrupted() {
                        return Err(ControlSocketError::Interrupted { pool: pool.to_owned() }.into());
                    }
                    std::thread::sleep(left.map_or(RETRY_INTERVAL, |left| left.min(RETRY_INTERVAL)));
                }
                outcome => return outcome,
            }
        }
    }

    fn attach(
        runtime_dir: &RuntimeDir,
        pool: &str,
        lane: Option<&str>,
        strategy: WaitStrategy,
        wait: WaitOptions<'_>,
    ) -> Result<Client, ConnectError> {
        let question = ControlRequest::Attach { version: PROTOCOL_VERSION, lane: lane.map(str::to_owned) };
        let (control, answer) = ControlClient::request(runtime_dir, pool, &question, wait)?;
        let (session, description) = match answer {
            ControlResponse::Attached { session, lane } => (session, *lane),
            ControlResponse::Refused(refusal) => return Err(refusal.into()),
            other => return Err(ControlError::unexpected(&other).into()),
        };
        let layout = Arc::new(checked_layout(&description)?);
        let spin = strategy.spin_time(description.threads);
        let ports =
            open_ports(runtime_dir, &description, &layout).map_err(|error| control.cause_of(error))?;
        let (publisher, frames, listener, work, services, ipc_node) = ports;
        let parts = Parts {
            publisher,
            frames: Arc::new(frames),
            listener,
            work,
            _services: services,
            _ipc_node: ipc_node,
            control,
            validator: RequestValidator::new(&layout, description.num_envs, description.autoreset),
            description,
            layout,
            session,
            epoch: 0,
            requests: 0,
            sequence: 0,
            failure: None,
            spin,
        };
        Ok(Client { parts: ManuallyDrop::new(parts), owner: std::process::id() })
    }

    /// What this learner is attached to.
    pub fn description(&self) -> &LaneDescription {
        &self.parts.description
    }

    /// Where each field of a batch lies.
    pub fn layout(&self) -> &Layout {
        &self.parts.layout
    }

    /// Asks for a new episode in every environment, or in those of `env_ids`. With a seed, environment `i` is
    /// seeded with `seed + i`; without one its generator goes on, except that a session's first reset uses
    /// the lane's seed. Results of earlier requests that were not received are dropped when every environment
    /// is reset.
    ///
    /// Returns at once, unless the supervisor has stopped reading: after 5 seconds, or sooner as `patience`
    /// has it, that is [`ClientError::NotAccepted`].
    pub fn send_reset(
        &mut self,
        seed: Option<u64>,
        env_ids: Option<&[i32]>,
        wait: WaitOptions<'_>,
    ) -> Result<(), ClientError> {
        let parts = self.working_parts()?;
        let number = parts.requests + 1;
        let kind = RequestKind::Reset { seed };
        if let Some(ids) = env_ids
            && !parts.validator.is_whole(env_ids)
        {
            parts.validator.reserve_reset(number, ids)?;
            return parts.send(kind, env_ids, &[], wait);
        }
        // Only a reset that was sent begins a round: otherwise what is under way is still to come.
        parts.send(kind, env_ids, &[], wait)?;
        parts.validator.reserve_full_reset(number);
        parts.epoch = number;
        parts.sequence = 0;
        Ok(())
    }

    /// Sends actions, `[count, n_agents]`, to the environments of `env_ids` or to all in order. Returns as
    /// [`send_reset`](Client::send_reset) does.
    pub fn send(
        &mut self,
        actions: &[i32],
        env_ids: Option<&[i32]>,
        wait: WaitOptions<'_>,
    ) -> Result<(), ClientError> {
        let parts = self.working_parts()?;
        let envs = env_ids.map_or(parts.description.num_envs, <[i32]>::len);
        let n_agents = parts.description.n_agents;
        let (given, expected) = (actions.len(), envs * n_agents);
        if given != expected {
            return Err(ClientError::WrongLength { given, envs, n_agents, expected });
        }
        parts.validator.reserve_step(parts.requests + 1, actions, env_ids)?;
        parts.send(RequestKind::Step, env_ids, actions, wait)
    }

    /// Waits for the next batch.
    pub fn recv(&mut self, wait: WaitOptions<'_>) -> Result<Batch, ClientError> {
        self.recv_since(Instant::now(), wait)
    }

    /// The timeout counts from `begin`.
    fn recv_since(&mut self, begin: Instant, wait: WaitOptions<'_>) -> Result<Batch, ClientError> {
        let parts = self.working_parts()?;
        let (outstanding, batch_size) = (parts.validator.outstanding(), parts.description.batch_size);
        if outstanding < batch_size {
            return Err(ClientError::NothingToReceive { outstanding, batch_size });
        }
        let sample = parts.wait_for_sample(begin, wait)?;
        parts.validator.observe_batch(&parts.layout, sample.payload());
        Ok(Batch::new(sample, Arc::clone(&parts.layout), Arc::clone(&parts.frames)))
    }

    /// [`send_reset`](Client::send_reset) and [`recv`](Client::recv).
    pub fn reset(
        &mut self,
        seed: Option<u64>,
        env_ids: Option<&[i32]>,
        mut wait: WaitOptions<'_>,
    ) -> Result<Batch, ClientError> {
        let begin = Instant::now();
        self.send_reset(seed, env_ids, wait.reborrow())?;
        self.recv_since(begin, wait)
    }

    /// [`send`](Client::send) and [`recv`](Client::recv).
    pub fn step(
        &mut self,
        actions: &[i32],
        env_ids: Option<&[i32]>,
        mut wait: WaitOptions<'_>,
    ) -> Result<Batch, ClientError> {
        let begin = Instant::now();
        self.send(actions, env_ids, wait.reborrow())?;
        self.recv_since(begin, wait)
    }

    /// Draws uniformly random legal actions into `out`, `[count, n_agents]`, for the environments of
    /// `env_ids` or for all in order, by what was last received of each.
    pub fn sample_actions(&mut self, env_ids: Option<&[i32]>, out: &mut [i32]) -> Result<(), ClientError> {
        let parts = self.parts()?;
        let envs = env_ids.map_or(parts.description.num_envs, <[i32]>::len);
        let n_agents = parts.description.n_agents;
        if out.len() != envs * n_agents {
            let (given, expected) = (out.len(), envs * n_agents);
            return Err(ClientError::WrongLength { given, envs, n_agents, expected });
        }
        Ok(parts.validator.sample(env_ids, out)?)
    }

    /// Seeds the generator of [`sample_actions`](Client::sample_actions).
    pub fn seed_sampler(&mut self, seed: u64) {
        self.parts.validator.seed_sampler(seed);
    }

    fn parts(&mut self) -> Result<&mut Parts, ClientError> {
        if self.owner == std::process::id() {
            Ok(&mut self.parts)
        } else {
            Err(ClientError::Forked { owner: self.owner })
        }
    }

    fn working_parts(&mut self) -> Result<&mut Parts, ClientError> {
        let parts = self.parts()?;
        match &parts.failure {
            Some(failure) => Err(failure.clone().into()),
            None => Ok(parts),
        }
    }
}

impl Drop for Client {
    #[allow(unsafe_code)]
    fn drop(&mut self) {
        // A forked child must not take its parent's ports down.
        if self.owner == std::process::id() {
            // SAFETY: dropped once, here, and not used after.
            unsafe { ManuallyDrop::drop(&mut self.parts) }
        }
    }
}

impl Parts {
    fn send(
        &mut self,
        kind: RequestKind,
        env_ids: Option<&[i32]>,
        actions: &[i32],
        wait: WaitOptions<'_>,
    ) -> Result<(), ClientError> {
        self.requests += 1;
        let count = env_ids.map_or(self.description.num_envs, <[i32]>::len);
        let header = RequestHeader::new(&self.layout, self.session, self.requests, kind, count);
        let sent = self.deliver(header, count, env_ids, actions, wait);
        if sent.is_err() {
            self.validator.refused(self.requests);
        }
        sent
    }

    /// Writes the request into shared memory and sends it; waits while the supervisor has too many unread.
    fn deliver(
        &mut self,
        header: RequestHeader,
        count: usize,
        env_ids: Option<&[i32]>,
        actions: &[i32],
        wait: WaitOptions<'_>,
    ) -> Result<(), ClientError> {
        let time = wait.timeout.map_or(SEND_TIMEOUT, |timeout| timeout.min(SEND_TIMEOUT));
        let bytes = match actions {
            [] => count * size_of::<i32>(),
            _ => step_bytes(count, self.description.n_agents),
        };
        let begin = Instant::now();
        let mut look = begin + CHECK_INTERVAL;
        loop {
            let mut sample =
                self.publisher.loan_slice(bytes).map_err(doing("loaning memory for a request"))?;
            *sample.user_header_mut() = header;
            let payload = sample.payload_mut();
            let ids: &mut [i32] = bytemuck::cast_slice_mut(&mut payload[..count * size_of::<i32>()]);
            match env_ids {
                Some(given) => ids.copy_from_slice(given),
                None => ids.iter_mut().zip(0..).for_each(|(id, env)| *id = env),
            }
            if !actions.is_empty() {
                payload[actions_offset(count)..].copy_from_slice(bytemuck::cast_slice(actions));
            }
            let delivered = sample.send();
            let _ = self.work.notify(); // fails only if the supervisor's bell is gone, and so is the supervisor
            if matches!(delivered, Ok(receivers) if receivers > 0) {
                return Ok(());
            }
            if !self.control.is_alive() {
                return Err(self.pool_died());
            }
            let now = Instant::now();
            if now - begin > time {
                return Err(ClientError::NotAccepted { time });
            }
            if now >= look {
                look = now + CHECK_INTERVAL;
                if (wait.interrupted)() {
                    return Err(ClientError::Interrupted);
                }
            }
            std::thread::sleep(Duration::from_micros(50));
        }
    }

    fn wait_for_sample(&mut self, begin: Instant, wait: WaitOptions<'_>) -> Result<FrameSample, ClientError> {
        let spin_until = self.spin.map(|time| begin + time);
        // A timeout beyond what an `Instant` can hold is no limit.
        let end = wait.timeout.and_then(|timeout| begin.checked_add(timeout));
        let mut look = begin + CHECK_INTERVAL;
        loop {
            if let Some(sample) = self.receive()? {
                return Ok(sample);
            }
            let now = Instant::now();
            if end.is_some_and(|end| now >= end) {
                return Err(ClientError::Timeout(wait.timeout.unwrap_or_default()));
            }
            if now >= look {
                look = now + CHECK_INTERVAL;
                if !self.control.is_alive() {
                    // It may have answered before it died.
                    return self.receive()?.ok_or_else(|| self.pool_died());
                }
                if (wait.interrupted)() {
                    return Err(ClientError::Interrupted);
                }
            }
            if spin_until.is_none_or(|spin_until| now < spin_until) {
                std::thread::yield_now();
                continue;
            }
            let wake = end.map_or(look, |end| look.min(end));
            // Whatever ends this wait, the loop looks again.
            let _ = self.listener.timed_wait(|_| {}, wake - now);
        }
    }

    /// The next frame that is for us, if there is one.
    fn receive(&mut self) -> Result<Option<FrameSample>, ClientError> {
        loop {
            let sample = match self.frames.subscriber.receive() {
                Ok(Some(sample)) => sample,
                Ok(None) => return Ok(None),
                Err(ReceiveError::ExceedsMaxBorrows) => {
                    return Err(ClientError::TooManyHeld {
                        limit: self.description.capacity.max_held_batches,
                    });
                }
                Err(error) => return Err(doing("receiving a frame")(error).into()),
            };
            let header = *sample.user_header();
            let content = match read_frame(&header, sample.payload(), &self.layout) {
                Some(content) if header.session == self.session => content,
                _ => continue,
            };
            // What is left of an earlier round may overflow, and nobody misses it.
            if header.epoch == self.epoch
                && let Some((first, last)) =
                    frames_lost(std::mem::replace(&mut self.sequence, header.sequence), header.sequence)
            {
                return Err(ClientError::FramesLost { first, last });
            }
            match content {
                Content::Rejection { request, rejection } => self.rejection(request, rejection)?,
                Content::Batch if header.epoch == self.epoch => return Ok(Some(sample)),
                Content::Batch => {}
            }
        }
    }

    /// Raises a rejection of a request that is still waited for.
    fn rejection(&mut self, request: u64, rejection: Rejection) -> Result<(), ClientError> {
        if matches!(rejection, Rejection::LaneFailed { .. }) {
            self.failure = Some(rejection.clone());
        } else if !self.validator.refused(request) {
            return Ok(());
        }
        Err(rejection.into())
    }

    fn pool_died(&self) -> ClientError {
        ClientError::PoolDied { pool: self.description.pool.clone() }
    }
}

type Ports = (RequestPublisher, FramePort, IpcListener, IpcNotifier, (LaneServices, WorkEvent), IpcNode);

/// What a learner needs of iceoryx2.
fn open_ports(
    runtime_dir: &RuntimeDir,
    lane: &LaneDescription,
    layout: &Layout,
) -> Result<Ports, ConnectError> {
    let (capacity, num_envs) = (lane.capacity, lane.num_envs);
    check_room(capacity.request_memory(layout, num_envs) + PORTS, "requests of a learner")?;
    let ipc_node = open_node(runtime_dir, &format!("learner of {}", lane.pool))?;
    let services = LaneServices::open(&ipc_node.node, &lane.instance, &lane.lane)?;
    let work_event = WorkEvent::open(&ipc_node.node, &lane.instance)?;
    let publisher = services.request_publisher(layout, num_envs, capacity)?;
    reserve_segments(runtime_dir, "requests of a learner", &mut || false)?;
    let frames = services.frame_port(capacity.frames_waiting, &ipc_node)?;
    let (listener, work) = (services.frame_listener()?, work_event.notifier()?);
    Ok((publisher, frames, listener, work, (services, work_event), ipc_node))
}

pub(crate) fn checked_layout(description: &LaneDescription) -> Result<Layout, ConnectError> {
    let layout = description.layout()?;
    if layout.hash() != description.layout_hash {
        let lane = description.lane.clone();
        return Err(ConnectError::Layout { lane, theirs: description.layout_hash, ours: layout.hash() });
    }
    Ok(layout)
}
