//! A lane: N environments of one scenario with one learner. A request is accepted (`accept`), and a worker's
//! run of environments becomes slots of a frame. Which thread does what is decided elsewhere (`workers`).

mod accept;
mod stats;

pub(crate) use accept::Entry;
pub use stats::LaneStats;

use crate::environment::MakeEnvironment;
use crate::frame_assembler::{FrameAssembler, SlotClaim};
use crate::hosted_env::{Autoreset, HostedEnv, StepCounts};
use crate::lane_settings::LaneSettings;
use crate::layout::Layout;
use crate::rejection::Rejection;
use crate::sync::{Mutex, lock};
use crate::transport::{Epoch, Request, Transport};
use accept::Intake;
use smaclite_engine::{Scratch, Sizes, Step};
use stats::Counters;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// How long to wait for a frame. Memory that a dead process held comes back within 100 ms.
const FRAME_TIMEOUT: Duration = Duration::from_secs(2);

/// How to build a lane.
pub struct LaneSpec {
    /// The name learners attach by.
    pub name: String,
    /// Sizes of every environment of the lane.
    pub sizes: Sizes,
    /// How many environments, in which batches, with which fields.
    pub settings: LaneSettings,
    /// Makes environment `i`.
    pub make: MakeEnvironment,
}

impl LaneSpec {
    /// The layout of this lane's frames.
    pub fn layout(&self) -> Layout {
        self.settings.layout(self.sizes)
    }
}

pub(crate) struct Lane<T: Transport> {
    name: String,
    num_envs: usize,
    seed: u64,
    autoreset: Autoreset,
    layout: Layout,
    envs: Vec<Mutex<HostedEnv>>,
    intake: Mutex<Intake<T::Inlet>>,
    assembler: Mutex<FrameAssembler<T::Outlet>>,
    failure: OnceLock<String>,
    counters: Counters,
}

impl<T: Transport> Lane<T> {
    /// An error is the transport's, which has no frame.
    pub(crate) fn new(spec: &LaneSpec, inlet: T::Inlet, outlet: T::Outlet) -> Result<Self, String> {
        let LaneSettings { num_envs, batch_size, seed, autoreset, .. } = spec.settings;
        Ok(Lane {
            name: spec.name.clone(),
            num_envs,
            seed,
            autoreset,
            layout: spec.layout(),
            envs: (0..num_envs).map(|i| Mutex::new(HostedEnv::new((spec.make)(i)))).collect(),
            intake: Mutex::new(Intake::new(inlet)),
            assembler: Mutex::new(FrameAssembler::new(outlet, batch_size)?),
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
        self.begin_epoch(intake.epoch);
    }

    pub(crate) fn stats(&self) -> LaneStats {
        self.counters.read()
    }

    pub(crate) fn failure(&self) -> Option<&str> {
        self.failure.get().map(String::as_str)
    }

    /// Called under the intake's lock. Work of the old round is still carried out, so that what follows does
    /// not depend on how far the workers were; but the frame assembler gives it no slot.
    fn begin_epoch(&self, epoch: Epoch) {
        lock(&self.assembler).begin_epoch(epoch);
        self.envs.iter().for_each(|hosted| lock(hosted).busy = None);
    }

    /// Answers a request with the reason why it was refused. May wait for a frame: the caller holds no lock.
    fn reject(&self, request: &Request<'_>, rejection: &Rejection) {
        tracing::debug!(%rejection, "request rejected");
        self.counters.rejected();
        let text = text_of(rejection);
        let sent =
            self.when_a_frame_is_there(|assembler| assembler.report(request.session, request.number, &text));
        sent.unwrap_or_else(|error| self.fail(error));
    }

    /// Retries what needs a frame for as long as there is none, up to [`FRAME_TIMEOUT`]. The lane's memory
    /// suffices by calculation, but what a killed learner held comes back only when the control thread cleans
    /// up after it, and for that it may need any lock of this lane. So the caller holds none.
    fn when_a_frame_is_there<R>(
        &self,
        mut attempt: impl FnMut(&mut FrameAssembler<T::Outlet>) -> Result<R, String>,
    ) -> Result<R, String> {
        let mut begin = None; // a clock is read only where there is no frame
        loop {
            let outcome = attempt(&mut lock(&self.assembler));
            if outcome.is_ok() || begin.get_or_insert_with(Instant::now).elapsed() >= FRAME_TIMEOUT {
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
        let mut counts = StepCounts::default();
        let served = catch_unwind(AssertUnwindSafe(|| {
            if self.is_synchronous() {
                // A worker that was busy elsewhere may find an old round's steps and a new one's resets at
                // once.
                let mut epochs = run.chunk_by(|a, b| a.epoch == b.epoch);
                epochs.try_for_each(|run| self.serve_run(run, scratch, &mut counts))
            } else {
                self.serve_each(run, scratch, &mut counts)
            }
        }));
        match served {
            Ok(Ok(())) => {}
            Ok(Err(text)) => self.fail(text),
            Err(panic) => self.fail(panic_text(panic.as_ref())),
        }
        self.counters.stepped(&counts);
    }

    /// Synchronous: all slots of the run are claimed at once, since environment i has slot i of the one open
    /// frame.
    fn serve_run(&self, run: &[Entry], scratch: &mut Scratch, counts: &mut StepCounts) -> Result<(), String> {
        let Some(first) = run.first() else { return Ok(()) };
        let claim = self.when_a_frame_is_there(|assembler| assembler.claim(first.epoch, run.len()))?;
        for entry in run {
            self.serve_env(entry, scratch, counts, |env| Ok(claim.map(|claim| (claim, env))))?;
        }
        claim.into_iter().for_each(|claim| self.finish(claim));
        Ok(())
    }

    /// Asynchronous: whoever finishes first gets the next slot.
    fn serve_each(
        &self,
        run: &[Entry],
        scratch: &mut Scratch,
        counts: &mut StepCounts,
    ) -> Result<(), String> {
        for entry in run {
            let claim_slot = |_| {
                let claim = self.when_a_frame_is_there(|assembler| assembler.claim(entry.epoch, 1))?;
                Ok(claim.map(|claim| (claim, claim.first)))
            };
            let claim = self.serve_env(entry, scratch, counts, claim_slot)?;
            claim.into_iter().for_each(|claim| self.finish(claim));
        }
        Ok(())
    }

    fn serve_env(
        &self,
        entry: &Entry,
        scratch: &mut Scratch,
        counts: &mut StepCounts,
        claim_slot: impl FnOnce(usize) -> Result<Option<(SlotClaim, usize)>, String>,
    ) -> Result<Option<SlotClaim>, String> {
        let env = entry.env as usize;
        let step: Option<Step> = lock(&self.envs[env]).run(entry.task, self.autoreset, scratch);
        counts.count(step);
        // Meanwhile a new round may give the seat another task, but only this worker carries it out.
        let claimed = claim_slot(env)?;
        let mut hosted = lock(&self.envs[env]);
        let Some((claim, index)) = claimed else {
            hosted.discard(self.autoreset);
            return Ok(None);
        };
        // SAFETY: the frame assembler keeps the frame's loan until every claimed slot is reported as written, which
        // `finish` does after this. Slots are distinct: an asynchronous lane's claims do not overlap, and in
        // a synchronous one `index` is the environment, which an accepted request holds once (`busy`).
        let mut slot = unsafe { claim.memory.slot(&self.layout, index) };
        hosted.write(env, step, self.autoreset, &mut slot, scratch);
        // Claimed in an old round, the seat may be another request's by now.
        hosted.busy = hosted.busy.filter(|ticket| *ticket != entry.ticket);
        Ok(Some(claim))
    }

    fn finish(&self, claim: SlotClaim) {
        if lock(&self.assembler).complete(claim) {
            self.counters.sent();
        }
    }

    /// Takes the lane out of service; its learner is told, other lanes go on.
    pub(crate) fn fail(&self, text: String) {
        tracing::error!(lane = self.name, text, "lane failed");
        if self.failure.set(text.clone()).is_ok() {
            lock(&self.assembler).report_failure(&text_of(&Rejection::LaneFailed { text }));
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
