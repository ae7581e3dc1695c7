//! The frames of a lane that are being filled. Workers claim slots, write them and report them as complete;
//! completing the last slot of a frame publishes it. All calls hold the assembler's lock and none blocks.
//! Slots are written without the lock, and a worker that finds no free frame waits without it.

use crate::slot::FrameMemory;
use crate::transport::{Epoch, FrameContent, Outlet, RequestNumber, SessionId, TransportError};
use std::collections::VecDeque;

/// The right to write `count` slots of an open frame.
#[derive(Clone, Copy)]
pub(crate) struct SlotClaim {
    pub(crate) memory: FrameMemory,
    /// First claimed slot. A synchronous lane ignores it: there the slot is the environment.
    pub(crate) first: usize,
    frame: FrameNumber,
    count: usize,
}

/// Counts the frames that a lane opened.
#[derive(Clone, Copy, PartialEq, Eq)]
struct FrameNumber(u64);

struct OpenFrame<L> {
    number: FrameNumber,
    loan: L,
    memory: FrameMemory,
    claimed: usize,
    written: usize,
    /// A new epoch began: the frame is dropped when all its claimed slots are complete.
    stale: bool,
}

/// Collects a lane's results in frames.
pub(crate) struct FrameAssembler<O: Outlet> {
    outlet: O,
    slots: usize,
    open: VecDeque<OpenFrame<O::Loan>>,
    opened: u64,
    /// `None` while the lane has no learner.
    epoch: Option<Epoch>,
    /// Reserved for the report that the lane failed, whose cause may be that no frame is free.
    spare: Option<O::Loan>,
}

impl<O: Outlet> FrameAssembler<O> {
    pub(crate) fn new(mut outlet: O, slots: usize) -> Result<Self, TransportError> {
        let spare = Some(outlet.loan()?);
        Ok(FrameAssembler { outlet, slots, open: VecDeque::new(), opened: 0, epoch: None, spare })
    }

    /// Discards all work in progress: from now on only results of `epoch` get slots.
    pub(crate) fn begin_epoch(&mut self, epoch: Option<Epoch>) {
        self.epoch = epoch;
        self.open.retain_mut(|frame| {
            frame.stale = true;
            frame.written < frame.claimed
        });
    }

    /// Claims `count` slots for results of `epoch`; `Ok(None)` if that epoch is over.
    pub(crate) fn claim(&mut self, epoch: Epoch, count: usize) -> Result<Option<SlotClaim>, TransportError> {
        if self.epoch != Some(epoch) {
            return Ok(None);
        }
        let slots = self.slots;
        let room = self.open.iter().position(|f| !f.stale && f.claimed + count <= slots);
        let index = match room {
            Some(index) => index,
            None => self.open_frame()?,
        };
        let frame = &mut self.open[index];
        let first = frame.claimed;
        frame.claimed += count;
        Ok(Some(SlotClaim { memory: frame.memory, first, frame: frame.number, count }))
    }

    /// Takes claimed slots as written, and publishes the frame if they were its last. Returns whether it did.
    pub(crate) fn complete(&mut self, claim: SlotClaim) -> bool {
        let Some(index) = self.open.iter().position(|f| f.number == claim.frame) else { return false };
        let frame = &mut self.open[index];
        frame.written += claim.count;
        let done = if frame.stale { frame.written == frame.claimed } else { frame.written == self.slots };
        if !done {
            return false;
        }
        let frame = self.open.remove(index).expect("found above");
        if !frame.stale {
            self.outlet.publish(frame.loan, self.epoch, FrameContent::Batch);
        }
        !frame.stale
    }

    /// Publishes the reason why a request of `session` was refused, unless that session is over.
    pub(crate) fn report_rejection(
        &mut self,
        session: SessionId,
        request: RequestNumber,
        text: &[u8],
    ) -> Result<(), TransportError> {
        if self.epoch.is_some_and(|epoch| epoch.session == session) {
            let loan = self.outlet.loan()?;
            self.publish_text(loan, Some(request), text);
        }
        Ok(())
    }

    /// Publishes the reason why the lane failed. A lane fails once, so the reserved frame is still there.
    pub(crate) fn report_failure(&mut self, text: &[u8]) {
        if let Some(loan) = self.spare.take() {
            self.publish_text(loan, None, text);
        }
    }

    fn publish_text(&mut self, mut loan: O::Loan, request: Option<RequestNumber>, text: &[u8]) {
        let payload = O::payload(&mut loan);
        let len = text.len().min(payload.len());
        payload[..len].copy_from_slice(&text[..len]);
        self.outlet.publish(loan, self.epoch, FrameContent::Rejection { request, len });
    }

    fn open_frame(&mut self) -> Result<usize, TransportError> {
        let mut loan = self.outlet.loan()?;
        let memory = FrameMemory::new(O::payload(&mut loan));
        let number = FrameNumber(self.opened);
        self.opened += 1;
        self.open.push_back(OpenFrame { number, loan, memory, claimed: 0, written: 0, stale: false });
        Ok(self.open.len() - 1)
    }
}
