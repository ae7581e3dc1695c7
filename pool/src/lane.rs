//! A lane: N environments of one scenario with one learner. Here a request is checked and accepted, and here a
//! worker's run of environments becomes slots of a frame. Which thread does what is decided elsewhere (`workers`).

use crate::environment::MakeEnvironment;
use crate::fields::FieldSet;
use crate::layout::Layout;
use crate::outbox::{Claim, Outbox};
use crate::rejection::Rejection;
use crate::seat::{Autoreset, Seat, Tally, Task};
use crate::sync::{Mutex, MutexGuard, lock};
use crate::transport::{Inlet, Message, Request, RequestKind, Round, Transport};
use serde::{Deserialize, Serialize};
use smaclite_engine::{IllegalAction, Scratch, Sizes, Step};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicI32, AtomicU64, Ordering};

/// How to build a lane.
pub struct LaneSpec {
    /// The name learners attach by.
    pub name: String,
    /// Sizes of every environment of the lane.
    pub sizes: Sizes,
    /// How many environments (N).
    pub num_envs: usize,
    /// Slots of a frame (M): N for synchronous stepping, fewer for asynchronous.
    pub batch_size: usize,
    /// Environment `i` starts with seed `seed + i` in every session.
    pub seed: u64,
    /// What happens at an episode's end.
    pub autoreset: Autoreset,
    /// The fields of a frame; the `final_*` ones are kept only under same-step autoreset.
    pub fields: FieldSet,
    /// Makes environment `i`.
    pub make: MakeEnvironment,
}

impl LaneSpec {
    /// The layout of this lane's frames.
    pub fn layout(&self) -> Layout {
        let mut fields = self.fields;
        if self.autoreset != Autoreset::SameStep {
            fields.iter().filter(|f| f.is_final()).for_each(|f| fields.remove(f));
        }
        Layout::new(self.sizes, self.batch_size, fields)
    }
}

/// A lane's figures since it began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LaneFigures {
    /// Steps of single environments; resets do not count.
    pub steps: u64,
    /// Episodes that ended.
    pub episodes: u64,
    /// Episodes that the agents won.
    pub wins: u64,
    /// Frames sent.
    pub frames: u64,
    /// Requests refused.
    pub rejected: u64,
    /// Requests accepted.
    pub accepted: u64,
    /// Nanoseconds that the accepted requests waited for a worker, summed.
    pub waited_ns: u64,
}

#[derive(Default)]
struct Counters {
    steps: AtomicU64,
    episodes: AtomicU64,
    wins: AtomicU64,
    frames: AtomicU64,
    rejected: AtomicU64,
    accepted: AtomicU64,
    waited_ns: AtomicU64,
}

/// One environment's share of an accepted request.
#[derive(Clone, Copy)]
pub(crate) struct Entry {
    pub(crate) env: u32,
    task: Task,
    round: Round,
    ticket: u64,
}

/// The receiving side, held by the leading worker while it accepts requests and by the control side while it changes
/// who the learner is.
struct Intake<I> {
    inlet: I,
    session: Option<u64>,
    round: Round,
    was_reset: bool,
    /// Number of the session's last request.
    number: u64,
    /// Counts requests, so that a busy seat tells whether this very request took it.
    ticket: u64,
    /// The entries of the request being accepted.
    accepted: Vec<Entry>,
}

/// A request on its way to acceptance.
struct Checking<'a> {
    request: Request<'a>,
    round: &'a mut Round,
    was_reset: bool,
    ticket: u64,
    accepted: &'a mut Vec<Entry>,
}

pub(crate) struct Lane<T: Transport> {
    num_envs: usize,
    seed: u64,
    autoreset: Autoreset,
    layout: Layout,
    seats: Vec<Mutex<Seat>>,
    intake: Mutex<Intake<T::Inlet>>,
    outbox: Mutex<Outbox<T::Outlet>>,
    failure: OnceLock<String>,
    counters: Counters,
}

impl<T: Transport> Lane<T> {
    pub(crate) fn new(spec: &LaneSpec, inlet: T::Inlet, outlet: T::Outlet) -> Self {
        Lane {
            num_envs: spec.num_envs,
            seed: spec.seed,
            autoreset: spec.autoreset,
            layout: spec.layout(),
            seats: (0..spec.num_envs).map(|i| Mutex::new(Seat::new((spec.make)(i)))).collect(),
            intake: Mutex::new(Intake {
                inlet,
                session: None,
                round: Round::default(),
                was_reset: false,
                number: 0,
                ticket: 0,
                accepted: Vec::new(),
            }),
            outbox: Mutex::new(Outbox::new(outlet, spec.batch_size)),
            failure: OnceLock::new(),
            counters: Counters::default(),
        }
    }

    pub(crate) fn num_envs(&self) -> usize {
        self.num_envs
    }

    fn is_synchronous(&self) -> bool {
        self.layout.slots() == self.num_envs
    }

    /// From now on requests of `session` are served, and nothing of an earlier session reaches it.
    pub(crate) fn set_session(&self, session: Option<u64>) {
        let mut intake = lock(&self.intake);
        intake.session = session;
        intake.was_reset = false;
        intake.number = 0;
        intake.round = Round { session: session.unwrap_or(0), request: 0 };
        self.begin_round(intake.round);
    }

    pub(crate) fn figures(&self) -> LaneFigures {
        let c = &self.counters;
        let read = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        LaneFigures {
            steps: read(&c.steps),
            episodes: read(&c.episodes),
            wins: read(&c.wins),
            frames: read(&c.frames),
            rejected: read(&c.rejected),
            accepted: read(&c.accepted),
            waited_ns: read(&c.waited_ns),
        }
    }

    pub(crate) fn failure(&self) -> Option<&str> {
        self.failure.get().map(String::as_str)
    }

    /// Accepts the next request, if there is one, and gives its entries to `share_out`. `false` if there was none.
    pub(crate) fn accept(&self, share_out: impl FnOnce(&[Entry])) -> bool {
        let mut intake = lock(&self.intake);
        let intake = &mut *intake;
        let Some(message) = intake.inlet.receive() else { return false };
        let request = match message.request() {
            Ok(request) => request,
            Err(rejection) => {
                // Without a form it has no sender either; the learner's own client sends well-formed requests.
                tracing::warn!(%rejection, "request ignored");
                self.counters.rejected.fetch_add(1, Ordering::Relaxed);
                return true;
            }
        };
        if Some(request.session) != intake.session {
            tracing::debug!(session = request.session, "request of another session ignored");
            self.counters.rejected.fetch_add(1, Ordering::Relaxed);
            return true;
        }
        intake.accepted.clear();
        intake.ticket += 1;
        let last = intake.number;
        intake.number = last.max(request.number);
        let Intake { was_reset, ticket, ref mut round, ref mut accepted, .. } = *intake;
        let checked = in_order(last, request.number)
            .and_then(|()| self.check(&mut Checking { request, round, was_reset, ticket, accepted }));
        match checked {
            Ok(()) => {
                intake.was_reset = true;
                self.counters.accepted.fetch_add(1, Ordering::Relaxed);
                self.counters.waited_ns.fetch_add(message.waited().as_nanos() as u64, Ordering::Relaxed);
                share_out(&intake.accepted);
            }
            Err(rejection) => {
                self.give_up(&intake.accepted);
                self.reject(request.number, &rejection);
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
        for (id, actions) in env_ids.iter().zip(actions.chunks_exact(self.layout.sizes().n_agents)) {
            let env = self.env_of(id.load(Ordering::Relaxed))?;
            let mut seat = self.take_seat(env, Task::Step, checking)?;
            let seat = &mut *seat;
            seat.actions.iter_mut().zip(actions).for_each(|(own, sent)| *own = sent.load(Ordering::Relaxed));
            if !seat.over {
                seat.game.check(&seat.actions).map_err(|illegal| at_env(env, illegal))?;
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
            self.check_all_named(env_ids)?;
            *checking.round = Round { request: checking.request.number, ..*checking.round };
            self.begin_round(*checking.round);
            return (0..self.num_envs)
                .try_for_each(|env| self.take_seat(env, reset(env), checking).map(drop));
        }
        for id in env_ids {
            let env = self.env_of(id.load(Ordering::Relaxed))?;
            drop(self.take_seat(env, reset(env), checking)?);
        }
        if self.is_synchronous() {
            for env in 0..self.num_envs {
                match self.take_seat(env, Task::Observe, checking) {
                    Ok(_) | Err(Rejection::DuplicateEnv { .. }) => {} // the reset ones have their slot already
                    Err(busy) => return Err(busy),
                }
            }
        }
        Ok(())
    }

    /// Before a round is given up for a reset of all environments: are they all named? Otherwise a refused request would
    /// have freed seats that are still at work.
    fn check_all_named(&self, env_ids: &[AtomicI32]) -> Result<(), Rejection> {
        let mut named = vec![false; self.num_envs];
        env_ids.iter().try_for_each(|id| {
            let env = self.env_of(id.load(Ordering::Relaxed))?;
            if std::mem::replace(&mut named[env], true) {
                Err(Rejection::DuplicateEnv { env })
            } else {
                Ok(())
            }
        })
    }

    /// Marks a seat busy, or says who took it.
    fn take_seat(
        &self,
        env: usize,
        task: Task,
        checking: &mut Checking<'_>,
    ) -> Result<MutexGuard<'_, Seat>, Rejection> {
        let mut seat = lock(&self.seats[env]);
        match seat.busy {
            Some(ticket) if ticket == checking.ticket => Err(Rejection::DuplicateEnv { env }),
            Some(_) => Err(Rejection::BusyEnv { env }),
            None => {
                seat.busy = Some(checking.ticket);
                let (round, ticket) = (*checking.round, checking.ticket);
                checking.accepted.push(Entry { env: env as u32, task, round, ticket });
                Ok(seat)
            }
        }
    }

    fn env_of(&self, id: i32) -> Result<usize, Rejection> {
        usize::try_from(id)
            .ok()
            .filter(|env| *env < self.num_envs)
            .ok_or(Rejection::UnknownEnv { env: i64::from(id), num_envs: self.num_envs })
    }

    /// A refused request leaves no trace.
    fn give_up(&self, accepted: &[Entry]) {
        accepted.iter().for_each(|e| lock(&self.seats[e.env as usize]).busy = None);
    }

    /// Called under the intake's lock. Work of the old round is still carried out, so that what follows does not depend
    /// on how far the workers were; but the outbox gives it no slot.
    fn begin_round(&self, round: Round) {
        lock(&self.outbox).begin_round(round);
        self.seats.iter().for_each(|seat| lock(seat).busy = None);
    }

    fn reject(&self, request: u64, rejection: &Rejection) {
        tracing::debug!(%rejection, "request rejected");
        self.counters.rejected.fetch_add(1, Ordering::Relaxed);
        let text = serde_json::to_vec(rejection).expect("a rejection is plain data");
        if let Err(error) = lock(&self.outbox).report(request, &text) {
            tracing::error!(%error, "a rejection could not be sent");
        }
    }

    /// Steps a worker's run of environments and writes their slots. `run` is in the order it was shared out.
    pub(crate) fn serve(&self, run: &[Entry], scratch: &mut Scratch) {
        if self.failure().is_some() {
            return; // what panicked once may be in any state
        }
        let mut tally = Tally::default();
        let served = catch_unwind(AssertUnwindSafe(|| {
            if self.is_synchronous() {
                // A worker that was busy elsewhere may find an old round's steps and a new one's resets at once.
                let mut rounds = run.chunk_by(|a, b| a.round == b.round);
                rounds.try_for_each(|run| self.serve_run(run, scratch, &mut tally))
            } else {
                self.serve_each(run, scratch, &mut tally)
            }
        }));
        match served {
            Ok(Ok(())) => {}
            Ok(Err(text)) => self.fail(text),
            Err(panic) => self.fail(panic_text(panic.as_ref())),
        }
        self.counters.steps.fetch_add(tally.steps, Ordering::Relaxed);
        self.counters.episodes.fetch_add(tally.episodes, Ordering::Relaxed);
        self.counters.wins.fetch_add(tally.wins, Ordering::Relaxed);
    }

    /// Synchronous: all slots of the run are claimed at once, since environment i has slot i of the one open frame.
    fn serve_run(&self, run: &[Entry], scratch: &mut Scratch, tally: &mut Tally) -> Result<(), String> {
        let Some(first) = run.first() else { return Ok(()) };
        let claim = lock(&self.outbox).claim(first.round, run.len())?;
        for entry in run {
            self.serve_seat(entry, scratch, tally, |env| Ok(claim.map(|claim| (claim, env))))?;
        }
        claim.into_iter().for_each(|claim| self.finish(claim));
        Ok(())
    }

    /// Asynchronous: whoever finishes first gets the next slot.
    fn serve_each(&self, run: &[Entry], scratch: &mut Scratch, tally: &mut Tally) -> Result<(), String> {
        for entry in run {
            let claim_slot =
                |_| Ok(lock(&self.outbox).claim(entry.round, 1)?.map(|claim| (claim, claim.first)));
            let claim = self.serve_seat(entry, scratch, tally, claim_slot)?;
            claim.into_iter().for_each(|claim| self.finish(claim));
        }
        Ok(())
    }

    fn serve_seat(
        &self,
        entry: &Entry,
        scratch: &mut Scratch,
        tally: &mut Tally,
        claim_slot: impl FnOnce(usize) -> Result<Option<(Claim, usize)>, String>,
    ) -> Result<Option<Claim>, String> {
        let env = entry.env as usize;
        let mut seat = lock(&self.seats[env]);
        let step: Option<Step> = seat.run(entry.task, self.autoreset, scratch);
        tally.count(step);
        let Some((claim, index)) = claim_slot(env)? else {
            seat.forgo(self.autoreset);
            return Ok(None);
        };
        // SAFETY: the outbox keeps the frame's loan until every claimed slot is reported as written, which `finish`
        // does after this. Slots are distinct: an asynchronous lane's claims do not overlap, and in a synchronous one
        // `index` is the environment, which an accepted request holds once (`busy`).
        let mut slot = unsafe { claim.memory.slot(&self.layout, index) };
        seat.write(env, step, self.autoreset, &mut slot, scratch);
        // Claimed in an old round, the seat may be another request's by now.
        seat.busy = seat.busy.filter(|ticket| *ticket != entry.ticket);
        Ok(Some(claim))
    }

    fn finish(&self, claim: Claim) {
        if lock(&self.outbox).written(claim) {
            self.counters.frames.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Takes the lane out of service; its learner is told, other lanes go on.
    pub(crate) fn fail(&self, text: String) {
        tracing::error!(text, "lane failed");
        let text = self.failure.get_or_init(|| text).clone();
        self.reject(0, &Rejection::LaneFailed { text });
    }
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

pub(crate) fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|s| (*s).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "a worker panicked".to_owned())
}
