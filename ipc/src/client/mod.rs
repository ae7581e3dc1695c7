//! A learner's end of a lane: attach, reset, send, receive. The same for a supervisor in another process and
//! for one in this process.

mod error;

pub use error::{ClientError, ConnectError};

use crate::batch::Batch;
use crate::control::client::{ANSWER_TIME, ControlClient, ControlError};
use crate::control::protocol::{Answer, Ask, LaneDescription, PROTOCOL_VERSION, Refusal};
use crate::legal::Legal;
use crate::memory::{PORTS, check_room, reserve_segments};
use crate::place::Place;
use crate::services::{
    FramePort, FrameSample, Guest, IpcListener, IpcNotifier, LaneServices, RequestPublisher, WorkEvent,
    doing, enter,
};
use crate::wire::{Content, RequestHeader, actions_offset, frames_lost, read_frame, step_bytes};
use iceoryx2::port::ReceiveError;
use smaclite_pool::layout::Layout;
use smaclite_pool::transport::RequestKind;
use smaclite_pool::{Rejection, Wait};
use std::mem::ManuallyDrop;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A blocked client looks this often whether its supervisor lives and its caller wants to stop.
const LOOK_AROUND: Duration = Duration::from_millis(100);

/// How often a learner looks for a pool that is not there yet.
const LOOK_AGAIN: Duration = Duration::from_millis(20);

/// Workers take requests between two runs of environments; a supervisor that does not is stopped.
const ACCEPT_TIME: Duration = Duration::from_secs(5);

/// How to wait.
pub struct Patience<'a> {
    /// Give up after this long.
    pub timeout: Option<Duration>,
    /// Asked at least every 100 ms while blocked; `true` ends the wait.
    pub interrupted: &'a mut dyn FnMut() -> bool,
}

impl Patience<'static> {
    /// Without a timeout, and not to be interrupted.
    pub fn forever() -> Self {
        // A closure that captures nothing takes no memory, so nothing leaks.
        Patience { timeout: None, interrupted: Box::leak(Box::new(|| false)) }
    }
}

impl Patience<'_> {
    /// The same, for one of several waits in a row.
    fn share(&mut self) -> Patience<'_> {
        Patience { timeout: self.timeout, interrupted: &mut *self.interrupted }
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
    _guest: Guest,
    control: ControlClient,
    description: LaneDescription,
    layout: Arc<Layout>,
    legal: Legal,
    session: u64,
    round: u64,
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
        place: &Place,
        pool: &str,
        lane: Option<&str>,
        wait: Wait,
    ) -> Result<Client, ConnectError> {
        let patience = Patience { timeout: Some(Duration::ZERO), interrupted: &mut || false };
        Client::connect_within(place, pool, lane, wait, patience)
    }

    /// Attaches to a lane of a pool, and waits until the pool appears and answers. With a timeout of zero it
    /// must run already, and has 10 seconds to answer.
    pub fn connect_within(
        place: &Place,
        pool: &str,
        lane: Option<&str>,
        wait: Wait,
        patience: Patience<'_>,
    ) -> Result<Client, ConnectError> {
        let Patience { timeout, interrupted } = patience;
        let begin = Instant::now();
        loop {
            let left = timeout.map(|time| time.saturating_sub(begin.elapsed()));
            let for_answer = match timeout {
                Some(Duration::ZERO) => Some(ANSWER_TIME),
                _ => left.map(|left| left.max(LOOK_AROUND)),
            };
            let patience = Patience { timeout: for_answer, interrupted: &mut *interrupted };
            match Client::attach(place, pool, lane, wait, patience) {
                Err(ConnectError::Control(ControlError::NoSuchPool { .. } | ControlError::Gone { .. }))
                    if left != Some(Duration::ZERO) =>
                {
                    if interrupted() {
                        return Err(ControlError::Interrupted { pool: pool.to_owned() }.into());
                    }
                    std::thread::sleep(left.map_or(LOOK_AGAIN, |left| left.min(LOOK_AGAIN)));
                }
                outcome => return outcome,
            }
        }
    }

    fn attach(
        place: &Place,
        pool: &str,
        lane: Option<&str>,
        wait: Wait,
        patience: Patience<'_>,
    ) -> Result<Client, ConnectError> {
        let question = Ask::Attach { version: PROTOCOL_VERSION, lane: lane.map(str::to_owned) };
        let (control, answer) = ControlClient::ask(place, pool, &question, patience)?;
        let (session, description) = match answer {
            Answer::Attached { session, lane } => (session, *lane),
            Answer::Refused(refusal) => return Err(refusal.into()),
            other => return Err(Refusal::unexpected(&other).into()),
        };
        let layout = Arc::new(checked_layout(&description)?);
        let spin = wait.spin_time(description.threads);
        let ports = open_ports(place, &description, &layout).map_err(|error| control.cause_of(error))?;
        let (publisher, frames, listener, work, services, guest) = ports;
        let parts = Parts {
            publisher,
            frames: Arc::new(frames),
            listener,
            work,
            _services: services,
            _guest: guest,
            control,
            legal: Legal::new(&layout, description.num_envs, description.autoreset),
            description,
            layout,
            session,
            round: 0,
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
        patience: Patience<'_>,
    ) -> Result<(), ClientError> {
        let parts = self.working_parts()?;
        let number = parts.requests + 1;
        let kind = RequestKind::Reset { seed };
        if let Some(ids) = env_ids
            && !parts.legal.is_whole(env_ids)
        {
            parts.legal.take_reset(number, ids)?;
            return parts.send(kind, env_ids, &[], patience);
        }
        // Only a reset that was sent begins a round: otherwise what is under way is still to come.
        parts.send(kind, env_ids, &[], patience)?;
        parts.legal.take_whole_reset(number);
        parts.round = number;
        parts.sequence = 0;
        Ok(())
    }

    /// Sends actions, `[count, n_agents]`, to the environments of `env_ids` or to all in order. Returns as
    /// [`send_reset`](Client::send_reset) does.
    pub fn send(
        &mut self,
        actions: &[i32],
        env_ids: Option<&[i32]>,
        patience: Patience<'_>,
    ) -> Result<(), ClientError> {
        let parts = self.working_parts()?;
        let envs = env_ids.map_or(parts.description.num_envs, <[i32]>::len);
        let n_agents = parts.description.n_agents;
        let (given, expected) = (actions.len(), envs * n_agents);
        if given != expected {
            return Err(ClientError::WrongLength { given, envs, n_agents, expected });
        }
        parts.legal.take_step(parts.requests + 1, actions, env_ids)?;
        parts.send(RequestKind::Step, env_ids, actions, patience)
    }

    /// Waits for the next batch.
    pub fn recv(&mut self, patience: Patience<'_>) -> Result<Batch, ClientError> {
        self.recv_since(Instant::now(), patience)
    }

    /// The timeout counts from `begin`.
    fn recv_since(&mut self, begin: Instant, patience: Patience<'_>) -> Result<Batch, ClientError> {
        let parts = self.working_parts()?;
        let (outstanding, batch_size) = (parts.legal.outstanding(), parts.description.batch_size);
        if outstanding < batch_size {
            return Err(ClientError::NothingToReceive { outstanding, batch_size });
        }
        let sample = parts.wait_for_sample(begin, patience)?;
        parts.legal.learn(&parts.layout, sample.payload());
        Ok(Batch::new(sample, Arc::clone(&parts.layout), Arc::clone(&parts.frames)))
    }

    /// [`send_reset`](Client::send_reset) and [`recv`](Client::recv).
    pub fn reset(
        &mut self,
        seed: Option<u64>,
        env_ids: Option<&[i32]>,
        mut patience: Patience<'_>,
    ) -> Result<Batch, ClientError> {
        let begin = Instant::now();
        self.send_reset(seed, env_ids, patience.share())?;
        self.recv_since(begin, patience)
    }

    /// [`send`](Client::send) and [`recv`](Client::recv).
    pub fn step(
        &mut self,
        actions: &[i32],
        env_ids: Option<&[i32]>,
        mut patience: Patience<'_>,
    ) -> Result<Batch, ClientError> {
        let begin = Instant::now();
        self.send(actions, env_ids, patience.share())?;
        self.recv_since(begin, patience)
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
        Ok(parts.legal.sample(env_ids, out)?)
    }

    /// Seeds the generator of [`sample_actions`](Client::sample_actions).
    pub fn seed_sampler(&mut self, seed: u64) {
        self.parts.legal.seed_sampler(seed);
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
        patience: Patience<'_>,
    ) -> Result<(), ClientError> {
        self.requests += 1;
        let count = env_ids.map_or(self.description.num_envs, <[i32]>::len);
        let header = RequestHeader::new(&self.layout, self.session, self.requests, kind, count);
        let sent = self.deliver(header, count, env_ids, actions, patience);
        if sent.is_err() {
            self.legal.refused(self.requests);
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
        patience: Patience<'_>,
    ) -> Result<(), ClientError> {
        let time = patience.timeout.map_or(ACCEPT_TIME, |timeout| timeout.min(ACCEPT_TIME));
        let bytes = match actions {
            [] => count * size_of::<i32>(),
            _ => step_bytes(count, self.description.n_agents),
        };
        let begin = Instant::now();
        let mut look = begin + LOOK_AROUND;
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
                look = now + LOOK_AROUND;
                if (patience.interrupted)() {
                    return Err(ClientError::Interrupted);
                }
            }
            std::thread::sleep(Duration::from_micros(50));
        }
    }

    fn wait_for_sample(
        &mut self,
        begin: Instant,
        patience: Patience<'_>,
    ) -> Result<FrameSample, ClientError> {
        let spin_until = self.spin.map(|time| begin + time);
        // A timeout beyond what an `Instant` can hold is no limit.
        let end = patience.timeout.and_then(|timeout| begin.checked_add(timeout));
        let mut look = begin + LOOK_AROUND;
        loop {
            if let Some(sample) = self.receive()? {
                return Ok(sample);
            }
            let now = Instant::now();
            if end.is_some_and(|end| now >= end) {
                return Err(ClientError::Timeout(patience.timeout.unwrap_or_default()));
            }
            if now >= look {
                look = now + LOOK_AROUND;
                if !self.control.is_alive() {
                    // It may have answered before it died.
                    return self.receive()?.ok_or_else(|| self.pool_died());
                }
                if (patience.interrupted)() {
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
            if header.round == self.round
                && let Some((first, last)) =
                    frames_lost(std::mem::replace(&mut self.sequence, header.sequence), header.sequence)
            {
                return Err(ClientError::FramesLost { first, last });
            }
            match content {
                Content::Rejection { request, rejection } => self.rejection(request, rejection)?,
                Content::Batch if header.round == self.round => return Ok(Some(sample)),
                Content::Batch => {}
            }
        }
    }

    /// Raises a rejection of a request that is still waited for.
    fn rejection(&mut self, request: u64, rejection: Rejection) -> Result<(), ClientError> {
        if matches!(rejection, Rejection::LaneFailed { .. }) {
            self.failure = Some(rejection.clone());
        } else if !self.legal.refused(request) {
            return Ok(());
        }
        Err(rejection.into())
    }

    fn pool_died(&self) -> ClientError {
        ClientError::PoolDied { pool: self.description.pool.clone() }
    }
}

type Ports = (RequestPublisher, FramePort, IpcListener, IpcNotifier, (LaneServices, WorkEvent), Guest);

/// What a learner needs of iceoryx2.
fn open_ports(place: &Place, lane: &LaneDescription, layout: &Layout) -> Result<Ports, ConnectError> {
    let (capacity, num_envs) = (lane.capacity, lane.num_envs);
    check_room(capacity.request_memory(layout, num_envs) + PORTS, "requests of a learner")?;
    let guest = enter(place, &format!("learner of {}", lane.pool))?;
    let services = LaneServices::open(&guest.node, &lane.instance, &lane.lane)?;
    let work_event = WorkEvent::open(&guest.node, &lane.instance)?;
    let publisher = services.request_publisher(layout, num_envs, capacity)?;
    reserve_segments(place, "requests of a learner", &mut || false)?;
    let frames = services.frame_port(capacity.frames_waiting, &guest)?;
    let (listener, work) = (services.frame_listener()?, work_event.notifier()?);
    Ok((publisher, frames, listener, work, (services, work_event), guest))
}

pub(crate) fn checked_layout(description: &LaneDescription) -> Result<Layout, ConnectError> {
    let layout = description.layout()?;
    if layout.hash() != description.layout_hash {
        let lane = description.lane.clone();
        return Err(ConnectError::Layout { lane, theirs: description.layout_hash, ours: layout.hash() });
    }
    Ok(layout)
}
