//! From the learner to the lane: a request is checked, and then written into shared memory and sent, or, to a
//! lane of this process, ordered by this thread.

use super::AttachedLane;
use super::error::ClientError;
use super::order::Order;
use crate::CHECK_INTERVAL;
use crate::services::doing;
use crate::wait_options::WaitOptions;
use crate::wire::{RequestHeader, body_offset, request_bytes};
use smaclite_engine::{RecordLayout, RecordSizes, SnapshotError};
use smaclite_pool::transport::{Request, RequestKind, RequestNumber, Seeds};
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
    /// Sends an order, if it has what its environments take and none of them works on an earlier one.
    pub(super) fn send_order(
        &mut self,
        order: Order<'_>,
        env_ids: Option<&[i32]>,
        wait: &mut WaitOptions<'_>,
    ) -> Result<(), ClientError> {
        self.check_order(order, env_ids)?;
        let number = self.last_request.next();
        let all = Arc::clone(&self.all_ids);
        let ids = env_ids.unwrap_or(&all);
        let begins_epoch = self.outstanding.begins_epoch(order.kind(), env_ids);
        if begins_epoch.map_err(|rejection| self.refused(rejection))? {
            // Only what was sent begins an epoch: otherwise results of the present one are still to come.
            for (refused, _) in std::mem::take(&mut self.refused) {
                self.outstanding.release(refused);
            }
            self.send(order, ids, wait)?;
            self.outstanding.reset_all(number);
            (self.epoch, self.sequence, self.lost) = (Some(number), None, None);
            self.may_be_more = false; // those that wait are of the epoch that is over
            return Ok(());
        }
        if let Some((first, last)) = self.lost {
            return Err(ClientError::FramesLost { first, last }); // says more than that environments are busy
        }
        let reserved = match order {
            Order::Step(_) => self.outstanding.reserve_step(number, ids),
            Order::Fork { from, .. } => {
                let idle = self.outstanding.check_idle(from);
                idle.and_then(|()| self.outstanding.reserve_some(number, ids))
            }
            _ => self.outstanding.reserve_some(number, ids),
        };
        reserved.map_err(|rejection| self.refused(rejection))?;
        self.send(order, ids, wait)
    }

    /// Does an order have as much as its environments take?
    fn check_order(&self, order: Order<'_>, env_ids: Option<&[i32]>) -> Result<(), ClientError> {
        let envs = self.count(env_ids);
        if let Seeds::Each(seeds) = order.seeds()
            && seeds.len() != envs
        {
            return Err(ClientError::WrongSeeds { given: seeds.len(), envs });
        }
        match order {
            Order::Step(actions) => self.check_length(actions.len(), env_ids),
            Order::Reset { levels: None, .. } => Ok(()),
            Order::Reset { levels: Some(levels), .. } => {
                let (given, size) = (levels.len(), self.layout.level_len());
                match size {
                    0 => Err(ClientError::NoLevels),
                    _ if given != envs * size => Err(ClientError::WrongLevels { given, envs, size }),
                    _ => Ok(()),
                }
            }
            Order::Restore { snapshots, .. } => {
                let (given, size) = (snapshots.len(), self.layout.snapshot_size());
                match size {
                    0 => Err(ClientError::NoSnapshots),
                    _ if given != envs * size => {
                        let difference = self.difference(snapshots, envs);
                        Err(ClientError::WrongSnapshots { given, envs, size, difference })
                    }
                    _ => Ok(()),
                }
            }
            Order::Fork { from, .. } if from.len() != envs => {
                Err(ClientError::WrongForks { from: from.len(), to: envs })
            }
            Order::Fork { .. } => Ok(()),
        }
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

    /// Why a request is not sent. The results of a pool that has died never arrive, so its environments would
    /// be busy without end.
    fn refused(&self, rejection: Rejection) -> ClientError {
        let has_died = self.local.is_none() && !self.control.is_alive();
        if has_died { self.pool_died() } else { rejection.into() }
    }

    /// Sends an order whose environments are reserved, and frees them if it cannot be sent.
    fn send(&mut self, order: Order<'_>, ids: &[i32], wait: &mut WaitOptions<'_>) -> Result<(), ClientError> {
        let (number, kind, body) = (self.last_request.next(), order.kind(), &*order.body());
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
        &mut self,
        number: RequestNumber,
        kind: RequestKind,
        ids: &[i32],
        body: &[u8],
        wait: &mut WaitOptions<'_>,
    ) -> Result<(), ClientError> {
        let header = RequestHeader::new(&self.layout, self.session, number, kind, ids.len());
        let (bytes, mut full_queue) = (request_bytes(&self.layout, kind, ids.len()), None);
        while !self.try_send(&header, ids, body, bytes)? {
            if !self.control.is_alive() {
                return Err(self.pool_died());
            }
            full_queue.get_or_insert_with(|| FullQueue::new(wait.timeout)).wait(wait)?;
        }
        if kind == RequestKind::Step {
            self.next_request = self.ports.requests.loan_slice(bytes).ok();
        }
        Ok(())
    }

    /// Writes the request into shared memory and sends it; `false` if the supervisor's queue is full.
    fn try_send(
        &mut self,
        header: &RequestHeader,
        ids: &[i32],
        body: &[u8],
        bytes: usize,
    ) -> Result<bool, ClientError> {
        let loaned = self.next_request.take().filter(|loan| loan.payload().len() == bytes);
        let sample = loaned.map_or_else(|| self.ports.requests.loan_slice(bytes), Ok);
        let mut sample = sample.map_err(doing("loaning memory for a request"))?;
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
