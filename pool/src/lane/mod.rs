//! A lane: N environments of one scenario with one learner. The leading worker or the learner's own thread
//! accepts its requests (`accept`); any thread steps runs of environments and writes their slots of a frame.
//! `workers` decides which thread does what.

mod accept;
mod reports;
mod stats;

pub(crate) use accept::{Entry, Received};
pub use stats::LaneStats;

use crate::autoreset::Autoreset;
use crate::environment::MakeEnvironment;
use crate::episode_log::{EpisodePart, LogCursor};
use crate::frame_assembler::{FrameAssembler, SlotClaim};
use crate::hosted_env::{HostedEnv, Task};
use crate::lane_settings::LaneSettings;
use crate::layout::Layout;
use crate::rejection::Rejection;
use crate::slot::FrameMemory;
use crate::sync::{AtomicBool, Mutex, MutexGuard, Ordering, lock, yield_now};
use crate::transport::{Request, SessionId, Transport, TransportError};
use accept::Intake;
use arrayvec::ArrayVec;
use reports::Reports;
use smaclite_engine::{Scratch, Sizes, Step};
use stats::{Counters, StepCounts};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::OnceLock;
use std::sync::atomic::AtomicI32;
use std::time::{Duration, Instant};

/// How long a worker waits for a free frame. The control thread recovers a dead process's frames within 100
/// ms.
const FRAME_TIMEOUT: Duration = Duration::from_secs(2);

/// Most environments that a thread takes at a time: enough to make queueing cheap, few enough that lanes take
/// turns.
pub(crate) const RUN: usize = 16;

/// How to build a lane.
pub struct LaneSpec {
    /// The name learners attach by.
    pub name: String,
    /// Sizes of every environment.
    pub sizes: Sizes,
    /// Number of environments, batches, seed, autoreset, fields, and what is appended to observations.
    pub settings: LaneSettings,
    /// Makes environment `i`.
    pub make: MakeEnvironment,
}

impl LaneSpec {
    /// The layout of this lane's frames.
    pub fn layout(&self) -> Layout {
        self.settings.layout(self.settings.frame_sizes(self.sizes))
    }
}

pub(crate) struct Lane<T: Transport> {
    name: String,
    num_envs: usize,
    seed: u64,
    autoreset: Autoreset,
    layout: Layout,
    envs: Vec<Mutex<HostedEnv>>,
    /// `[num_envs, n_agents]`: the accepted joint actions, private copies. That of an environment is written
    /// while it is not busy.
    actions: Vec<AtomicI32>,
    reports: Reports,
    intake: Mutex<Intake<T::Inlet>>,
    assembler: Mutex<FrameAssembler<T::Outlet>>,
    /// The learner is a thread of this process that accepts its requests itself.
    has_helper: AtomicBool,
    failure: OnceLock<String>,
    counters: Counters,
}

impl<T: Transport> Lane<T> {
    /// Builds the environments and reserves the lane's first frame.
    pub(crate) fn new(spec: &LaneSpec, inlet: T::Inlet, outlet: T::Outlet) -> Result<Self, TransportError> {
        let LaneSettings { num_envs, batch_size, seed, autoreset, .. } = spec.settings;
        Ok(Lane {
            name: spec.name.clone(),
            num_envs,
            seed,
            autoreset,
            layout: spec.layout(),
            envs: (0..num_envs).map(|i| Mutex::new(HostedEnv::new((spec.make)(i), &spec.settings))).collect(),
            actions: (0..num_envs * spec.sizes.n_agents).map(|_| AtomicI32::new(0)).collect(),
            reports: Reports::new(num_envs, spec.sizes),
            intake: Mutex::new(Intake::new(inlet, num_envs)),
            assembler: Mutex::new(FrameAssembler::new(outlet, batch_size)?),
            has_helper: AtomicBool::new(false),
            failure: OnceLock::new(),
            counters: Counters::default(),
        })
    }

    pub(crate) fn num_envs(&self) -> usize {
        self.num_envs
    }

    pub(crate) fn is_synchronous(&self) -> bool {
        self.layout.slots() == self.num_envs
    }

    /// Serves `session` from now on. Nothing of an earlier session reaches it.
    pub(crate) fn set_session(&self, session: Option<SessionId>) {
        let mut intake = lock(&self.intake);
        let epoch = intake.begin_session(session);
        self.has_helper.store(false, Ordering::Release);
        // Work of the old epoch is still carried out, so that later episodes do not depend on how far the
        // workers had come; but its results get no slots.
        lock(&self.assembler).begin_epoch(epoch);
    }

    /// From now on the learner of `session` accepts its requests itself; `false` if it is not the lane's.
    pub(crate) fn begin_help(&self, session: SessionId) -> bool {
        let intake = lock(&self.intake);
        let is_current = intake.session() == Some(session);
        if is_current {
            self.has_helper.store(true, Ordering::Release);
        }
        is_current
    }

    /// Ends [`begin_help`](Lane::begin_help), unless the session has ended before.
    pub(crate) fn end_help(&self, session: SessionId) {
        let intake = lock(&self.intake);
        if intake.session() == Some(session) {
            self.has_helper.store(false, Ordering::Release);
        }
    }

    /// Whether the learner accepts its requests itself.
    pub(crate) fn has_helper(&self) -> bool {
        self.has_helper.load(Ordering::Acquire)
    }

    /// Adds a follower to an environment; `false` if it cannot be followed.
    pub(crate) fn follow(&self, env: usize) -> bool {
        lock(&self.envs[env]).follow()
    }

    pub(crate) fn unfollow(&self, env: usize) {
        lock(&self.envs[env]).unfollow();
    }

    pub(crate) fn read_log(&self, env: usize, cursor: &mut LogCursor) -> Vec<EpisodePart> {
        lock(&self.envs[env]).read_log(cursor)
    }

    pub(crate) fn stats(&self) -> LaneStats {
        self.counters.read()
    }

    pub(crate) fn failure(&self) -> Option<&str> {
        self.failure.get().map(String::as_str)
    }

    fn actions_of(&self, env: usize) -> &[AtomicI32] {
        let n_agents = self.layout.sizes().n_agents;
        &self.actions[env * n_agents..][..n_agents]
    }

    /// Answers a request with the reason why it was refused. May wait for a frame, so the caller holds no
    /// lock.
    fn reject(&self, request: &Request<'_>, rejection: &Rejection) {
        tracing::debug!(lane = self.name, %rejection, "request rejected");
        self.counters.rejected();
        let text = json(rejection);
        let sent = self.with_frame(|frames| frames.report_rejection(request.session, request.number, &text));
        sent.unwrap_or_else(|error| self.fail(error.to_string()));
    }

    /// Retries `attempt` while no frame is free, for at most [`FRAME_TIMEOUT`]. The lane's memory suffices by
    /// calculation, but frames that a killed learner held come back only when the control thread recovers
    /// them, and for that it may need any lock of this lane. So the caller holds none.
    fn with_frame<R>(
        &self,
        mut attempt: impl FnMut(&mut FrameAssembler<T::Outlet>) -> Result<R, TransportError>,
    ) -> Result<R, TransportError> {
        let mut begin = None; // the clock is read only when no frame is free
        loop {
            let outcome = attempt(&mut lock(&self.assembler));
            if outcome.is_ok() || begin.get_or_insert_with(Instant::now).elapsed() >= FRAME_TIMEOUT {
                return outcome;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Steps a run of environments and writes their slots. `run` has the order of the requests.
    pub(crate) fn serve(&self, run: &[Entry], scratch: &mut Scratch) {
        if self.failure().is_some() {
            return; // after a panic the environments may be in any state
        }
        let mut counts = StepCounts::default();
        let served = catch_unwind(AssertUnwindSafe(|| {
            if self.is_synchronous() {
                self.serve_synchronous(run, scratch, &mut counts)
            } else {
                self.serve_asynchronous(run, scratch, &mut counts)
            }
        }));
        match served {
            Ok(Ok(())) => {}
            Ok(Err(error)) => self.fail(error.to_string()),
            Err(panic) => self.fail(panic_text(panic.as_ref())),
        }
        self.counters.stepped(&counts);
    }

    /// Environment i has slot i of the one open frame, so the slots of a whole run are claimed at once.
    fn serve_synchronous(
        &self,
        run: &[Entry],
        scratch: &mut Scratch,
        counts: &mut StepCounts,
    ) -> Result<(), TransportError> {
        // After a delay there may be steps of an old epoch and resets of a new one in the same run.
        for run in run.chunk_by(|a, b| a.epoch == b.epoch) {
            let claim = self.with_frame(|frames| frames.claim(run[0].epoch, run.len()))?;
            // All are locked before the first is written: to lock or unlock is to wait until every earlier
            // write has reached the cache, and those to a frame take long, since the learner has read it.
            // No two threads wait for each other: one holds an environment only if all earlier entries of it
            // are done.
            let mut locked = ArrayVec::<_, RUN>::new();
            for entry in run {
                let Some(hosted) = self.lock_in_turn(entry) else { return Ok(()) };
                locked.push(hosted);
            }
            for (entry, hosted) in run.iter().zip(&mut locked) {
                let step = self.step(hosted, entry, scratch, counts);
                let slot = claim.map(|claim| (claim.memory, entry.env as usize));
                self.write(hosted, entry, step, slot, scratch);
            }
            drop(locked);
            self.complete(claim);
        }
        Ok(())
    }

    /// Results get slots in the order in which they are ready.
    fn serve_asynchronous(
        &self,
        run: &[Entry],
        scratch: &mut Scratch,
        counts: &mut StepCounts,
    ) -> Result<(), TransportError> {
        for entry in run {
            let Some(mut hosted) = self.lock_in_turn(entry) else { return Ok(()) };
            let step = self.step(&mut hosted, entry, scratch, counts);
            drop(hosted); // the claim may wait for a frame
            let claim = self.with_frame(|frames| frames.claim(entry.epoch, 1))?;
            let mut hosted = lock(&self.envs[entry.env as usize]);
            let slot = claim.map(|claim| (claim.memory, claim.first));
            self.write(&mut hosted, entry, step, slot, scratch);
            drop(hosted);
            self.complete(claim);
        }
        Ok(())
    }

    /// Locks an entry's environment once its earlier entries are done; `None` if the lane failed. There are
    /// earlier ones only if a new epoch began; they left the queue before this one, but another thread may
    /// have taken them and not come to them yet.
    fn lock_in_turn(&self, entry: &Entry) -> Option<MutexGuard<'_, HostedEnv>> {
        loop {
            let env = entry.env as usize;
            if self.reports.turn(env) + 1 == entry.turn {
                return Some(lock(&self.envs[env]));
            }
            if self.failure().is_some() {
                return None;
            }
            yield_now();
        }
    }

    #[inline(always)]
    fn step(
        &self,
        hosted: &mut HostedEnv,
        entry: &Entry,
        scratch: &mut Scratch,
        counts: &mut StepCounts,
    ) -> Option<Step> {
        if entry.task == Task::Step {
            let accepted = self.actions_of(entry.env as usize).iter();
            let own = hosted.actions.iter_mut().zip(accepted);
            own.for_each(|(own, accepted)| *own = accepted.load(Ordering::Relaxed));
        }
        let step = hosted.run(entry.task, self.autoreset, scratch)?;
        counts.count(&step, hosted.env.episode_return());
        Some(step)
    }

    /// Writes an environment's results into its slot, or discards them if their epoch is over.
    fn write(
        &self,
        hosted: &mut HostedEnv,
        entry: &Entry,
        step: Option<Step>,
        slot: Option<(FrameMemory, usize)>,
        scratch: &mut Scratch,
    ) {
        let env = entry.env as usize;
        if let Some((memory, index)) = slot {
            // SAFETY: the frame assembler keeps the frame's loan until every claimed slot is complete, which
            // the caller reports after this. Slots are distinct: the claims of an asynchronous lane do not
            // overlap, and in a synchronous lane `index` is the environment, which an accepted request names
            // once (`Lane::reserve`).
            let mut slot = unsafe { memory.slot(&self.layout, index) };
            hosted.write(env, step, self.autoreset, &mut slot, scratch);
        } else {
            hosted.discard(self.autoreset);
        }
        self.reports.report(env, entry.turn, hosted);
    }

    fn complete(&self, claim: Option<SlotClaim>) {
        if claim.is_some_and(|claim| lock(&self.assembler).complete(claim)) {
            self.counters.published();
        }
    }

    /// Takes the lane out of service and reports why to its learner. Other lanes go on.
    pub(crate) fn fail(&self, text: String) {
        tracing::error!(lane = self.name, text, "lane failed");
        if self.failure.set(text.clone()).is_ok() {
            lock(&self.assembler).report_failure(&json(&Rejection::LaneFailed { text }));
        }
    }
}

fn json(rejection: &Rejection) -> Vec<u8> {
    serde_json::to_vec(rejection).expect("a rejection is plain data")
}

pub(crate) fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|s| (*s).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "a worker panicked".to_owned())
}
