//! From the learner to the lane: a request is checked, and then written into shared memory and sent, or, to a
//! lane of this process, ordered by this thread.

use super::AttachedLane;
use super::error::ClientError;
use crate::CHECK_INTERVAL;
use crate::services::doing;
use crate::wait_options::WaitOptions;
use crate::wire::{RequestHeader, body_offset, request_bytes};
use smaclite_engine::{RecordLayout, RecordSizes, SnapshotError};
use smaclite_pool::env_ids::env_index;
use smaclite_pool::transport::{Request, RequestKind, RequestNumber};
use smaclite_pool::{Deadline, Rejection};
use std::borrow::Cow;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How long a supervisor may leave its queue of requests full. Even while it works it looks for requests
/// after every few environments; one that does not accept any in this time is stopped.
const SEND_TIMEOUT: Duration = Duration::from_secs(5);

/// How often to try again while the queue is full.
const RETRY_INTERVAL: Duration = Duration::from_micros(50);

impl AttachedLane {
    /// Sends actions, `[count, n_actors]`.
    pub(super) fn send_step(
        &mut self,
        actions: &[i32],
        env_ids: Option<&[i32]>,
        wait: &mut WaitOptions<'_>,
    ) -> Result<(), ClientError> {
        self.check_length(actions.len(), env_ids)?;
        let all = Arc::clone(&self.all_ids);
        let ids = env_ids.unwrap_or(&all);
        let reserved = self.outstanding.reserve_step(self.last_request.next(), ids);
        reserved.map_err(|rejection| self.refused(rejection))?;
        self.send(RequestKind::Step, ids, bytemuck::cast_slice(actions), wait)
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
        let body = bytemuck::cast_slice(levels.unwrap_or_default());
        let all = Arc::clone(&self.all_ids);
        let ids = env_ids.unwrap_or(&all);
        if env_ids.is_some() && !self.outstanding.names_all(ids) {
            let reserved = self.outstanding.reserve_some(number, ids);
            reserved.map_err(|rejection| self.refused(rejection))?;
            return self.send(kind, ids, body, wait);
        }
        // Only a reset that was sent begins an epoch: otherwise results of the present one are still to come.
        self.refused.clear();
        self.send(kind, ids, body, wait)?;
        self.outstanding.reset_all(number);
        (self.epoch, self.sequence) = (Some(number), None);
        Ok(())
    }

    fn check_levels(&self, levels: &[f32], env_ids: Option<&[i32]>) -> Result<(), ClientError> {
        let (envs, size) = (self.count(env_ids), self.layout.level_len());
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
        let all = Arc::clone(&self.all_ids);
        self.send_to_some(RequestKind::Restore { seed }, env_ids.unwrap_or(&all), snapshots, wait)
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
        } else if given.n_phases != expected.n_phases {
            "of the two battles one has rules `starcraft`, and the other has not".to_owned()
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
        self.send_to_some(RequestKind::Fork { seed }, to, bytemuck::cast_slice(from), wait)
    }

    fn send_to_some(
        &mut self,
        kind: RequestKind,
        ids: &[i32],
        body: &[u8],
        wait: &mut WaitOptions<'_>,
    ) -> Result<(), ClientError> {
        let reserved = self.outstanding.reserve_some(self.last_request.next(), ids);
        reserved.map_err(|rejection| self.refused(rejection))?;
        self.send(kind, ids, body, wait)
    }

    /// Why a request is not sent. The results of a pool that has died never arrive, so its environments would
    /// be busy without end.
    fn refused(&self, rejection: Rejection) -> ClientError {
        let has_died = self.local.is_none() && !self.control.is_alive();
        if has_died { self.pool_died() } else { rejection.into() }
    }

    /// Sends a request whose environments are reserved, and frees them if it cannot be sent.
    fn send(
        &mut self,
        kind: RequestKind,
        ids: &[i32],
        body: &[u8],
        wait: &mut WaitOptions<'_>,
    ) -> Result<(), ClientError> {
        let number = self.last_request.next();
        let sent = match &mut self.local {
            None => self.send_message(number, kind, ids, body, wait),
            Some(local) => {
                let request =
                    Request { session: self.session, number, kind, env_ids: ids, body: &integers(body) };
                // As a lane of another process does, it answers when its results are received.
                self.refused.extend(local.order(&request).err().map(|rejection| (number, rejection)));
                Ok(())
            }
        };
        match sent {
            Ok(()) => self.last_request = number,
            Err(_) => drop(self.outstanding.release(number)),
        }
        sent
    }

    /// Sends a request to another process.
    fn send_message(
        &self,
        number: RequestNumber,
        kind: RequestKind,
        ids: &[i32],
        body: &[u8],
        wait: &mut WaitOptions<'_>,
    ) -> Result<(), ClientError> {
        let header = RequestHeader::new(&self.layout, self.session, number, kind, ids.len());
        let mut full_queue = None;
        while !self.try_send(&header, ids, body, request_bytes(&self.layout, kind, ids.len()))? {
            if !self.control.is_alive() {
                return Err(self.pool_died());
            }
            full_queue.get_or_insert_with(|| FullQueue::new(wait.timeout)).wait(wait)?;
        }
        Ok(())
    }

    /// Writes the request into shared memory and sends it; `false` if the supervisor's queue is full.
    fn try_send(
        &self,
        header: &RequestHeader,
        ids: &[i32],
        body: &[u8],
        bytes: usize,
    ) -> Result<bool, ClientError> {
        let mut sample =
            self.ports.requests.loan_slice(bytes).map_err(doing("loaning memory for a request"))?;
        *sample.user_header_mut() = *header;
        let payload = sample.payload_mut();
        payload[..size_of_val(ids)].copy_from_slice(bytemuck::cast_slice(ids));
        payload.get_mut(body_offset(ids.len())..).unwrap_or_default().copy_from_slice(body);
        let delivered = sample.send();
        // Fails only if the supervisor's event is gone, and then so is the supervisor.
        let _ = self.ports.work.notify();
        Ok(matches!(delivered, Ok(receivers) if receivers > 0))
    }
}

/// Bytes as integers; copied if they are not aligned, which those of snapshots need not be.
fn integers(bytes: &[u8]) -> Cow<'_, [i32]> {
    match bytemuck::try_cast_slice(bytes) {
        Ok(integers) => Cow::Borrowed(integers),
        Err(_) => {
            Cow::Owned(bytes.chunks_exact(size_of::<i32>()).map(bytemuck::pod_read_unaligned).collect())
        }
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
