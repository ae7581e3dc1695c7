//! A lane: N environments of one scenario with one learner. A request is accepted (`accept`), and a worker's
//! run of environments becomes slots of a frame. Which thread does what is decided elsewhere (`workers`).

mod accept;
mod figures;

pub(crate) use accept::Entry;
pub use figures::LaneFigures;

use crate::environment::MakeEnvironment;
use crate::fields::FieldSet;
use crate::layout::Layout;
use crate::outbox::{Claim, Outbox};
use crate::rejection::Rejection;
use crate::seat::{Autoreset, Seat, Tally};
use crate::sync::{Mutex, lock};
use crate::transport::{Request, Round, Transport};
use accept::Intake;
use figures::Counters;
use smaclite_engine::{Scratch, Sizes, Step};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// How long to wait for a frame. Memory that a dead process held comes back within 100 ms.
const RECLAIM_TIME: Duration = Duration::from_secs(2);

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

pub(crate) struct Lane<T: Transport> {
    name: String,
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
    /// An error is the transport's, which has no frame.
    pub(crate) fn new(spec: &LaneSpec, inlet: T::Inlet, outlet: T::Outlet) -> Result<Self, String> {
        Ok(Lane {
            name: spec.name.clone(),
            num_envs: spec.num_envs,
            seed: spec.seed,
            autoreset: spec.autoreset,
            layout: spec.layout(),
            seats: (0..spec.num_envs).map(|i| Mutex::new(Seat::new((spec.make)(i)))).collect(),
            intake: Mutex::new(Intake::new(inlet)),
            outbox: Mutex::new(Outbox::new(outlet, spec.batch_size)?),
            failure: OnceLock::new(),
            counters: Counters::default(),
        })
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
        intake.set_session(session);
        self.begin_round(intake.round);
    }

    pub(crate) fn figures(&self) -> LaneFigures {
        self.counters.read()
    }

    pub(crate) fn failure(&self) -> Option<&str> {
        self.failure.get().map(String::as_str)
    }

    /// Called under the intake's lock. Work of the old round is still carried out, so that what follows does
    /// not depend on how far the workers were; but the outbox gives it no slot.
    fn begin_round(&self, round: Round) {
        lock(&self.outbox).begin_round(round);
        self.seats.iter().for_each(|seat| lock(seat).busy = None);
    }

    /// Answers a request with the reason why it was refused. May wait for a frame: the caller holds no lock.
    fn reject(&self, request: &Request<'_>, rejection: &Rejection) {
        tracing::debug!(%rejection, "request rejected");
        self.counters.rejected();
        let text = text_of(rejection);
        let sent = self.when_a_frame_is_there(|outbox| outbox.report(request.session, request.number, &text));
        sent.unwrap_or_else(|error| self.fail(error));
    }

    /// Retries what needs a frame for as long as there is none, up to [`RECLAIM_TIME`]. The lane's memory
    /// suffices by calculation, but what a killed learner held comes back only when the control thread cleans
    /// up after it, and for that it may need any lock of this lane. So the caller holds none.
    fn when_a_frame_is_there<R>(
        &self,
        mut attempt: impl FnMut(&mut Outbox<T::Outlet>) -> Result<R, String>,
    ) -> Result<R, String> {
        let mut begin = None; // a clock is read only where there is no frame
        loop {
            let outcome = attempt(&mut lock(&self.outbox));
            if outcome.is_ok() || begin.get_or_insert_with(Instant::now).elapsed() >= RECLAIM_TIME {
                return outcome;
            }
            std::thread::sleep(Duration::from_millis(1));
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
                // A worker that was busy elsewhere may find an old round's steps and a new one's resets at
                // once.
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
        self.counters.stepped(&tally);
    }

    /// Synchronous: all slots of the run are claimed at once, since environment i has slot i of the one open
    /// frame.
    fn serve_run(&self, run: &[Entry], scratch: &mut Scratch, tally: &mut Tally) -> Result<(), String> {
        let Some(first) = run.first() else { return Ok(()) };
        let claim = self.when_a_frame_is_there(|outbox| outbox.claim(first.round, run.len()))?;
        for entry in run {
            self.serve_seat(entry, scratch, tally, |env| Ok(claim.map(|claim| (claim, env))))?;
        }
        claim.into_iter().for_each(|claim| self.finish(claim));
        Ok(())
    }

    /// Asynchronous: whoever finishes first gets the next slot.
    fn serve_each(&self, run: &[Entry], scratch: &mut Scratch, tally: &mut Tally) -> Result<(), String> {
        for entry in run {
            let claim_slot = |_| {
                let claim = self.when_a_frame_is_there(|outbox| outbox.claim(entry.round, 1))?;
                Ok(claim.map(|claim| (claim, claim.first)))
            };
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
        let step: Option<Step> = lock(&self.seats[env]).run(entry.task, self.autoreset, scratch);
        tally.count(step);
        // Meanwhile a new round may give the seat another task, but only this worker carries it out.
        let claimed = claim_slot(env)?;
        let mut seat = lock(&self.seats[env]);
        let Some((claim, index)) = claimed else {
            seat.forgo(self.autoreset);
            return Ok(None);
        };
        // SAFETY: the outbox keeps the frame's loan until every claimed slot is reported as written, which
        // `finish` does after this. Slots are distinct: an asynchronous lane's claims do not overlap, and in
        // a synchronous one `index` is the environment, which an accepted request holds once (`busy`).
        let mut slot = unsafe { claim.memory.slot(&self.layout, index) };
        seat.write(env, step, self.autoreset, &mut slot, scratch);
        // Claimed in an old round, the seat may be another request's by now.
        seat.busy = seat.busy.filter(|ticket| *ticket != entry.ticket);
        Ok(Some(claim))
    }

    fn finish(&self, claim: Claim) {
        if lock(&self.outbox).written(claim) {
            self.counters.sent();
        }
    }

    /// Takes the lane out of service; its learner is told, other lanes go on.
    pub(crate) fn fail(&self, text: String) {
        tracing::error!(lane = self.name, text, "lane failed");
        if self.failure.set(text.clone()).is_ok() {
            lock(&self.outbox).report_failure(&text_of(&Rejection::LaneFailed { text }));
        }
    }
}

fn text_of(rejection: &Rejection) -> Vec<u8> {
    serde_json::to_vec(rejection).expect("a rejection is plain data")
}

pub(crate) fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|s| (*s).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "a worker panicked".to_owned())
}
