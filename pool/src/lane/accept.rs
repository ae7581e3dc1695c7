//! How a lane accepts a request: either all of it, with its environments busy and their actions copied, or
//! nothing.

use super::Lane;
use crate::autoreset::Autoreset;
use crate::env_ids::{check_distinct, env_index};
use crate::hosted_env::Task;
use crate::rejection::Rejection;
use crate::sync::{MutexGuard, lock};
use crate::transport::{Epoch, Inlet, Message, Request, RequestKind, RequestNumber, SessionId, Transport};
use std::hint::black_box;
use std::ops::Deref;
use std::sync::atomic::{AtomicI32, Ordering};

/// One environment's share of an accepted request.
#[derive(Clone, Copy)]
pub(crate) struct Entry {
    pub(crate) env: u32,
    pub(super) task: Task,
    pub(super) epoch: Epoch,
    /// Counts the entries of the environment, from 1.
    pub(super) turn: u64,
}

/// Numbers the requests that a lane received, of all sessions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Ticket(u64);

/// What an environment was asked to do.
#[derive(Clone, Copy, Default)]
struct Accepted {
    /// How many entries of accepted requests it got.
    entries: u64,
    /// How many of them belong to earlier epochs. They do not make it busy.
    earlier: u64,
    /// The request of the last one.
    ticket: Ticket,
}

/// The receiving side of a lane. The thread that accepts requests locks it, and the control thread to change
/// the session.
pub(super) struct Intake<I> {
    inlet: I,
    /// `None` while the lane has no learner.
    epoch: Option<Epoch>,
    /// The session's last request.
    last_request: Option<RequestNumber>,
    ticket: Ticket,
    /// By environment.
    accepted: Vec<Accepted>,
    /// The entries of the last request.
    entries: Vec<Entry>,
}

impl<I> Intake<I> {
    pub(super) fn new(inlet: I, num_envs: usize) -> Self {
        let accepted = vec![Accepted::default(); num_envs];
        let ticket = Ticket::default();
        Intake { inlet, epoch: None, last_request: None, ticket, accepted, entries: Vec::new() }
    }

    /// The learner's session.
    pub(super) fn session(&self) -> Option<SessionId> {
        self.epoch.map(|epoch| epoch.session)
    }

    /// Returns the session's epoch before its first reset.
    pub(super) fn begin_session(&mut self, session: Option<SessionId>) -> Option<Epoch> {
        self.last_request = None;
        self.begin_epoch(session.map(|session| Epoch { session, reset: None }));
        self.epoch
    }

    /// From now on entries are of this epoch, and no environment is busy.
    fn begin_epoch(&mut self, epoch: Option<Epoch>) {
        self.epoch = epoch;
        self.accepted.iter_mut().for_each(|env| env.earlier = env.entries);
    }

    /// Frees the environments that a refused request had reserved.
    fn roll_back(&mut self) {
        for entry in self.entries.drain(..) {
            self.accepted[entry.env as usize].entries -= 1;
        }
    }
}

/// What [`Lane::accept`] found.
pub(crate) enum Received<'a, I> {
    /// No request is waiting.
    Nothing,
    /// A request that the lane ignored or rejected.
    Refused,
    /// A request that the lane accepted.
    Accepted(AcceptedEntries<'a, I>),
}

/// The entries of an accepted request. The lane's intake stays locked while they are shared out.
pub(crate) struct AcceptedEntries<'a, I>(MutexGuard<'a, Intake<I>>);

impl<I> Deref for AcceptedEntries<'_, I> {
    type Target = [Entry];

    fn deref(&self) -> &[Entry] {
        &self.0.entries
    }
}

impl<T: Transport> Lane<T> {
    /// Receives the next request and accepts or refuses it.
    pub(crate) fn accept(&self) -> Received<'_, T::Inlet> {
        let mut intake = lock(&self.intake);
        let message = intake.inlet.receive().unwrap_or_else(|error| {
            tracing::warn!(lane = self.name, %error, "requests cannot be received");
            None
        });
        let Some(message) = message else { return Received::Nothing };
        let request = match message.request() {
            Ok(request) => request,
            Err(rejection) => {
                // A malformed request names no sender to answer. Our own client sends well-formed requests.
                tracing::warn!(lane = self.name, %rejection, "request ignored");
                self.counters.rejected();
                return Received::Refused;
            }
        };
        let Some(epoch) = intake.epoch.filter(|epoch| epoch.session == request.session) else {
            tracing::debug!(
                lane = self.name,
                session = request.session.0,
                "request of another session ignored"
            );
            self.counters.rejected();
            return Received::Refused;
        };
        match self.try_accept(&mut intake, epoch, &request) {
            Ok(()) => {
                self.counters.accepted(message.waited());
                Received::Accepted(AcceptedEntries(intake))
            }
            Err(rejection) => {
                intake.roll_back();
                // The answer may wait for a frame, and the control thread must not wait for that.
                drop(intake);
                self.reject(&request, &rejection);
                Received::Refused
            }
        }
    }

    /// Marks the request's environments busy and copies their actions. After an error the caller rolls back.
    fn try_accept(
        &self,
        intake: &mut Intake<T::Inlet>,
        epoch: Epoch,
        request: &Request<'_>,
    ) -> Result<(), Rejection> {
        intake.entries.clear();
        intake.ticket.0 += 1;
        check_order(intake.last_request, request.number)?;
        intake.last_request = Some(request.number);
        if let Some(text) = self.failure() {
            return Err(Rejection::LaneFailed { text: text.to_owned() });
        }
        match request.kind {
            RequestKind::Step => self.try_accept_step(intake, epoch, request),
            RequestKind::Reset { seed } => self.try_accept_reset(intake, epoch, request, seed),
        }
    }

    fn try_accept_step(
        &self,
        intake: &mut Intake<T::Inlet>,
        epoch: Epoch,
        request: &Request<'_>,
    ) -> Result<(), Rejection> {
        let Request { env_ids, actions, .. } = *request;
        if epoch.reset.is_none() {
            return Err(Rejection::NotReset);
        }
        if self.is_synchronous() && env_ids.len() != self.num_envs {
            return Err(Rejection::IncompleteBatch { given: env_ids.len(), expected: self.num_envs });
        }
        prefetch(env_ids);
        prefetch(actions);
        for (id, actions) in env_ids.iter().zip(actions.chunks_exact(self.layout.sizes().n_agents)) {
            let env = env_index(id.load(Ordering::Relaxed), self.num_envs)?;
            self.reserve(intake, epoch, env, Task::Step)?;
            let is_over = self.reports.is_over(env);
            if is_over && self.autoreset == Autoreset::Disabled {
                return Err(Rejection::FinishedEnv { env });
            }
            // Each action is read once: a learner could change its sample after the check.
            let agents = self.actions_of(env).iter().zip(actions).zip(self.reports.masks(env));
            for (agent, ((own, sent), mask)) in agents.enumerate() {
                let action = sent.load(Ordering::Relaxed);
                if !is_over && !mask.has(action) {
                    let available = mask.actions();
                    return Err(Rejection::UnavailableAction { env, agent, action, available });
                }
                own.store(action, Ordering::Relaxed);
            }
        }
        Ok(())
    }

    fn try_accept_reset(
        &self,
        intake: &mut Intake<T::Inlet>,
        epoch: Epoch,
        request: &Request<'_>,
        seed: Option<u64>,
    ) -> Result<(), Rejection> {
        let is_full = request.env_ids.len() == self.num_envs;
        if epoch.reset.is_none() && !is_full {
            return Err(Rejection::NotReset);
        }
        // Every session begins with the lane's own seed, so that it does not depend on earlier learners.
        let seed = if epoch.reset.is_none() { seed.or(Some(self.seed)) } else { seed };
        let reset = |env: usize| Task::Reset { seed: seed.map(|s| s.wrapping_add(env as u64)) };
        if is_full {
            // Checked before the new epoch begins: after that, environments that still step count as free,
            // and a refusal could not make them busy again.
            check_distinct(request.env_ids.iter().map(|id| id.load(Ordering::Relaxed)), self.num_envs)?;
            let epoch = Epoch { reset: Some(request.number), ..epoch };
            intake.begin_epoch(Some(epoch));
            lock(&self.assembler).begin_epoch(Some(epoch));
            return (0..self.num_envs).try_for_each(|env| self.reserve(intake, epoch, env, reset(env)));
        }
        for id in request.env_ids {
            let env = env_index(id.load(Ordering::Relaxed), self.num_envs)?;
            self.reserve(intake, epoch, env, reset(env))?;
        }
        if self.is_synchronous() {
            // A synchronous batch has every environment: the others are observed again.
            for env in 0..self.num_envs {
                match self.reserve(intake, epoch, env, Task::Observe) {
                    // A duplicate is an environment that this request resets.
                    Ok(()) | Err(Rejection::DuplicateEnv { .. }) => {}
                    Err(busy) => return Err(busy),
                }
            }
        }
        Ok(())
    }

    /// Marks an environment busy with a task of the request being accepted.
    fn reserve(
        &self,
        intake: &mut Intake<T::Inlet>,
        epoch: Epoch,
        env: usize,
        task: Task,
    ) -> Result<(), Rejection> {
        let accepted = &mut intake.accepted[env];
        if accepted.entries > accepted.earlier.max(self.reports.turn(env)) {
            let is_same = accepted.ticket == intake.ticket;
            return Err(if is_same { Rejection::DuplicateEnv { env } } else { Rejection::BusyEnv { env } });
        }
        accepted.entries += 1;
        accepted.ticket = intake.ticket;
        intake.entries.push(Entry { env: env as u32, task, epoch, turn: accepted.entries });
        Ok(())
    }
}

/// Reads one integer per cache line (the last line may be left out). The learner's core wrote these lines, so
/// each first read is a transfer between cores; reading them in a row lets the transfers overlap.
fn prefetch(integers: &[AtomicI32]) {
    const LINE: usize = 64 / size_of::<i32>();
    black_box(integers.iter().step_by(LINE).fold(0, |sum, x| sum ^ x.load(Ordering::Relaxed)));
}

/// An epoch is named by the request that began it, so numbers must not repeat within a session.
fn check_order(last: Option<RequestNumber>, number: RequestNumber) -> Result<(), Rejection> {
    let last = last.unwrap_or(RequestNumber(0)); // a session's first request has number 1
    if number > last {
        return Ok(());
    }
    Err(Rejection::Malformed {
        what: format!("request numbers must increase, got {} after {}", number.0, last.0),
    })
}
