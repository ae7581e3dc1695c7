//! How a request is accepted: entirely, with its environments busy and their actions copied, or not at all.

use super::Lane;
use crate::env_ids::{check_distinct, env_index};
use crate::hosted_env::{Autoreset, HostedEnv, Task};
use crate::rejection::Rejection;
use crate::sync::{MutexGuard, lock};
use crate::transport::{Epoch, Inlet, Message, Request, RequestKind, Transport};
use smaclite_engine::IllegalAction;
use std::hint::black_box;
use std::sync::atomic::{AtomicI32, Ordering};

/// One environment's share of an accepted request.
#[derive(Clone, Copy)]
pub(crate) struct Entry {
    pub(crate) env: u32,
    pub(super) task: Task,
    pub(super) epoch: Epoch,
    pub(super) ticket: u64,
}

/// The receiving side, held by the leading worker while it accepts requests and by the control side while it
/// changes who the learner is.
pub(super) struct Intake<I> {
    inlet: I,
    session: Option<u64>,
    pub(super) epoch: Epoch,
    was_reset: bool,
    /// Number of the session's last request.
    number: u64,
    /// Counts requests, so that a busy seat tells whether this very request took it.
    ticket: u64,
    /// The entries of the request being accepted.
    accepted: Vec<Entry>,
}

impl<I> Intake<I> {
    pub(super) fn new(inlet: I) -> Self {
        Intake {
            inlet,
            session: None,
            epoch: Epoch::default(),
            was_reset: false,
            number: 0,
            ticket: 0,
            accepted: Vec::new(),
        }
    }

    pub(super) fn set_session(&mut self, session: Option<u64>) {
        self.session = session;
        self.was_reset = false;
        self.number = 0;
        self.epoch = Epoch { session: session.unwrap_or(0), request: 0 };
    }
}

/// A request on its way to acceptance.
struct Checking<'a> {
    request: Request<'a>,
    epoch: &'a mut Epoch,
    was_reset: bool,
    ticket: u64,
    accepted: &'a mut Vec<Entry>,
}

impl<T: Transport> Lane<T> {
    /// Accepts the next request, if there is one, and gives its entries to `share_out`. `false` if there was
    /// none.
    pub(crate) fn accept(&self, share_out: impl FnOnce(&[Entry])) -> bool {
        let mut guard = lock(&self.intake);
        let intake = &mut *guard;
        let message = intake.inlet.receive().unwrap_or_else(|error| {
            tracing::warn!(lane = self.name, error, "requests could not be received");
            None
        });
        let Some(message) = message else { return false };
        let request = match message.request() {
            Ok(request) => request,
            Err(rejection) => {
                // Without a form it has no sender either; the learner's own client sends well-formed
                // requests.
                tracing::warn!(%rejection, "request ignored");
                self.counters.rejected();
                return true;
            }
        };
        if Some(request.session) != intake.session {
            tracing::debug!(session = request.session, "request of another session ignored");
            self.counters.rejected();
            return true;
        }
        intake.accepted.clear();
        intake.ticket += 1;
        let last = intake.number;
        intake.number = last.max(request.number);
        let Intake { was_reset, ticket, ref mut epoch, ref mut accepted, .. } = *intake;
        let checked = in_order(last, request.number)
            .and_then(|()| self.check(&mut Checking { request, epoch, was_reset, ticket, accepted }));
        match checked {
            Ok(()) => {
                intake.was_reset = true;
                self.counters.accepted(message.waited());
                share_out(&intake.accepted);
            }
            Err(rejection) => {
                self.roll_back(&intake.accepted);
                drop(guard); // the answer may wait for a frame, the control thread must not
                self.reject(&request, &rejection);
            }
        }
        true
    }

    /// Marks the request's environments busy and copies their actions, or says why not.
    fn check(&self, checking: &mut Checking<'_>) -> Result<(), Rejection> {
        if let Some(text) = self.failure() {
            return Err(Rejection::LaneFailed { text: text.to_owned() });
        }
        match checking.request.kind {
            RequestKind::Step => self.check_step(checking),
            RequestKind::Reset { seed } => self.check_reset(checking, seed),
        }
    }

    fn check_step(&self, checking: &mut Checking<'_>) -> Result<(), Rejection> {
        let Request { env_ids, actions, .. } = checking.request;
        if !checking.was_reset {
            return Err(Rejection::NotReset);
        }
        if self.is_synchronous() && env_ids.len() != self.num_envs {
            return Err(Rejection::IncompleteBatch { given: env_ids.len(), expected: self.num_envs });
        }
        fetch(env_ids);
        fetch(actions);
        for (id, actions) in env_ids.iter().zip(actions.chunks_exact(self.layout.sizes().n_agents)) {
            let env = env_index(id.load(Ordering::Relaxed), self.num_envs)?;
            let mut hosted = self.reserve(env, Task::Step, checking)?;
            let hosted = &mut *hosted;
            hosted
                .actions
                .iter_mut()
                .zip(actions)
                .for_each(|(own, sent)| *own = sent.load(Ordering::Relaxed));
            if !hosted.over {
                hosted.env.check(&hosted.actions).map_err(|illegal| at_env(env, illegal))?;
            } else if self.autoreset == Autoreset::Disabled {
                return Err(Rejection::FinishedEnv { env });
            }
        }
        Ok(())
    }

    fn check_reset(&self, checking: &mut Checking<'_>, seed: Option<u64>) -> Result<(), Rejection> {
        let env_ids = checking.request.env_ids;
        let whole = env_ids.len() == self.num_envs;
        if !checking.was_reset && !whole {
            return Err(Rejection::NotReset);
        }
        // Every session begins with the lane's own seed, whatever an earlier learner did.
        let seed = if checking.was_reset { seed } else { seed.or(Some(self.seed)) };
        let reset = |env: usize| Task::Reset { seed: seed.map(|s| s.wrapping_add(env as u64)) };
        if whole {
            // Checked before the epoch ends: a refused request must not free seats that are still at work.
            check_distinct(env_ids.iter().map(|id| id.load(Ordering::Relaxed)), self.num_envs)?;
            *checking.epoch = Epoch { request: checking.request.number, ..*checking.epoch };
            self.begin_epoch(*checking.epoch);
            return (0..self.num_envs).try_for_each(|env| self.reserve(env, reset(env), checking).map(drop));
        }
        for id in env_ids {
            let env = env_index(id.load(Ordering::Relaxed), self.num_envs)?;
            drop(self.reserve(env, reset(env), checking)?);
        }
        if self.is_synchronous() {
            for env in 0..self.num_envs {
                match self.reserve(env, Task::Observe, checking) {
                    Ok(_) | Err(Rejection::DuplicateEnv { .. }) => {} // the reset ones have their slot already
                    Err(busy) => return Err(busy),
                }
            }
        }
        Ok(())
    }

    /// Marks a seat busy, or says who took it.
    fn reserve(
        &self,
        env: usize,
        task: Task,
        checking: &mut Checking<'_>,
    ) -> Result<MutexGuard<'_, HostedEnv>, Rejection> {
        let mut hosted = lock(&self.envs[env]);
        match hosted.busy {
            Some(ticket) if ticket == checking.ticket => Err(Rejection::DuplicateEnv { env }),
            Some(_) => Err(Rejection::BusyEnv { env }),
            None => {
                hosted.busy = Some(checking.ticket);
                let (epoch, ticket) = (*checking.epoch, checking.ticket);
                checking.accepted.push(Entry { env: env as u32, task, epoch, ticket });
                Ok(hosted)
            }
        }
    }

    /// A refused request leaves no trace.
    fn roll_back(&self, accepted: &[Entry]) {
        accepted.iter().for_each(|e| lock(&self.envs[e.env as usize]).busy = None);
    }
}

/// Reads from every cache line (but for the last, where integers do not begin on one). Another core wrote
/// them last, and this way they come over side by side rather than each when its turn comes.
fn fetch(integers: &[AtomicI32]) {
    const LINE: usize = 64 / size_of::<i32>();
    black_box(integers.iter().step_by(LINE).fold(0, |sum, x| sum ^ x.load(Ordering::Relaxed)));
}

/// Rounds are told apart by the number of the request that began them, so numbers must not come twice.
fn in_order(last: u64, number: u64) -> Result<(), Rejection> {
    if number > last {
        return Ok(());
    }
    Err(Rejection::Malformed { what: format!("request number {number} came after number {last}") })
}

fn at_env(env: usize, illegal: IllegalAction) -> Rejection {
    match illegal {
        IllegalAction::Unavailable { agent, action, available } => {
            Rejection::UnavailableAction { env, agent, action, available }
        }
        other => Rejection::Malformed { what: format!("environment {env}: {other}") },
    }
}
