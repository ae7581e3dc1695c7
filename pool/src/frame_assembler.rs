//! The frames of a lane that are being filled. Workers claim slots, write them, and say when they are
//! written; the last one of a frame publishes it. All calls are made under the lane's lock and none of them
//! blocks; the writing, and the wait for a frame where there is none, are not made under it.

use crate::slot::FrameMemory;
use crate::transport::{Epoch, FrameContent, Outlet};
use std::collections::VecDeque;

/// A right to write `count` slots of an open frame.
#[derive(Clone, Copy)]
pub(crate) struct SlotClaim {
    pub(crate) memory: FrameMemory,
    /// First slot claimed; a synchronous lane ignores it, there a slot is its environment.
    pub(crate) first: usize,
    frame: u64,
    count: usize,
}

struct OpenFrame<L> {
    number: u64,
    loan: L,
    memory: FrameMemory,
    claimed: usize,
    written: usize,
    /// A new round began; the frame is dropped once nobody writes to it any more.
    stale: bool,
}

/// Where a lane's results go.
pub(crate) struct FrameAssembler<O: Outlet> {
    outlet: O,
    slots: usize,
    open: VecDeque<OpenFrame<O::Loan>>,
    next_number: u64,
    epoch: Epoch,
    /// Kept back to report the lane's failure in, which may be that there is no frame.
    spare: Option<O::Loan>,
}

impl<O: Outlet> FrameAssembler<O> {
    pub(crate) fn new(mut outlet: O, slots: usize) -> Result<Self, String> {
        let spare = Some(outlet.loan()?);
        Ok(FrameAssembler {
            outlet,
            slots,
            open: VecDeque::new(),
            next_number: 0,
            epoch: Epoch::default(),
            spare,
        })
    }

    /// Discards everything that is under way: from now on only work of `round` finds a slot.
    pub(crate) fn begin_epoch(&mut self, epoch: Epoch) {
        self.epoch = epoch;
        self.open.retain_mut(|frame| {
            frame.stale = true;
            frame.written < frame.claimed
        });
    }

    /// Claims `count` slots for work of `round`; `Ok(None)` if that round is over.
    pub(crate) fn claim(&mut self, epoch: Epoch, count: usize) -> Result<Option<SlotClaim>, String> {
        if epoch != self.epoch {
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

    /// The claimed slots are written (or given up, where the round is over); publishes the frame if they were its last.
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

    /// Sends a frame that holds the reason why `request` of `session` was refused instead of a batch, unless
    /// that session is over.
    pub(crate) fn report(&mut self, session: u64, request: u64, text: &[u8]) -> Result<(), String> {
        if session == self.epoch.session {
            let loan = self.outlet.loan()?;
            self.publish_text(loan, request, text);
        }
        Ok(())
    }

    /// Sends the reason why the lane failed. It fails once, so the frame kept back for this is there.
    pub(crate) fn report_failure(&mut self, text: &[u8]) {
        if let Some(loan) = self.spare.take() {
            self.publish_text(loan, 0, text);
        }
    }

    fn publish_text(&mut self, mut loan: O::Loan, request: u64, text: &[u8]) {
        let payload = O::payload(&mut loan);
        let len = text.len().min(payload.len());
        payload[..len].copy_from_slice(&text[..len]);
        self.outlet.publish(loan, self.epoch, FrameContent::Rejection { request, len });
    }

    fn open_frame(&mut self) -> Result<usize, String> {
        let mut loan = self.outlet.loan()?;
        let memory = FrameMemory::new(O::payload(&mut loan));
        let number = self.next_number;
        self.next_number += 1;
        self.open.push_back(OpenFrame { number, loan, memory, claimed: 0, written: 0, stale: false });
        Ok(self.open.len() - 1)
    }
}
