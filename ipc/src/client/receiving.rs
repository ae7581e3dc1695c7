//! From the lane to the learner: waiting for a frame, and telling batches from rejections.

use super::AttachedLane;
use super::epochs::Place;
use super::error::ClientError;
use crate::CHECK_INTERVAL;
use crate::batch::Batch;
use crate::control::protocol::{ControlRequest, ControlResponse, LaneStatus};
use crate::services::{FrameSample, doing};
use crate::wait_options::WaitOptions;
use crate::wire::{ReceivedFrame, read_frame};
use iceoryx2::port::ReceiveError;
use smaclite_pool::transport::RequestNumber;
use smaclite_pool::{Deadline, Participant, Rejection};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How long a learner whose wait ended asks the supervisor whether the other learner is there.
const STATUS_TIMEOUT: Duration = Duration::from_millis(500);

impl AttachedLane {
    /// Waits for the next batch. The timeout counts from `begin`.
    pub(super) fn recv(
        &mut self,
        begin: Instant,
        wait: &mut WaitOptions<'_>,
    ) -> Result<Arc<Batch>, ClientError> {
        let (outstanding, batch_size) =
            (self.epochs.outstanding().results(), self.description.settings.batch_size);
        if outstanding < batch_size {
            return Err(ClientError::NothingToReceive { outstanding, batch_size });
        }
        let sample = self.wait_for_batch(begin, wait)?;
        let batch = Batch::new(sample, Arc::clone(&self.layout), Arc::clone(&self.ports.frames));
        self.epochs.outstanding_mut().received(batch.env_id());
        Ok(Arc::clone(self.newest.insert(Arc::new(batch))))
    }

    fn wait_for_batch(
        &mut self,
        begin: Instant,
        wait: &mut WaitOptions<'_>,
    ) -> Result<FrameSample, ClientError> {
        let mut polls = self.polling.begin_at(begin);
        let mut deadline = wait.timeout.map(|timeout| Deadline::new(begin, timeout));
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
            let left = deadline.as_mut().map(|deadline| deadline.left(now));
            if left == Some(Duration::ZERO) {
                return Err(self.timed_out(wait.timeout.unwrap_or_default()));
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
            let until_check = next_check - now;
            self.sleep(left.map_or(until_check, |left| until_check.min(left)));
        }
    }

    /// The error of a wait that took this long. Of two learners, the other may not have come.
    fn timed_out(&mut self, time: Duration) -> ClientError {
        let missing = self.side.and_then(|_| {
            let wait = WaitOptions { timeout: Some(STATUS_TIMEOUT), interrupted: &mut || false };
            match self.control.repeat(&ControlRequest::Status, wait) {
                Ok((ControlResponse::Status(pool), _)) => {
                    let own = |lane: &&LaneStatus| lane.description.lane == self.description.lane;
                    pool.lanes.iter().find(own)?.missing_side
                }
                _ => None,
            }
        });
        match missing {
            Some(missing) => ClientError::OtherLearnerMissing { time, missing },
            None => ClientError::Timeout(time),
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
            let kept = self.epochs.take_kept()?;
            let is_kept = kept.is_some();
            let Some(sample) = kept.map_or_else(|| self.receive_any(), |sample| Ok(Some(sample)))? else {
                return Ok(None);
            };
            let header = *sample.user_header();
            let epoch = header.epoch();
            let frame = match read_frame(&header, sample.payload(), &self.layout) {
                Some(frame) if epoch.session == self.session => frame,
                _ => continue,
            };
            let place =
                if is_kept { Place::Present } else { self.epochs.arrived(epoch.reset, header.sequence)? };
            match (frame, place) {
                (ReceivedFrame::Batch, Place::Present) => return Ok(Some(sample)),
                (ReceivedFrame::Batch, Place::Over) => {}
                (ReceivedFrame::Rejection { request: Some(request), .. }, Place::Superseded(index))
                    if !self.epochs.may_refuse(request) =>
                {
                    self.epochs.keep(index, sample, header.sequence);
                }
                (ReceivedFrame::Batch, Place::Superseded(index)) => {
                    self.epochs.keep(index, sample, header.sequence);
                }
                (ReceivedFrame::Rejection { request, rejection }, _) => self.reject(request, rejection)?,
            }
        }
    }

    /// The next frame of any session.
    fn receive_any(&mut self) -> Result<Option<FrameSample>, ClientError> {
        loop {
            match self.ports.frames.subscriber.receive() {
                Ok(sample) => return Ok(sample),
                // The newest batch is kept for sampling, and others for the case that a reset is refused, as
                // long as there is room for them.
                Err(ReceiveError::ExceedsMaxBorrows)
                    if self.newest.take().is_some() || self.epochs.drop_kept() => {}
                Err(ReceiveError::ExceedsMaxBorrows) => {
                    let limit = self.description.capacity.max_held_batches;
                    return Err(ClientError::TooManyHeld { limit });
                }
                Err(error) => return Err(doing("receiving a frame")(error).into()),
            }
        }
    }

    /// Reports the rejection of a request whose results are outstanding.
    fn reject(&mut self, request: Option<RequestNumber>, rejection: Rejection) -> Result<(), ClientError> {
        match rejection {
            Rejection::LaneFailed { .. } | Rejection::OtherLearnerLeft { .. } => {
                self.failure = Some(rejection.clone());
            }
            // Of the other learner. This one has not sent its request of that number, or a later one counts.
            Rejection::TooFarAhead { side, .. } if Some(side) != self.side => return Ok(()),
            _ if request.is_some_and(|request| self.epochs.refused(request)) => {}
            _ => return Ok(()),
        }
        Err(rejection.into())
    }
}
