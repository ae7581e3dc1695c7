//! From the lane to the learner: waiting for a frame, and telling batches from rejections.

use super::AttachedLane;
use super::error::ClientError;
use crate::CHECK_INTERVAL;
use crate::batch::Batch;
use crate::control::client::{ControlSocketError, RESPONSE_TIMEOUT};
use crate::control::protocol::{ControlError, ControlRequest, ControlResponse};
use crate::services::{FrameSample, doing};
use crate::wait_options::WaitOptions;
use crate::wire::{ReceivedFrame, frames_lost, read_frame};
use iceoryx2::port::ReceiveError;
use smaclite_pool::transport::{Epoch, RequestNumber};
use smaclite_pool::{Deadline, LocalLearner, Rejection};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How long another process may take to refuse a request, before `recv` says that nothing will come.
const REFUSAL_TIMEOUT: Duration = Duration::from_millis(100);

impl AttachedLane {
    /// Waits for the next batch. The timeout counts from `begin`.
    pub(super) fn recv(
        &mut self,
        begin: Instant,
        wait: &mut WaitOptions<'_>,
    ) -> Result<Arc<Batch>, ClientError> {
        let (outstanding, batch_size) = (self.outstanding.results(), self.description.settings.batch_size);
        let sample = if outstanding < batch_size {
            let nothing = ClientError::NothingToReceive { outstanding, batch_size };
            self.wait_for_refusal(begin, wait)?.ok_or(nothing)?
        } else {
            self.wait_for_batch(begin, wait)?
        };
        let batch = Batch::new(sample, Arc::clone(&self.layout), Arc::clone(&self.ports.frames));
        self.outstanding.received(batch.env_id());
        Ok(Arc::clone(self.newest.insert(Arc::new(batch))))
    }

    /// Of requests that are too few for a batch, one may be refused, which says more than their number.
    fn wait_for_refusal(
        &mut self,
        begin: Instant,
        wait: &mut WaitOptions<'_>,
    ) -> Result<Option<FrameSample>, ClientError> {
        loop {
            let received = self.receive()?;
            // In this process it is refused when it is sent.
            let is_possible = self.local.is_none() && self.outstanding.results() > 0;
            let longest = if self.may_be_more { RESPONSE_TIMEOUT } else { REFUSAL_TIMEOUT };
            let timeout = wait.timeout.map_or(longest, |timeout| timeout.min(longest));
            if received.is_some() || !is_possible || begin.elapsed() >= timeout {
                return Ok(received);
            }
            if (wait.interrupted)() {
                return Err(ClientError::Interrupted);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
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
            let served = self.local.as_mut().is_some_and(LocalLearner::serve);
            if !served && polls.pause_briefly() {
                continue;
            }
            let now = Instant::now();
            let left = deadline.as_mut().map(|deadline| deadline.left(now));
            if left == Some(Duration::ZERO) {
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
            let until_check = next_check - now;
            self.sleep(left.map_or(until_check, |left| until_check.min(left)));
        }
    }

    /// Blocks until a frame is sent, or for this time. In that time the pool has all its workers.
    fn sleep(&mut self, time: Duration) {
        self.local.as_mut().map(LocalLearner::leave);
        // Whatever ends this wait, the caller polls again.
        let _ = self.ports.frame_sent.timed_wait(|_| {}, time);
    }

    /// The next batch of this session and epoch, if one has arrived.
    fn receive(&mut self) -> Result<Option<FrameSample>, ClientError> {
        if let Some((first, last)) = self.lost {
            return Err(ClientError::FramesLost { first, last }); // their environments stay busy
        }
        loop {
            while let Some((request, rejection)) = self.next_refused()? {
                self.reject(Some(request), rejection)?;
            }
            let Some(sample) = self.receive_any()? else { return Ok(None) };
            let header = *sample.user_header();
            let Epoch { session, reset } = header.epoch();
            let frame = match read_frame(&header, sample.payload(), &self.layout) {
                Some(frame) if session == self.session => frame,
                _ => continue,
            };
            let is_present = reset == self.epoch;
            if is_present
                && let Some((first, last)) =
                    frames_lost(self.sequence.replace(header.sequence), header.sequence)
            {
                self.lost = Some((first, last));
                return Err(ClientError::FramesLost { first, last });
            }
            match frame {
                ReceivedFrame::Batch if is_present => return Ok(Some(sample)),
                ReceivedFrame::Batch => {} // of an epoch that is over
                ReceivedFrame::Rejection { request: Some(request), rejection } => {
                    self.refused.push_back((request, rejection));
                    self.may_be_more = true;
                }
                ReceivedFrame::Rejection { request: None, rejection } => self.reject(None, rejection)?,
            }
        }
    }

    /// The next request that was refused. One refusal arrives as a frame, and those after it on the control
    /// socket, where this asks for them without waiting: the next call reads the response.
    fn next_refused(&mut self) -> Result<Option<(RequestNumber, Rejection)>, ClientError> {
        while self.refused.is_empty() && self.may_be_more {
            match self.control.repeat(&ControlRequest::ReadRefusals, WaitOptions::no_wait()) {
                Ok((ControlResponse::Refusals { refusals }, is_late)) => {
                    let refusals = refusals.into_iter();
                    let refusals =
                        refusals.map(|refusal| (RequestNumber(refusal.request), refusal.rejection));
                    self.refused.extend(refusals);
                    self.may_be_more = is_late;
                }
                Ok((response, _)) => return Err(ControlError::unexpected(&response).into()),
                Err(ControlSocketError::Silent { .. }) => break,
                // What it sent before it ended is still received.
                Err(ControlSocketError::Gone { .. }) => self.may_be_more = false,
                Err(error) => return Err(ClientError::of_socket(error)),
            }
        }
        Ok(self.refused.pop_front())
    }

    /// The next frame of any session.
    fn receive_any(&mut self) -> Result<Option<FrameSample>, ClientError> {
        loop {
            match self.ports.frames.subscriber.receive() {
                Ok(sample) => return Ok(sample),
                // The newest batch is kept for sampling, as long as there is room for it.
                Err(ReceiveError::ExceedsMaxBorrows)
                    if self.newest.take_if(|newest| Arc::strong_count(newest) == 1).is_some() => {}
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
            Rejection::LaneFailed { .. } => self.failure = Some(rejection.clone()),
            _ if request.is_some_and(|request| self.outstanding.release(request)) => {}
            _ => return Ok(()), // a later reset took its place
        }
        Err(rejection.into())
    }
}
