//! From the learner to the lane: a request is checked, written into shared memory, and sent.

use super::error::ClientError;
use super::{Actions, AttachedLane};
use crate::CHECK_INTERVAL;
use crate::services::doing;
use crate::wait_options::WaitOptions;
use crate::wire::{RequestHeader, actions_offset, step_bytes};
use smaclite_pool::transport::RequestKind;
use std::time::{Duration, Instant};

/// How long a supervisor may leave its queue of requests full. Its workers accept requests between any two
/// runs of environments; one that does not is stopped.
const SEND_TIMEOUT: Duration = Duration::from_secs(5);

/// How often to try again while the queue is full.
const RETRY_INTERVAL: Duration = Duration::from_micros(50);

impl AttachedLane {
    /// Sends actions, `[count, n_agents]`.
    pub(super) fn send_step(
        &mut self,
        actions: &mut dyn Actions,
        env_ids: Option<&[i32]>,
        wait: &mut WaitOptions<'_>,
    ) -> Result<(), ClientError> {
        self.check_length(actions.count(), env_ids)?;
        self.outstanding.reserve_step(self.last_request.next(), env_ids)?;
        self.send(RequestKind::Step, env_ids, Some(actions), wait)
    }

    pub(super) fn send_reset(
        &mut self,
        seed: Option<u64>,
        env_ids: Option<&[i32]>,
        wait: &mut WaitOptions<'_>,
    ) -> Result<(), ClientError> {
        let number = self.last_request.next();
        let kind = RequestKind::Reset { seed };
        if let Some(ids) = env_ids
            && !self.outstanding.names_all(ids)
        {
            self.outstanding.reserve_reset(number, ids)?;
            return self.send(kind, env_ids, None, wait);
        }
        // Only a reset that was sent begins an epoch: otherwise results of the current one are still to come.
        self.send(kind, env_ids, None, wait)?;
        self.outstanding.reserve_full_reset(number);
        self.epoch.reset = Some(number);
        self.sequence = None;
        Ok(())
    }

    /// Sends a request whose environments are reserved, and frees them if it cannot be sent.
    fn send(
        &mut self,
        kind: RequestKind,
        env_ids: Option<&[i32]>,
        mut actions: Option<&mut dyn Actions>,
        wait: &mut WaitOptions<'_>,
    ) -> Result<(), ClientError> {
        self.last_request = self.last_request.next();
        if let Some(participant) = &mut self.participant {
            participant.join();
        }
        let count = self.count(env_ids);
        let header = RequestHeader::new(&self.layout, self.epoch.session, self.last_request, kind, count);
        let mut full_queue = None;
        loop {
            let ended = match self.try_send(&header, env_ids, &mut actions) {
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
        env_ids: Option<&[i32]>,
        actions: &mut Option<&mut dyn Actions>,
    ) -> Result<bool, ClientError> {
        let count = header.count as usize;
        let bytes = match actions {
            None => count * size_of::<i32>(),
            Some(_) => step_bytes(count, self.description.sizes.n_agents),
        };
        let loan = self.ports.requests.loan_slice(bytes);
        let mut sample = loan.map_err(doing("loaning memory for a request"))?;
        *sample.user_header_mut() = *header;
        let payload = sample.payload_mut();
        let ids: &mut [i32] = bytemuck::cast_slice_mut(&mut payload[..count * size_of::<i32>()]);
        match env_ids {
            Some(given) => ids.copy_from_slice(given),
            None => ids.iter_mut().zip(0..).for_each(|(id, env)| *id = env),
        }
        if let Some(actions) = actions {
            actions.write_to(bytemuck::cast_slice_mut(&mut payload[actions_offset(count)..]));
        }
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
