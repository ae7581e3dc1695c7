//! The epochs of a session, as its learner counts them. A reset of all environments begins one, and the
//! results of the one before are dropped. But the lane may refuse such a reset: then the epoch before goes on
//! with what was outstanding in it, and with the frames that came meanwhile. So it is kept until the lane has
//! answered.

use super::error::ClientError;
use super::outstanding::Outstanding;
use crate::wire::frames_lost;
use smaclite_pool::LaneSettings;
use smaclite_pool::transport::RequestNumber;
use std::collections::VecDeque;

/// The epochs that may still be the lane's; `F` is a frame.
pub(super) struct Epochs<F> {
    /// That of the newest reset.
    present: Epoch<F>,
    /// Those that go on if the lane refuses the resets after them, the oldest first.
    superseded: Vec<Epoch<F>>,
}

struct Epoch<F> {
    /// What began it; `None` before the first reset of the session.
    reset: Option<RequestNumber>,
    outstanding: Outstanding,
    /// Of its last frame.
    sequence: Option<u64>,
    /// Its frames that came while it was superseded.
    kept: VecDeque<(F, u64)>,
    /// First and last of those that were lost in that time.
    lost: Option<(u64, u64)>,
}

/// To which epoch a frame belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    Present,
    /// One that goes on if a later reset is refused.
    Superseded(usize),
    /// One that is over.
    Over,
}

impl<F> Epoch<F> {
    fn new(reset: Option<RequestNumber>, outstanding: Outstanding) -> Epoch<F> {
        Epoch { reset, outstanding, sequence: None, kept: VecDeque::new(), lost: None }
    }
}

impl<F> Epochs<F> {
    /// Before the first reset.
    pub(super) fn new(settings: &LaneSettings) -> Epochs<F> {
        Epochs { present: Epoch::new(None, Outstanding::new(settings)), superseded: Vec::new() }
    }

    /// What is outstanding in the present epoch.
    pub(super) fn outstanding(&self) -> &Outstanding {
        &self.present.outstanding
    }

    pub(super) fn outstanding_mut(&mut self) -> &mut Outstanding {
        &mut self.present.outstanding
    }

    /// How many epochs have results to come.
    pub(super) fn unanswered(&self) -> usize {
        let epochs = self.superseded.iter().chain([&self.present]);
        epochs.filter(|epoch| epoch.outstanding.results() > 0).count()
    }

    /// A reset of all environments was sent.
    pub(super) fn begin(&mut self, number: RequestNumber, can_be_refused: bool) {
        let next = Epoch::new(Some(number), self.present.outstanding.after_reset(number));
        let before = std::mem::replace(&mut self.present, next);
        if can_be_refused {
            self.superseded.push(before);
        } else {
            self.superseded.clear();
        }
    }

    /// A frame of the epoch of `reset` came: those before it are over.
    pub(super) fn arrived(
        &mut self,
        reset: Option<RequestNumber>,
        sequence: u64,
    ) -> Result<Place, ClientError> {
        if reset == self.present.reset {
            self.superseded.clear();
            let lost = frames_lost(self.present.sequence.replace(sequence), sequence);
            return lost
                .map_or(Ok(Place::Present), |(first, last)| Err(ClientError::FramesLost { first, last }));
        }
        let Some(index) = self.superseded.iter().position(|epoch| epoch.reset == reset) else {
            return Ok(Place::Over);
        };
        self.superseded.drain(..index);
        let epoch = &mut self.superseded[0];
        let lost = frames_lost(epoch.sequence.replace(sequence), sequence);
        epoch.lost = epoch.lost.or(lost);
        Ok(Place::Superseded(0))
    }

    /// Keeps a frame of a superseded epoch.
    pub(super) fn keep(&mut self, epoch: usize, frame: F, sequence: u64) {
        self.superseded[epoch].kept.push_back((frame, sequence));
    }

    /// Gives up a frame that is kept, if there is one, because there is room for no more.
    pub(super) fn drop_kept(&mut self) -> bool {
        let mut epochs = self.superseded.iter_mut();
        epochs.any(|epoch| match epoch.kept.pop_front() {
            Some((_, sequence)) => {
                epoch.lost = Some((epoch.lost.map_or(sequence, |(first, _)| first.min(sequence)), sequence));
                true
            }
            None => false,
        })
    }

    /// The next frame of the present epoch that came while it was superseded.
    pub(super) fn take_kept(&mut self) -> Result<Option<F>, ClientError> {
        if let Some((first, last)) = self.present.lost.take() {
            return Err(ClientError::FramesLost { first, last });
        }
        Ok(self.present.kept.pop_front().map(|(frame, _)| frame))
    }

    /// The lane refused a request. Returns whether that matters: the present epoch waits for its results.
    pub(super) fn refused(&mut self, number: RequestNumber) -> bool {
        if Some(number) == self.present.reset
            && let Some(before) = self.superseded.pop()
        {
            self.present = before;
            return true;
        }
        // A later reset took the place of this one.
        self.superseded.retain(|epoch| epoch.reset != Some(number));
        self.present.outstanding.release(number)
    }

    /// Whether the request began an epoch that the lane may still refuse.
    pub(super) fn may_refuse(&self, number: RequestNumber) -> bool {
        let after_first = self.superseded.iter().skip(1).chain([&self.present]);
        !self.superseded.is_empty() && after_first.into_iter().any(|epoch| epoch.reset == Some(number))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four environments in batches of two, after the first reset and its frames 1 and 2.
    fn epochs() -> Epochs<&'static str> {
        let mut epochs = Epochs::new(&LaneSettings { batch_size: 2, ..LaneSettings::new(4) });
        epochs.begin(RequestNumber(1), false);
        for (sequence, envs) in [(1, [0, 1]), (2, [2, 3])] {
            assert_eq!(epochs.arrived(Some(RequestNumber(1)), sequence).unwrap(), Place::Present);
            epochs.outstanding_mut().received(&envs);
        }
        epochs
    }

    fn step(epochs: &mut Epochs<&'static str>, number: u64, env: i32) {
        let reserved = epochs.outstanding_mut().reserve_step(RequestNumber(number), Some(&[env]));
        reserved.expect("the environment is idle");
    }

    /// The reset forgot who was busy: a batch that was ready could not be received.
    #[test]
    fn what_was_outstanding_before_a_refused_reset_is_outstanding_after_it() {
        let mut epochs = epochs();
        step(&mut epochs, 2, 0);
        epochs.begin(RequestNumber(3), true);
        assert_eq!(epochs.outstanding().results(), 4);
        assert!(epochs.may_refuse(RequestNumber(3)) && epochs.refused(RequestNumber(3)));
        assert!(!epochs.may_refuse(RequestNumber(3)) && !epochs.refused(RequestNumber(3)));
        assert_eq!(epochs.outstanding().results(), 1);
        assert!(epochs.outstanding_mut().reserve_step(RequestNumber(4), Some(&[0])).is_err(), "it is busy");
        step(&mut epochs, 4, 1);
        assert_eq!(epochs.outstanding().results(), 2);
    }

    #[test]
    fn frames_that_came_before_a_refusal_are_received_after_it() {
        let mut epochs = epochs();
        step(&mut epochs, 2, 0);
        step(&mut epochs, 3, 1);
        epochs.begin(RequestNumber(4), true);
        assert_eq!(epochs.arrived(Some(RequestNumber(1)), 3).unwrap(), Place::Superseded(0));
        epochs.keep(0, "of 0 and 1", 3);
        assert!(epochs.take_kept().unwrap().is_none(), "the reset may be accepted");
        assert_eq!(epochs.arrived(Some(RequestNumber(1)), 4).unwrap(), Place::Superseded(0));
        assert!(epochs.refused(RequestNumber(4)));
        assert_eq!(epochs.take_kept().unwrap(), Some("of 0 and 1"));
        assert!(epochs.take_kept().unwrap().is_none());
        assert_eq!(epochs.arrived(Some(RequestNumber(1)), 5).unwrap(), Place::Present, "none is missing");
    }

    /// Two in a row: whichever the lane refuses, the client goes on with the epoch that the lane has. With
    /// both refused it once took the first for accepted, and dropped every later batch.
    #[test]
    fn of_two_resets_in_a_row_either_can_be_refused() {
        for (first, second) in [(true, true), (true, false), (false, true), (false, false)] {
            let mut epochs = epochs();
            step(&mut epochs, 2, 0);
            epochs.begin(RequestNumber(3), true);
            epochs.begin(RequestNumber(4), true);
            let mut lane = (1, 3);
            for (number, is_refused) in [(3, first), (4, second)] {
                let answered = epochs.arrived(Some(RequestNumber(lane.0)), lane.1).unwrap();
                assert_ne!(answered, Place::Over, "{first} {second}");
                lane.1 += 1;
                if is_refused {
                    assert!(epochs.may_refuse(RequestNumber(number)), "{first} {second}");
                    assert_eq!(epochs.refused(RequestNumber(number)), number == 4);
                } else {
                    lane = (number, 1);
                }
            }
            assert_eq!(epochs.arrived(Some(RequestNumber(lane.0)), lane.1).unwrap(), Place::Present);
            let expected = if first && second { 1 } else { 4 };
            assert_eq!(epochs.outstanding().results(), expected, "{first} {second}");
        }
    }

    /// A learner that has no room for the frames that came meanwhile is told so, and does not wait for them.
    #[test]
    fn frames_that_could_not_be_kept_are_reported_as_lost() {
        let mut epochs = epochs();
        (0..4).for_each(|env| step(&mut epochs, 2 + env as u64, env));
        epochs.begin(RequestNumber(6), true);
        for sequence in [3, 4] {
            assert_eq!(epochs.arrived(Some(RequestNumber(1)), sequence).unwrap(), Place::Superseded(0));
            epochs.keep(0, "a frame", sequence);
        }
        assert!(epochs.drop_kept() && epochs.drop_kept() && !epochs.drop_kept());
        epochs.refused(RequestNumber(6));
        let lost = epochs.take_kept();
        assert!(matches!(lost, Err(ClientError::FramesLost { first: 3, last: 4 })));
    }
}
