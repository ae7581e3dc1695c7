//! From the learner to the lane: a request is checked, written into shared memory, and sent.

use super::error::ClientError;
use super::{Actions, AttachedLane};
use crate::CHECK_INTERVAL;
use crate::services::doing;
use crate::wait_options::WaitOptions;
use crate::wire::{RequestHeader, body_offset, request_bytes};
use smaclite_pool::env_ids::env_index;
use smaclite_pool::transport::RequestKind;
use std::time::{Duration, Instant};

/// How long a supervisor may leave its queue of requests full. Its workers accept requests between any two
/// runs of environments; one that does not is stopped.
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
        self.outstanding.reserve_step(self.last_request.next(), env_ids)?;
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
            && !self.outstanding.names_all(ids)
        {
            self.outstanding.reserve_some(number, ids)?;
            return self.send(kind, env_ids, body, wait);
        }
        // Only a reset that was sent begins an epoch: otherwise results of the current one are still to come.
        self.send(kind, env_ids, body, wait)?;
        self.outstanding.reserve_full_reset(number);
        self.previous_reset = self.epoch.reset.replace(number);
        self.sequence = None;
        Ok(())
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
            return Err(ClientError::WrongSnapshots { given: snapshots.len(), envs, size });
        }
        self.send_to_some(RequestKind::Restore { seed }, env_ids, Body::Snapshots(snapshots), wait)
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
        self.outstanding.reserve_some(self.last_request.next(), ids)?;
        self.send(kind, Some(ids), body, wait)
    }

    /// Sends a request whose environments are reserved, and frees them if it cannot be sent.
    fn send(
        &mut self,
        kind: RequestKind,
        env_ids: Option<&[i32]>,
        mut body: Body<'_>,
        wait: &mut WaitOptions<'_>,
    ) -> Result<(), ClientError> {
        self.last_request = self.last_request.next();
        if let Some(participant) = &mut self.participant {
            participant.join();
        }
        let count = self.count(env_ids);
        let header =
            RequestHeader::new(&self.layout, self.epoch.session, self.side, self.last_request, kind, count);
        let mut full_queue = None;
        loop {
            let ended = match self.try_send(&header, kind, env_ids, &mut body) {
                Ok(true) => return Ok(()),
                Ok(false) if !self.control.is_alive() => Err(self.pool_died()),
                Ok(false) => full_queue.get_or_insert_with(|| FullQueue::new(wait.timeout)).wait(wait),
                Err(error) => Err(error),
            };
            if ended.is_err() {
                self.outstanding.release(self.last_request);
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
    begin: Instant,
    next_check: Instant,
}

impl FullQueue {
    fn new(timeout: Option<Duration>) -> Self {
        let timeout = timeout.map_or(SEND_TIMEOUT, |timeout| timeout.min(SEND_TIMEOUT));
        let begin = Instant::now();
        FullQueue { timeout, begin, next_check: begin + CHECK_INTERVAL }
    }

    /// Sleeps until the next attempt, unless the time is over or the caller interrupts the wait.
    fn wait(&mut self, wait: &mut WaitOptions<'_>) -> Result<(), ClientError> {
        let now = Instant::now();
        if now - self.begin > self.timeout {
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
