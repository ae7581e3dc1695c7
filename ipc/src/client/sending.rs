//! From the learner to the lane: a request is checked, written into shared memory, and sent.

use super::error::ClientError;
use super::{Actions, AttachedLane};
use crate::CHECK_INTERVAL;
use crate::services::doing;
use crate::wait_options::WaitOptions;
use crate::wire::{RequestHeader, body_offset, request_bytes};
use smaclite_engine::{RecordLayout, RecordSizes, SnapshotError};
use smaclite_pool::env_ids::env_index;
use smaclite_pool::transport::{MAX_AHEAD, RequestKind};
use smaclite_pool::{Deadline, Rejection};
use std::time::{Duration, Instant};

/// How long a supervisor may leave its queue of requests full. Even its busy workers look for requests after
/// every few environments; one that does not accept any in this time is stopped.
const SEND_TIMEOUT: Duration = Duration::from_secs(5);

/// How often to try again while the queue is full.
const RETRY_INTERVAL: Duration = Duration::from_micros(50);

/// What follows the environments of a request.
enum Body<'a> {
    Nothing,
    Actions(&'a mut dyn Actions),
    Snapshots(&'a [u8]),
    Levels(&'a [f32]),
    Envs(&'a [i32]),
}

impl Body<'_> {
    fn write_to(&mut self, out: &mut [u8]) {
        match self {
            Body::Nothing => {}
            Body::Actions(actions) => actions.write_to(bytemuck::cast_slice_mut(out)),
            Body::Snapshots(records) => out.copy_from_slice(records),
            Body::Levels(levels) => out.copy_from_slice(bytemuck::cast_slice(levels)),
            Body::Envs(envs) => out.copy_from_slice(bytemuck::cast_slice(envs)),
        }
    }
}

impl AttachedLane {
    /// Sends actions, `[count, n_actors]`.
    pub(super) fn send_step(
        &mut self,
        actions: &mut dyn Actions,
        env_ids: Option<&[i32]>,
        wait: &mut WaitOptions<'_>,
    ) -> Result<(), ClientError> {
        self.check_length(actions.count(), env_ids)?;
        self.epochs.outstanding_mut().reserve_step(self.last_request.next(), env_ids)?;
        self.send(RequestKind::Step, env_ids, Body::Actions(actions), wait)
    }

    pub(super) fn send_reset(
        &mut self,
        seed: Option<u64>,
        env_ids: Option<&[i32]>,
        levels: Option<&[f32]>,
        wait: &mut WaitOptions<'_>,
    ) -> Result<(), ClientError> {
        if let Some(levels) = levels {
            self.check_levels(levels, env_ids)?;
        }
        let number = self.last_request.next();
        let kind = RequestKind::Reset { seed, levels: levels.is_some() };
        let body = levels.map_or(Body::Nothing, Body::Levels);
        if let Some(ids) = env_ids
            && !self.epochs.outstanding().names_all(ids)
        {
            self.epochs.outstanding_mut().reserve_some(number, ids)?;
            return self.send(kind, env_ids, body, wait);
        }
        // Only a reset that was sent begins an epoch: otherwise results of the current one are still to come.
        self.check_ahead()?;
        self.send(kind, env_ids, body, wait)?;
        // Of a plain one there is nothing to refuse, unless the learner of the other side asks for something
        // else.
        self.epochs.begin(number, levels.is_some() || self.side.is_some());
        Ok(())
    }

    /// Whether the learner of a side may send one request more before the other learner sends its own.
    fn check_ahead(&self) -> Result<(), Rejection> {
        match self.side {
            Some(side) if self.epochs.unanswered() >= MAX_AHEAD => {
                Err(Rejection::TooFarAhead { side, waiting: MAX_AHEAD })
            }
            _ => Ok(()),
        }
    }

    fn check_levels(&self, levels: &[f32], env_ids: Option<&[i32]>) -> Result<(), ClientError> {
        let (envs, size) = (self.count(env_ids), self.layout.level_len());
        if self.side.is_some() {
            return Err(ClientError::OneSide);
        }
        if size == 0 {
            return Err(ClientError::NoLevels);
        }
        let given = levels.len();
        if given == envs * size { Ok(()) } else { Err(ClientError::WrongLevels { given, envs, size }) }
    }

    /// Sends snapshots, `[count, snapshot_size]`.
    pub(super) fn send_restore(
        &mut self,
        snapshots: &[u8],
        env_ids: Option<&[i32]>,
        seed: Option<u64>,
        wait: &mut WaitOptions<'_>,
    ) -> Result<(), ClientError> {
        let (envs, size) = (self.count(env_ids), self.layout.snapshot_size());
        if size == 0 {
            return Err(ClientError::NoSnapshots);
        }
        if snapshots.len() != envs * size {
            let difference = self.difference(snapshots, envs);
            return Err(ClientError::WrongSnapshots { given: snapshots.len(), envs, size, difference });
        }
        self.send_to_some(RequestKind::Restore { seed }, env_ids, Body::Snapshots(snapshots), wait)
    }

    /// What differs between the battles of snapshots, of which there are `count`, and those of the lane.
    fn difference(&self, snapshots: &[u8], count: usize) -> Option<String> {
        let size = snapshots.len() / count.max(1);
        let given = match RecordLayout::of(snapshots.get(..size)?) {
            Ok(layout) => layout.sizes(),
            Err(SnapshotError::Size { expected, .. }) if snapshots.len().is_multiple_of(expected.max(1)) => {
                return Some(format!("these are {} snapshots", snapshots.len() / expected.max(1)));
            }
            Err(error) => return Some(error.to_string()),
        };
        let settings = &self.description.settings;
        let expected = RecordSizes::new(&self.description.sizes, settings.n_past());
        let units = |of: RecordSizes| (of.n_agents, of.n_enemies);
        Some(if units(given) != units(expected) {
            format!(
                "they are of battles of {} agents and {} enemies, and these have {} and {}",
                given.n_agents, given.n_enemies, expected.n_agents, expected.n_enemies
            )
        } else if given.n_past != expected.n_past {
            format!(
                "they are of a lane with `obs_last_actions` {}, and this one has {} (a team that plays the \
                 enemies can need more of them)",
                given.n_past, expected.n_past
            )
        } else {
            "they are of battles with other options of `smacv2`".to_owned()
        })
    }

    /// Sends the environments to copy, `[count]`.
    pub(super) fn send_fork(
        &mut self,
        from: &[i32],
        to: &[i32],
        seed: Option<u64>,
        wait: &mut WaitOptions<'_>,
    ) -> Result<(), ClientError> {
        if from.len() != to.len() {
            return Err(ClientError::WrongForks { from: from.len(), to: to.len() });
        }
        let num_envs = self.description.settings.num_envs;
        from.iter().try_for_each(|env| env_index(*env, num_envs).map(drop))?;
        self.send_to_some(RequestKind::Fork { seed }, Some(to), Body::Envs(from), wait)
    }

    fn send_to_some(
        &mut self,
        kind: RequestKind,
        env_ids: Option<&[i32]>,
        body: Body<'_>,
        wait: &mut WaitOptions<'_>,
    ) -> Result<(), ClientError> {
        let all: Vec<i32>;
        let ids = match env_ids {
            Some(ids) => ids,
            None => {
                all = (0..self.description.settings.num_envs as i32).collect();
                &all
            }
        };
        if self.side.is_some() {
            return Err(ClientError::OneSide);
        }
        self.epochs.outstanding_mut().reserve_some(self.last_request.next(), ids)?;
        self.send(kind, Some(ids), body, wait)
    }

    /// Sends a request whose environments are reserved, and frees them if it cannot be sent. Its number is
    /// used up only if it was: the learners of two sides count together.
    fn send(
        &mut self,
        kind: RequestKind,
        env_ids: Option<&[i32]>,
        mut body: Body<'_>,
        wait: &mut WaitOptions<'_>,
    ) -> Result<(), ClientError> {
        let number = self.last_request.next();
        if let Some(participant) = &mut self.participant {
            participant.join();
        }
        let count = self.count(env_ids);
        let header = RequestHeader::new(&self.layout, self.session, self.side, number, kind, count);
        let mut full_queue = None;
        loop {
            let ended = match self.try_send(&header, kind, env_ids, &mut body) {
                Ok(true) => {
                    self.last_request = number;
                    return Ok(());
                }
                Ok(false) if !self.control.is_alive() => Err(self.pool_died()),
                Ok(false) => full_queue.get_or_insert_with(|| FullQueue::new(wait.timeout)).wait(wait),
                Err(error) => Err(error),
            };
            if ended.is_err() {
                self.epochs.outstanding_mut().release(number);
                return ended;
            }
        }
    }

    /// Writes the request into shared memory and sends it; `false` if the supervisor's queue is full.
    fn try_send(
        &self,
        header: &RequestHeader,
        kind: RequestKind,
        env_ids: Option<&[i32]>,
        body: &mut Body<'_>,
    ) -> Result<bool, ClientError> {
        let count = header.count as usize;
        let loan = self.ports.requests.loan_slice(request_bytes(&self.layout, kind, count));
        let mut sample = loan.map_err(doing("loaning memory for a request"))?;
        *sample.user_header_mut() = *header;
        let payload = sample.payload_mut();
        let ids: &mut [i32] = bytemuck::cast_slice_mut(&mut payload[..count * size_of::<i32>()]);
        match env_ids {
            Some(given) => ids.copy_from_slice(given),
            None => ids.iter_mut().zip(0..).for_each(|(id, env)| *id = env),
        }
        body.write_to(payload.get_mut(body_offset(count)..).unwrap_or_default());
        let delivered = sample.send();
        match &self.participant {
            Some(participant) => participant.accept(),
            // Fails only if the supervisor's event is gone, and then so is the supervisor.
            None => drop(self.ports.work.notify()),
        }
        Ok(matches!(delivered, Ok(receivers) if receivers > 0))
    }
}

/// The wait for room in the supervisor's queue of requests.
struct FullQueue {
    timeout: Duration,
    deadline: Deadline,
    next_check: Instant,
}

impl FullQueue {
    fn new(timeout: Option<Duration>) -> Self {
        let timeout = timeout.map_or(SEND_TIMEOUT, |timeout| timeout.min(SEND_TIMEOUT));
        let begin = Instant::now();
        FullQueue { timeout, deadline: Deadline::new(begin, timeout), next_check: begin + CHECK_INTERVAL }
    }

    /// Sleeps until the next attempt, unless the time is over or the caller interrupts the wait.
    fn wait(&mut self, wait: &mut WaitOptions<'_>) -> Result<(), ClientError> {
        let now = Instant::now();
        if self.deadline.left(now).is_zero() {
            return Err(ClientError::NotAccepted { time: self.timeout });
        }
        if now >= self.next_check {
            self.next_check = now + CHECK_INTERVAL;
            if (wait.interrupted)() {
                return Err(ClientError::Interrupted);
            }
        }
        std::thread::sleep(RETRY_INTERVAL);
        Ok(())
    }
}
