//! From the lane to the learner: waiting for a frame, and telling batches from rejections.

use super::AttachedLane;
use super::error::ClientError;
use crate::CHECK_INTERVAL;
use crate::batch::Batch;
use crate::services::{FrameSample, doing};
use crate::wait_options::WaitOptions;
use crate::wire::{ReceivedFrame, frames_lost, read_frame};
use iceoryx2::port::ReceiveError;
use smaclite_pool::transport::RequestNumber;
use smaclite_pool::{Participant, Rejection};
use std::sync::Arc;
use std::time::{Duration, Instant};

impl AttachedLane {
    /// Waits for the next batch. The timeout counts from `begin`.
    pub(super) fn recv(
        &mut self,
        begin: Instant,
        wait: &mut WaitOptions<'_>,
    ) -> Result<Arc<Batch>, ClientError> {
        let (outstanding, batch_size) = (self.outstanding.results(), self.description.settings.batch_size);
        if outstanding < batch_size {
            return Err(ClientError::NothingToReceive { outstanding, batch_size });
        }
        let sample = self.wait_for_batch(begin, wait)?;
        let batch = Batch::new(sample, Arc::clone(&self.layout), Arc::clone(&self.ports.frames));
        self.outstanding.received(batch.env_id());
        Ok(Arc::clone(self.newest.insert(Arc::new(batch))))
    }

    fn wait_for_batch(
        &mut self,
        begin: Instant,
        wait: &mut WaitOptions<'_>,
    ) -> Result<FrameSample, ClientError> {
        let mut polls = self.polling.begin_at(begin);
        // A timeout beyond what an `Instant` can hold is no limit.
        let end = wait.timeout.and_then(|timeout| begin.checked_add(timeout));
        let mut next_check = begin + CHECK_INTERVAL;
        loop {
            if let Some(sample) = self.receive()? {
                return Ok(sample);
            }
            let served = self.participant.as_mut().is_some_and(Participant::serve);
            if !served && polls.pause_briefly() {
                continue;
            }
            let now = Instant::now();
            if end.is_some_and(|end| now >= end) {
                return Err(ClientError::Timeout(wait.timeout.unwrap_or_default()));
            }
            if now >= next_check {
                next_check = now + CHECK_INTERVAL;
                if !self.control.is_alive() {
                    // It may have answered before it died.
                    return self.receive()?.ok_or_else(|| self.pool_died());
                }
                if (wait.interrupted)() {
                    return Err(ClientError::Interrupted);
                }
            }
            if served {
                polls = self.polling.begin_at(now);
                continue;
            }
            if polls.pause_at(now) {
                continue;
            }
            let wake = end.map_or(next_check, |end| next_check.min(end));
            self.sleep(wake - now);
        }
    }

    /// Blocks until a frame is sent, or for this time. In that time the pool has all its workers.
    fn sleep(&mut self, time: Duration) {
        if let Some(participant) = &mut self.participant {
            participant.leave();
        }
        // Whatever ends this wait, the caller polls again.
        let _ = self.ports.frame_sent.timed_wait(|_| {}, time);
    }

    /// The next batch of this session and epoch, if one has arrived.
    fn receive(&mut self) -> Result<Option<FrameSample>, ClientError> {
        loop {
            let sample = match self.ports.frames.subscriber.receive() {
                Ok(Some(sample)) => sample,
                Ok(None) => return Ok(None),
                // The newest batch is kept for sampling as long as there is room for it.
                Err(ReceiveError::ExceedsMaxBorrows) if self.newest.take().is_some() => continue,
                Err(ReceiveError::ExceedsMaxBorrows) => {
                    let limit = self.description.capacity.max_held_batches;
                    return Err(ClientError::TooManyHeld { limit });
                }
                Err(error) => return Err(doing("receiving a frame")(error).into()),
            };
            let header = *sample.user_header();
            let frame = match read_frame(&header, sample.payload(), &self.layout) {
                Some(frame) if header.epoch().session == self.epoch.session => frame,
                _ => continue,
            };
            let is_current = header.epoch() == self.epoch;
            // The frames left over from an earlier epoch may overflow: they are dropped in any case.
            if is_current
                && let Some((first, last)) =
                    frames_lost(self.sequence.replace(header.sequence), header.sequence)
            {
                return Err(ClientError::FramesLost { first, last });
            }
            match frame {
                ReceivedFrame::Rejection { request, rejection } => self.reject(request, rejection)?,
                ReceivedFrame::Batch if is_current => return Ok(Some(sample)),
                ReceivedFrame::Batch => {}
            }
        }
    }

    /// Reports the rejection of a request whose results are outstanding.
    fn reject(&mut self, request: Option<RequestNumber>, rejection: Rejection) -> Result<(), ClientError> {
        if matches!(rejection, Rejection::LaneFailed { .. } | Rejection::OtherLearnerLeft { .. }) {
            self.failure = Some(rejection.clone());
        } else if !request.is_some_and(|request| self.outstanding.release(request)) {
            return Ok(());
        } else if request == self.epoch.reset {
            (self.epoch.reset, self.sequence) = (self.previous_reset, None);
        }
        Err(rejection.into())
    }
}
