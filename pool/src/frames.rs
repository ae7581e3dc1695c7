//! The frames of a lane that are being filled. Threads claim slots, write them and report them as complete;
//! completing the last slot of a frame publishes it. All calls hold the lock of the frames and none blocks.
//! Slots are written without the lock, and a thread that finds no free frame waits without it.

use crate::slot::FrameMemory;
use crate::transport::{Epoch, FrameContent, Outlet, RequestNumber, SessionId, TransportError};
use std::collections::VecDeque;

/// The right to write a slot of an open frame, in a synchronous lane all of them.
#[derive(Clone, Copy)]
pub(crate) struct SlotClaim {
    pub(crate) memory: FrameMemory,
    /// The slot. In a synchronous lane slot i is environment i instead.
    pub(crate) slot: usize,
    frame: FrameNumber,
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
    /// Its session or epoch is over: the frame is dropped when all its claimed slots are complete.
    stale: bool,
}

/// Collects a lane's results in frames.
pub(crate) struct Frames<O: Outlet> {
    outlet: O,
    slots: usize,
    open: VecDeque<OpenFrame<O::Loan>>,
    opened: u64,
    /// `None` while the lane has no learner.
    epoch: Option<Epoch>,
    /// Reserved for the report that the lane failed, whose cause may be that no frame is free. Renewed for
    /// the next session.
    spare: Option<O::Loan>,
    /// The next frame of a synchronous lane, loaned while the learner reads the one before.
    next: Option<O::Loan>,
}

impl<O: Outlet> Frames<O> {
    pub(crate) fn new(mut outlet: O, slots: usize) -> Result<Self, TransportError> {
        let spare = Some(outlet.loan()?);
        Ok(Frames { outlet, slots, open: VecDeque::new(), opened: 0, epoch: None, spare, next: None })
    }

    /// Until the next epoch begins, results belong to an earlier session and get no slots.
    pub(crate) fn begin_session(&mut self, session: Option<SessionId>) {
        self.epoch = session.map(|session| Epoch { session, reset: None });
        self.spare = self.take_spare();
        self.drop_open();
    }

    /// Drops the open frames, or leaves them to the threads that still write to them.
    fn drop_open(&mut self) {
        self.open.retain_mut(|frame| {
            frame.stale = true;
            frame.written < frame.claimed
        });
    }

    /// From now on results are of this epoch.
    pub(crate) fn begin_epoch(&mut self, epoch: Epoch) {
        self.epoch = Some(epoch);
        self.drop_open();
    }

    /// Claims a slot, in a synchronous lane for all of its frame; `Ok(None)` if the session of the results is
    /// over.
    pub(crate) fn claim(&mut self) -> Result<Option<SlotClaim>, TransportError> {
        if self.epoch.is_none_or(|epoch| epoch.reset.is_none()) {
            return Ok(None);
        }
        let room = self.open.iter().position(|f| !f.stale && f.claimed < self.slots);
        let index = match room {
            Some(index) => index,
            None => self.open_frame()?,
        };
        let frame = &mut self.open[index];
        let slot = frame.claimed;
        frame.claimed += 1;
        Ok(Some(SlotClaim { memory: frame.memory, slot, frame: frame.number }))
    }

    /// Takes a claimed slot as written, and publishes the frame if it was its last. Returns whether it did.
    pub(crate) fn complete(&mut self, claim: SlotClaim) -> bool {
        let Some(index) = self.open.iter().position(|f| f.number == claim.frame) else { return false };
        let frame = &mut self.open[index];
        frame.written += 1;
        let done = if frame.stale { frame.written == frame.claimed } else { frame.written == self.slots };
        if !done {
            return false;
        }
        self.open.remove(index).is_some_and(|frame| self.publish(frame))
    }

    /// Takes all slots of the frame of a synchronous lane as written, of which one is open. With `is_local`
    /// this may be the learner's thread, for which to loan the next one now saves no time; and later it is
    /// the one that is still in this core's cache.
    pub(crate) fn complete_all(&mut self, is_local: bool) -> bool {
        let published = self.open.pop_front().is_some_and(|frame| self.publish(frame));
        if !is_local && self.next.is_none() {
            self.next = self.outlet.loan().ok();
        }
        published
    }

    fn publish(&mut self, frame: OpenFrame<O::Loan>) -> bool {
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

    /// Publishes why the lane failed, in the reserved frame if no other is free.
    pub(crate) fn report_end(&mut self, text: &[u8]) {
        let loan = self.outlet.loan().ok().or_else(|| self.spare.take());
        if let Some(loan) = loan {
            self.publish_text(loan, None, text);
        }
    }

    fn take_spare(&mut self) -> Option<O::Loan> {
        self.spare.take().or_else(|| self.outlet.loan().ok())
    }

    fn publish_text(&mut self, mut loan: O::Loan, request: Option<RequestNumber>, text: &[u8]) {
        let payload = O::payload(&mut loan);
        let len = text.len().min(payload.len());
        payload[..len].copy_from_slice(&text[..len]);
        self.outlet.publish(loan, self.epoch, FrameContent::Rejection { request, len });
    }

    fn open_frame(&mut self) -> Result<usize, TransportError> {
        let mut loan = self.next.take().map_or_else(|| self.outlet.loan(), Ok)?;
        let memory = FrameMemory::new(O::payload(&mut loan));
        let number = FrameNumber(self.opened);
        self.opened += 1;
        self.open.push_back(OpenFrame { number, loan, memory, claimed: 0, written: 0, stale: false });
        Ok(self.open.len() - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
    use std::sync::{Arc, Mutex};

    #[repr(align(128))]
    struct Memory([u8; 128]);

    /// A frame, which counts as lent until it is dropped.
    struct Lent(Box<Memory>, Arc<AtomicUsize>);

    impl Drop for Lent {
        fn drop(&mut self) {
            self.1.fetch_sub(1, Relaxed);
        }
    }

    #[derive(Clone, Default)]
    struct Memories {
        lent: Arc<AtomicUsize>,
        published: Arc<Mutex<Vec<FrameContent>>>,
    }

    // SAFETY: a loan owns its memory, which does not move with it.
    #[allow(unsafe_code)]
    unsafe impl Outlet for Memories {
        type Loan = Lent;

        fn loan(&mut self) -> Result<Lent, TransportError> {
            self.lent.fetch_add(1, Relaxed);
            Ok(Lent(Box::new(Memory([0; 128])), Arc::clone(&self.lent)))
        }

        fn payload(loan: &mut Lent) -> &mut [u8] {
            &mut loan.0.0
        }

        fn publish(&mut self, _: Lent, _: Option<Epoch>, content: FrameContent) {
            self.published.lock().unwrap().push(content);
        }
    }

    /// Else its memory would be that of another frame while a thread still writes to it.
    #[test]
    fn a_frame_whose_epoch_is_over_stays_until_all_who_write_to_it_are_done() {
        let memories = Memories::default();
        let lent = || memories.lent.load(Relaxed);
        let mut frames = Frames::new(memories.clone(), 3).unwrap();
        let epoch = |reset| Epoch { session: SessionId(1), reset: Some(RequestNumber(reset)) };
        frames.begin_epoch(epoch(1));
        let spare = lent();
        let [first, second] = [(); 2].map(|()| frames.claim().unwrap().unwrap());
        assert_eq!(lent(), spare + 1);
        frames.begin_epoch(epoch(2));
        assert!(!frames.complete(first));
        assert_eq!(lent(), spare + 1, "a thread still writes the second slot");
        assert!(!frames.complete(second));
        assert_eq!(lent(), spare);
        // The next frame is another one, and published when it is full.
        let claims = [(); 3].map(|()| frames.claim().unwrap().unwrap());
        assert_eq!(claims.map(|claim| frames.complete(claim)), [false, false, true]);
        assert_eq!(*memories.published.lock().unwrap(), [FrameContent::Batch]);
    }

    /// The memory of a lane has room for one frame that is filled, one for a rejection, and the spare one.
    #[test]
    fn the_next_frame_is_loaned_in_advance_for_a_learner_in_another_process() {
        let memories = Memories::default();
        let lent = || memories.lent.load(Relaxed);
        let mut frames = Frames::new(memories.clone(), 2).unwrap();
        frames.begin_epoch(Epoch { session: SessionId(1), reset: Some(RequestNumber(1)) });
        let spare = lent();
        for is_local in [false, false, true, true] {
            frames.claim().unwrap();
            assert_eq!(lent(), spare + 1, "one is filled, and no other loaned");
            assert!(frames.complete_all(is_local));
            assert_eq!(lent(), spare + usize::from(!is_local), "the published one is the learner's");
        }
        assert_eq!(memories.published.lock().unwrap().len(), 4);
    }

    #[test]
    fn a_frame_is_kept_for_the_report_that_the_lane_failed() {
        let memories = Memories::default();
        let mut frames = Frames::new(memories.clone(), 1).unwrap();
        for session in [Some(SessionId(1)), None] {
            frames.begin_session(session);
            assert_eq!(memories.lent.load(Relaxed), 1, "one, and the same");
        }
    }
}
