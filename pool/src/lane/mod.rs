//! A lane: N environments of one scenario with one learner, or one per side. One thread at a time accepts its
//! requests (`accept`); any thread takes chunks of environments, steps them and writes their slots of a
//! frame. `scheduler` decides which thread does what.

mod accept;
mod branching;
mod env_table;
mod pairing;
mod stats;

pub(crate) use accept::Accepted;
pub use stats::LaneStats;

use crate::autoreset::Autoreset;
use crate::episode_log::{EpisodePart, FollowerId, LogMemory, TooManyFollowed};
use crate::frames::{Frames, SlotClaim};
use crate::hosted_env::HostedEnv;
use crate::joint_action::JointAction;
use crate::lane_settings::{LaneSettings, LaneSpec};
use crate::layout::Layout;
use crate::rejection::Rejection;
use crate::slot::{FrameMemory, SharedFrame};
use crate::stand_in::StandIn;
use crate::sync::{AtomicBool, AtomicUsize, Mutex, Ordering, lock};
use crate::transport::{Request, SessionId, Transport, TransportError};
use crate::wait_strategy::Deadline;
use crate::work::{CHUNK, Work};
use accept::Intake;
use arrayvec::ArrayVec;
use env_table::EnvTable;
use smaclite_engine::policy::Tactic;
use smaclite_engine::{Faction, Scratch, Step};
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// How long a thread waits for a free frame. The control thread recovers a dead process's frames within 100
/// ms.
const FRAME_TIMEOUT: Duration = Duration::from_secs(2);

/// Environments of one scenario with one learner, or one per side.
pub struct Lane<T: Transport> {
    name: String,
    num_envs: usize,
    seed: u64,
    autoreset: Autoreset,
    layout: Layout,
    envs: Vec<Mutex<HostedEnv>>,
    table: EnvTable,
    intake: Mutex<Intake<T::Inlet>>,
    frames: Mutex<Frames<T::Outlet>>,
    work: Work,
    /// Environments with an order that is not carried out. While a synchronous request is carried out there
    /// is one more, for its frame: the thread that finds only that left publishes it.
    outstanding: AtomicUsize,
    /// A reset of all environments waits until none is outstanding.
    reset_waits: AtomicBool,
    /// The frame of the synchronous request that is carried out.
    job_frame: SharedFrame,
    /// The learner is a thread of this process that accepts its requests itself.
    accepts_itself: AtomicBool,
    failure: OnceLock<String>,
    stats: Mutex<LaneStats>,
    logs: LogMemory,
}

impl<T: Transport> Lane<T> {
    /// Builds the environments and reserves the lane's first frame.
    pub(crate) fn new(
        spec: &LaneSpec,
        inlet: T::Inlet,
        outlet: T::Outlet,
        threads: usize,
    ) -> Result<Self, TransportError> {
        let LaneSettings { num_envs, batch_size, seed, autoreset, .. } = spec.settings;
        let record = spec.settings.record_layout(spec.sizes()).map(Arc::new);
        let hosted = |i| HostedEnv::new(i, spec, record.clone());
        Ok(Lane {
            name: spec.name.clone(),
            num_envs,
            seed,
            autoreset,
            layout: spec.layout(),
            envs: (0..num_envs).map(|i| Mutex::new(hosted(i))).collect(),
            table: EnvTable::new(num_envs, spec.sizes()),
            intake: Mutex::new(Intake::new(inlet, num_envs, spec.layout().snapshot_size())),
            frames: Mutex::new(Frames::new(outlet, batch_size)?),
            work: Work::new(num_envs, batch_size == num_envs, threads),
            outstanding: AtomicUsize::new(0),
            reset_waits: AtomicBool::new(false),
            job_frame: SharedFrame::none(&spec.layout()),
            accepts_itself: AtomicBool::new(false),
            failure: OnceLock::new(),
            stats: Mutex::default(),
            logs: LogMemory::new(),
        })
    }

    fn is_synchronous(&self) -> bool {
        matches!(self.work, Work::Synchronous(_))
    }

    /// Whether it can accept a request at once, as far as a glance shows: one to a synchronous lane that is
    /// at work waits or is refused, and an asynchronous one has enough to do as long as something is left to
    /// take.
    pub(crate) fn is_idle(&self) -> bool {
        match &self.work {
            Work::Synchronous(_) => self.outstanding.load(Ordering::Relaxed) == 0,
            Work::Asynchronous(queue) => queue.is_empty(),
        }
    }

    /// What no thread has taken yet.
    pub(crate) fn work(&self) -> &Work {
        &self.work
    }

    /// Serves `session` from now on, beginning with a reset; `None` is no learner. Nothing of an earlier
    /// session reaches it. Its work is still carried out, so that later episodes do not depend on how far the
    /// threads had come, but its results get no slots.
    pub fn set_session(&self, session: Option<SessionId>) {
        if self.layout.sizes().enemies.is_some() {
            self.set_stand_ins(|_| None);
        }
        let mut intake = lock(&self.intake);
        intake.begin_session(session);
        self.reset_waits.store(false, Ordering::SeqCst);
        self.accepts_itself.store(false, Ordering::Release);
        lock(&self.frames).begin_session(session);
    }

    /// A scripted policy plays `side` from now on, because its learner left; that of the other side goes on.
    pub fn stand_in(&self, side: Faction, tactic: Tactic) {
        self.set_stand_ins(|env| Some(StandIn::new(side, tactic, env as u64)));
        lock(&self.intake).set_left(side);
    }

    fn set_stand_ins(&self, stand_in: impl Fn(usize) -> Option<StandIn>) {
        let envs = self.envs.iter().enumerate();
        envs.for_each(|(i, env)| lock(env).set_stand_in(stand_in(i)));
    }

    /// Ends the session because the learner of `side` left, and tells that of the other side.
    pub fn end_session(&self, side: Faction) {
        lock(&self.frames).report_end(&json(&Rejection::OtherLearnerLeft { side }));
        self.set_session(None);
    }

    /// Whether the learner of `session`, a thread of this process, accepts its requests itself. Changes
    /// nothing and returns `false` if that is not the lane's session.
    pub(crate) fn set_accepts_itself(&self, session: SessionId, accepts: bool) -> bool {
        let intake = lock(&self.intake);
        let is_current = intake.session() == Some(session);
        if is_current {
            self.accepts_itself.store(accepts, Ordering::Release);
        }
        is_current
    }

    /// Whether the learner accepts its requests itself.
    pub(crate) fn accepts_itself(&self) -> bool {
        self.accepts_itself.load(Ordering::Acquire)
    }

    /// Adds a follower to environments, which from now on keep logs of their episodes. No follower and no
    /// environment may be given twice.
    ///
    /// # Errors
    /// If they are too many; then nothing has changed.
    ///
    /// # Panics
    /// If there is no such environment.
    pub fn follow(&self, envs: &[usize], follower: FollowerId) -> Result<(), TooManyFollowed> {
        if let Some(&env) = envs.first() {
            self.logs.check(envs.len(), &lock(&self.envs[env]).battle.save())?;
        }
        envs.iter().for_each(|&env| lock(&self.envs[env]).follow(follower, &self.logs));
        // More logs share the same memory.
        self.envs.iter().for_each(|env| lock(env).trim_log());
        Ok(())
    }

    /// Removes a follower of an environment.
    ///
    /// # Panics
    /// As [`follow`](Lane::follow).
    pub fn unfollow(&self, env: usize, follower: FollowerId) {
        lock(&self.envs[env]).unfollow(follower);
    }

    /// What an environment did since the follower's last call, until `budget` bytes are used up; if that is 0
    /// afterwards, there may be more.
    ///
    /// # Panics
    /// As [`follow`](Lane::follow).
    pub fn read_log(&self, env: usize, follower: FollowerId, budget: &mut usize) -> Vec<EpisodePart> {
        lock(&self.envs[env]).read_log(follower, budget)
    }

    /// Its statistics.
    pub fn stats(&self) -> LaneStats {
        *lock(&self.stats)
    }

    /// Why it failed, if it did.
    pub fn failure(&self) -> Option<&str> {
        self.failure.get().map(String::as_str)
    }

    /// Answers a request with the reason why it was refused. May wait for a frame, so the caller holds no
    /// lock.
    fn reject(&self, request: &Request<'_>, rejection: &Rejection) {
        tracing::debug!(lane = self.name, %rejection, "request rejected");
        lock(&self.stats).rejected += 1;
        let text = json(rejection);
        let sent = self.with_frame(|frames| frames.report_rejection(request.session, request.number, &text));
        sent.unwrap_or_else(|error| self.fail(error.to_string()));
    }

    /// Retries `attempt` while no frame is free, for at most [`FRAME_TIMEOUT`]. The lane's memory suffices by
    /// calculation, but frames that a killed learner held come back only when the control thread recovers
    /// them, and for that it may need any lock of this lane. So the caller holds none.
    fn with_frame<R>(
        &self,
        mut attempt: impl FnMut(&mut Frames<T::Outlet>) -> Result<R, TransportError>,
    ) -> Result<R, TransportError> {
        let mut deadline = None; // the clock is read only when no frame is free
        loop {
            let outcome = attempt(&mut lock(&self.frames));
            if outcome.is_ok() {
                return outcome;
            }
            let now = Instant::now();
            if deadline.get_or_insert(Deadline::new(now, FRAME_TIMEOUT)).left(now).is_zero() {
                return outcome;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Carries out the orders of environments that were taken from [`work`](Lane::work). Returns whether a
    /// waiting reset can be accepted now.
    pub(crate) fn serve(&self, envs: Range<usize>, scratch: &mut Scratch) -> bool {
        if self.failure().is_some() {
            return false; // after a panic the environments may be in any state
        }
        let served = catch_unwind(AssertUnwindSafe(|| {
            if self.is_synchronous() {
                self.serve_chunk(envs, scratch)
            } else {
                self.serve_one(envs.start, scratch)
            }
        }));
        match served {
            Ok(Ok(is_last)) => return is_last && self.reset_waits.load(Ordering::SeqCst),
            Ok(Err(error)) => self.fail(error.to_string()),
            Err(panic) => self.fail(panic_text(panic.as_ref())),
        }
        false
    }

    /// A chunk of a synchronous request. Returns whether it was the last.
    fn serve_chunk(&self, envs: Range<usize>, scratch: &mut Scratch) -> Result<bool, TransportError> {
        let frame = self.job_frame.load();
        let mut counts = LaneStats::default();
        // All are locked before the first is written: to lock or unlock is to wait until every earlier write
        // has reached the cache, and those to a frame take long, since the learner has read it.
        let locked = envs.clone().map(|env| lock(&self.envs[env]));
        let mut locked: ArrayVec<_, CHUNK> = locked.collect();
        for (env, hosted) in envs.clone().zip(&mut locked) {
            let step = self.step(env, hosted, scratch, &mut counts);
            self.write(env, hosted, step, frame.map(|memory| (memory, env)), scratch);
        }
        drop(locked);
        lock(&self.stats).add(&counts);
        // Releases what this thread wrote to the one that publishes, and acquires that of the others.
        let is_last = self.outstanding.fetch_sub(envs.len(), Ordering::AcqRel) == envs.len() + 1;
        if is_last {
            self.finish_job();
        }
        Ok(is_last)
    }

    /// The environments are idle before the frame is sent, so that the learner's next request finds them so;
    /// and a request that is accepted in between can send nothing before this frame.
    fn finish_job(&self) {
        let mut frames = lock(&self.frames);
        self.outstanding.store(0, Ordering::SeqCst);
        if frames.complete_all() {
            lock(&self.stats).frames += 1;
        }
    }

    /// An environment of an asynchronous lane; results get slots in the order in which they are ready.
    /// Returns whether no other is outstanding.
    fn serve_one(&self, env: usize, scratch: &mut Scratch) -> Result<bool, TransportError> {
        let mut counts = LaneStats::default();
        let mut hosted = lock(&self.envs[env]);
        let step = self.step(env, &mut hosted, scratch, &mut counts);
        drop(hosted); // the claim may wait for a frame
        let claim = self.with_frame(|frames| frames.claim(1))?;
        let slot = claim.map(|claim| (claim.memory, claim.first));
        self.write(env, &mut lock(&self.envs[env]), step, slot, scratch);
        lock(&self.stats).add(&counts);
        self.table.set_busy(env, false);
        self.complete(claim);
        Ok(self.outstanding.fetch_sub(1, Ordering::SeqCst) == 1)
    }

    #[inline(always)]
    fn step(
        &self,
        env: usize,
        hosted: &mut HostedEnv,
        scratch: &mut Scratch,
        counts: &mut LaneStats,
    ) -> Option<Step> {
        let actions = JointAction::new(self.table.actions(env));
        let step = hosted.run(self.table.task(env), actions, self.autoreset, scratch)?;
        counts.count(&step, hosted.battle.episode_return());
        Some(step)
    }

    /// Writes an environment's results into its slot, or discards them if their session is over.
    fn write(
        &self,
        env: usize,
        hosted: &mut HostedEnv,
        step: Option<Step>,
        slot: Option<(FrameMemory, usize)>,
        scratch: &mut Scratch,
    ) {
        if let Some((memory, index)) = slot {
            // SAFETY: `Frames` keeps the frame's loan until every claimed slot is complete, which the caller
            // reports after this. Slots are distinct: the claims of an asynchronous lane do not overlap, and
            // in a synchronous lane `index` is the environment, which one thread took, once, from `work`.
            let mut slot = unsafe { memory.slot(&self.layout, index) };
            hosted.write(env, step, self.autoreset, &mut slot, scratch);
        } else {
            hosted.discard(self.autoreset);
        }
        self.table.report(env, hosted);
    }

    fn complete(&self, claim: Option<SlotClaim>) {
        if claim.is_some_and(|claim| lock(&self.frames).complete(claim)) {
            lock(&self.stats).frames += 1;
        }
    }

    /// Takes the lane out of service and reports why to its learner. Other lanes go on.
    pub(crate) fn fail(&self, text: String) {
        tracing::error!(lane = self.name, text, "lane failed");
        if self.failure.set(text.clone()).is_ok() {
            lock(&self.frames).report_end(&json(&Rejection::LaneFailed { text }));
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
