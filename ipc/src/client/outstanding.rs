//! Which environments of a lane work on an earlier request, so that a request that the lane would refuse for
//! that is refused before it is sent, with the same error, and so that `recv` never waits for a batch that
//! cannot come. Whether actions are available only the lane checks.

use smaclite_pool::env_ids::{check_distinct, env_index};
use smaclite_pool::transport::{RequestKind, RequestNumber};
use smaclite_pool::{LaneSettings, Rejection};

pub(super) struct Outstanding {
    synchronous: bool,
    /// By environment: the request that it works on.
    busy: Vec<Option<RequestNumber>>,
    /// Results still to come.
    results: usize,
    /// A batch has come, so the lane has reset its environments in this session.
    was_reset: bool,
    /// Before that, the requests that would do so, and that were not refused so far.
    resets: Vec<RequestNumber>,
}

impl Outstanding {
    pub(super) fn new(settings: &LaneSettings) -> Outstanding {
        let busy = vec![None; settings.num_envs];
        let (synchronous, resets) = (settings.is_synchronous(), Vec::new());
        Outstanding { synchronous, busy, results: 0, was_reset: false, resets }
    }

    /// Results still to come.
    pub(super) fn results(&self) -> usize {
        self.results
    }

    pub(super) fn check_was_reset(&self) -> Result<(), Rejection> {
        if self.was_reset() { Ok(()) } else { Err(Rejection::NotReset) }
    }

    fn was_reset(&self) -> bool {
        self.was_reset || !self.resets.is_empty()
    }

    /// Refuses environments that work on an earlier request, which a fork would copy before or after it.
    pub(super) fn check_idle(&self, ids: &[i32]) -> Result<(), Rejection> {
        ids.iter().try_for_each(|id| match env_index(*id, self.busy.len())? {
            env if self.busy[env].is_some() => Err(Rejection::BusyEnv { env }),
            _ => Ok(()),
        })
    }

    /// Marks the environments of `ids` busy with a step.
    pub(super) fn reserve_step(&mut self, number: RequestNumber, ids: &[i32]) -> Result<(), Rejection> {
        let (given, expected) = (ids.len(), self.busy.len());
        if self.synchronous && given != expected && given > 0 && self.was_reset() {
            return Err(Rejection::IncompleteBatch { given, expected });
        }
        self.reserve(number, ids)
    }

    /// Marks the environments of `ids` busy with a request that a synchronous lane, too, takes for some of
    /// them.
    pub(super) fn reserve_some(&mut self, number: RequestNumber, ids: &[i32]) -> Result<(), Rejection> {
        self.reserve(number, ids)?;
        if self.synchronous {
            // The rest of the batch comes along, unchanged.
            self.busy.fill(Some(number));
            self.results = self.busy.len();
        }
        Ok(())
    }

    /// Whether a request to the environments of `ids`, or to all, begins an epoch; why it is none if it
    /// would, but for its ids.
    pub(super) fn begins_epoch(&self, kind: RequestKind, ids: Option<&[i32]>) -> Result<bool, Rejection> {
        let begins = |names_all| kind.begins_epoch(names_all, self.synchronous, self.was_reset());
        let Some(ids) = ids.filter(|_| begins(true)) else { return Ok(begins(true)) };
        let names_all = self.names_all(ids);
        if begins(names_all) && !names_all {
            check_distinct(ids.iter().copied(), self.busy.len())?;
            if ids.is_empty() {
                return Err(Rejection::NoEnv); // it would never be answered
            }
        }
        Ok(begins(names_all))
    }

    /// Marks all environments busy with a request that begins an epoch, whether or not they work on an
    /// earlier one.
    pub(super) fn reset_all(&mut self, number: RequestNumber) {
        self.busy.fill(Some(number));
        self.results = self.busy.len();
        if !self.was_reset {
            self.resets.push(number);
        }
    }

    fn reserve(&mut self, number: RequestNumber, ids: &[i32]) -> Result<(), Rejection> {
        self.check_was_reset()?;
        if ids.is_empty() {
            return Err(Rejection::NoEnv); // it would never be answered
        }
        let reserved = ids.iter().try_for_each(|id| self.reserve_env(number, *id));
        match reserved {
            Ok(()) => self.results += ids.len(),
            Err(_) => drop(self.clear(number)),
        }
        reserved
    }

    fn reserve_env(&mut self, number: RequestNumber, id: i32) -> Result<(), Rejection> {
        let env = env_index(id, self.busy.len())?;
        match self.busy[env].replace(number) {
            None => Ok(()),
            Some(other) if other == number => Err(Rejection::DuplicateEnv { env }),
            Some(other) => {
                self.busy[env] = Some(other);
                Err(Rejection::BusyEnv { env })
            }
        }
    }

    /// Whether `ids` names every environment once, in any order.
    pub(super) fn names_all(&self, ids: &[i32]) -> bool {
        ids.len() == self.busy.len() && check_distinct(ids.iter().copied(), self.busy.len()).is_ok()
    }

    /// Frees the environments of a request that was refused as a whole; `false` if it had none.
    pub(super) fn release(&mut self, number: RequestNumber) -> bool {
        self.resets.retain(|reset| *reset != number);
        let freed = self.clear(number);
        self.results = self.results.saturating_sub(freed); // a supervisor may answer twice
        freed > 0
    }

    fn clear(&mut self, number: RequestNumber) -> usize {
        let mut freed = 0;
        for busy in self.busy.iter_mut().filter(|busy| **busy == Some(number)) {
            *busy = None;
            freed += 1;
        }
        freed
    }

    /// The results of these environments were received.
    pub(super) fn received(&mut self, ids: &[i32]) {
        (self.was_reset, self.resets) = (true, Vec::new());
        for id in ids {
            // A supervisor may send an id that names no environment.
            if let Ok(env) = env_index(*id, self.busy.len()) {
                self.busy[env] = None;
            }
        }
        self.results = self.results.saturating_sub(ids.len());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use smaclite_pool::transport::Seeds;

    /// Of three environments in batches of two, after the first reset.
    fn outstanding() -> Outstanding {
        let settings = LaneSettings { batch_size: 2, ..LaneSettings::new(3) };
        let mut outstanding = Outstanding::new(&settings);
        outstanding.reset_all(RequestNumber(1));
        outstanding
    }

    /// The refusal said "malformed request", and not what was expected.
    #[test]
    fn a_request_to_no_environment_says_what_is_expected() {
        let mut outstanding = outstanding();
        for refused in
            [outstanding.reserve_some(RequestNumber(2), &[]), outstanding.reserve_step(RequestNumber(3), &[])]
        {
            let text = refused.unwrap_err().to_string();
            assert_eq!(text, "a request must name at least one environment, got none");
        }
    }

    #[test]
    fn a_refused_request_reserves_nothing() {
        let mut outstanding = outstanding();
        outstanding.received(&[0, 2]);
        let mut step = |number, ids| outstanding.reserve_step(RequestNumber(number), ids);
        assert!(matches!(step(2, &[0, 1]), Err(Rejection::BusyEnv { env: 1 })));
        assert!(matches!(step(3, &[2, 2]), Err(Rejection::DuplicateEnv { env: 2 })));
        assert!(matches!(step(4, &[0, 3]), Err(Rejection::UnknownEnv { env: 3, .. })));
        assert!(step(5, &[2, 0]).is_ok());
        assert_eq!(outstanding.results(), 3);
        assert!(outstanding.release(RequestNumber(5)) && !outstanding.release(RequestNumber(5)));
        assert_eq!(outstanding.results(), 1);
    }

    /// Whether the fork was of the state before or after the step depended on how far the lane was.
    #[test]
    fn an_environment_that_works_is_not_copied() {
        let mut outstanding = outstanding();
        outstanding.received(&[0, 2]);
        assert!(outstanding.check_idle(&[2, 0, 2]).is_ok());
        assert!(matches!(outstanding.check_idle(&[0, 1]), Err(Rejection::BusyEnv { env: 1 })));
        assert!(matches!(outstanding.check_idle(&[0, 3]), Err(Rejection::UnknownEnv { env: 3, .. })));
    }

    /// Naming them all one by one was once refused while results were under way, where naming none was not.
    #[test]
    fn a_reset_of_all_drops_what_is_under_way_however_they_are_named() {
        let mut outstanding = outstanding();
        assert!(outstanding.names_all(&[2, 0, 1]));
        assert!(!outstanding.names_all(&[0, 1]) && !outstanding.names_all(&[0, 1, 1]));
        assert!(matches!(
            outstanding.reserve_some(RequestNumber(2), &[0, 1]),
            Err(Rejection::BusyEnv { env: 0 })
        ));
        outstanding.reset_all(RequestNumber(3));
        assert_eq!(outstanding.results(), 3);
    }

    /// Whichever of two resets in a row the lane refuses, nothing is expected of it.
    #[test]
    fn a_refused_reset_leaves_nothing_outstanding() {
        let mut outstanding = outstanding();
        outstanding.received(&[0, 1]);
        outstanding.reset_all(RequestNumber(2));
        assert!(!outstanding.release(RequestNumber(1)), "the one before is over");
        assert!(outstanding.release(RequestNumber(2)));
        assert_eq!(outstanding.results(), 0);
        assert!(outstanding.reserve_step(RequestNumber(3), &[0]).is_ok());
    }

    #[test]
    fn a_session_whose_first_reset_was_refused_was_not_reset() {
        let mut outstanding = outstanding();
        assert!(outstanding.check_was_reset().is_ok() && outstanding.release(RequestNumber(1)));
        assert!(matches!(outstanding.check_was_reset(), Err(Rejection::NotReset)));
        // Of two that were refused, the first was overlooked: a reset of some environments never returned.
        outstanding.reset_all(RequestNumber(2));
        outstanding.reset_all(RequestNumber(3));
        assert!(!outstanding.release(RequestNumber(2)) && outstanding.check_was_reset().is_ok());
        assert!(outstanding.release(RequestNumber(3)));
        assert!(matches!(outstanding.check_was_reset(), Err(Rejection::NotReset)));
        // Of two of which one was accepted, the other one began an epoch, too.
        outstanding.reset_all(RequestNumber(4));
        outstanding.reset_all(RequestNumber(5));
        assert!(outstanding.release(RequestNumber(5)) && outstanding.check_was_reset().is_ok());
    }

    #[test]
    fn a_step_of_a_synchronous_lane_names_every_environment() {
        let mut outstanding = Outstanding::new(&LaneSettings::new(3));
        outstanding.reset_all(RequestNumber(1));
        outstanding.received(&[0, 1, 2]);
        let mut step = |number, ids| outstanding.reserve_step(RequestNumber(number), ids);
        let incomplete = step(2, &[0, 1]);
        assert!(matches!(incomplete, Err(Rejection::IncompleteBatch { given: 2, expected: 3 })));
        assert!(matches!(step(3, &[]), Err(Rejection::NoEnv)));
        assert!(step(4, &[2, 0, 1]).is_ok());
    }

    #[test]
    fn the_first_reset_of_a_synchronous_lane_begins_an_epoch_if_its_ids_are_right() {
        let mut outstanding = Outstanding::new(&LaneSettings::new(3));
        let reset = RequestKind::Reset { seeds: Seeds::Continue, levels: false };
        let begins = |outstanding: &Outstanding, ids| outstanding.begins_epoch(reset, ids);
        assert!(matches!(begins(&outstanding, None), Ok(true)));
        assert!(matches!(begins(&outstanding, Some(&[1])), Ok(true)));
        assert!(matches!(begins(&outstanding, Some(&[])), Err(Rejection::NoEnv)));
        assert!(matches!(begins(&outstanding, Some(&[1, 1])), Err(Rejection::DuplicateEnv { env: 1 })));
        assert!(matches!(begins(&outstanding, Some(&[3])), Err(Rejection::UnknownEnv { env: 3, .. })));
        outstanding.reset_all(RequestNumber(1));
        outstanding.received(&[0, 1, 2]);
        assert!(matches!(begins(&outstanding, Some(&[2, 1, 0])), Ok(true)));
        // Later ones of some begin none, and what is wrong with their ids is found when they are marked.
        assert!(
            [&[1][..], &[1, 1], &[]].iter().all(|ids| matches!(begins(&outstanding, Some(ids)), Ok(false)))
        );
    }
}
