//! A lane: a group of environments with one learner, whose requests it receives and whose frames it fills.
//! One thread at a time accepts requests; any thread takes chunks of environments, carries out their orders
//! and writes their slots of a frame. `scheduler` decides which thread does what.

use crate::env_group::{Draft, EnvGroup};
use crate::episode_log::{EpisodePart, FollowerId, TooManyFollowed};
use crate::frames::{Frames, SlotClaim};
use crate::lane_settings::LaneSpec;
use crate::lane_stats::LaneStats;
use crate::rejection::Rejection;
use crate::slot::SharedFrame;
use crate::sync::{AtomicBool, Mutex, Ordering, lock, yield_now};
use crate::transport::{
    Epoch, Inlet, Message, Number, Received, Request, RequestNumber, SessionId, Transport, TransportError,
};
use crate::wait_strategy::Deadline;
use crate::work::{CHUNK, Work};
use arrayvec::ArrayVec;
use smaclite_engine::Scratch;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// Bytes of the longest text that says why a lane failed.
const MOST_TEXT: usize = 1000;

/// How long a thread waits for a free frame. The control thread recovers a dead process's frames within 100
/// ms.
const FRAME_TIMEOUT: Duration = Duration::from_secs(2);

/// Environments of one scenario with one learner.
pub struct Lane<T: Transport> {
    name: String,
    group: EnvGroup,
    intake: Mutex<Intake<T::Inlet>>,
    frames: Mutex<Frames<T::Outlet>>,
    /// What no thread has taken yet.
    work: Work,
    /// The frame of the synchronous request that is carried out.
    job_frame: SharedFrame,
    /// The learner is a thread of this process, which orders by itself and sends nothing.
    is_local: AtomicBool,
    failure: OnceLock<String>,
    stats: Mutex<LaneStats>,
}

/// The receiving side of a lane. The thread that accepts requests locks it, and the control thread to change
/// the session.
struct Intake<I: Inlet> {
    inlet: I,
    /// A request that begins an epoch, and waits until no order is outstanding.
    waiting: Option<I::Message>,
    /// `None` while the lane has no learner.
    epoch: Option<Epoch>,
    /// The session's last request.
    last_request: RequestNumber,
    draft: Draft,
}

impl<I: Inlet> Intake<I> {
    fn session(&self) -> Option<SessionId> {
        self.epoch.map(|epoch| epoch.session)
    }

    /// Whether the session has had a reset.
    fn was_reset(&self) -> bool {
        self.epoch.is_some_and(|epoch| epoch.reset.is_some())
    }

    fn begin_session(&mut self, session: Option<SessionId>) {
        self.waiting = None;
        self.last_request = RequestNumber(0);
        self.epoch = session.map(|session| Epoch { session, reset: None });
    }

    /// An epoch is named by the request that began it, so numbers must not repeat within a session.
    fn count(&mut self, number: RequestNumber) -> Result<(), Rejection> {
        let last = self.last_request;
        if number <= last {
            let what = format!("request numbers must increase, got {} after {}", number.0, last.0);
            return Err(Rejection::Malformed { what });
        }
        self.last_request = number;
        Ok(())
    }
}

impl<T: Transport> Lane<T> {
    /// Builds the environments and reserves the lane's first frame.
    pub(crate) fn new(
        spec: &LaneSpec,
        inlet: T::Inlet,
        outlet: T::Outlet,
        threads: usize,
    ) -> Result<Self, TransportError> {
        let group = EnvGroup::new(spec);
        let (epoch, last_request, draft) = (None, RequestNumber(0), Draft::new(&group));
        Ok(Lane {
            name: spec.name.clone(),
            intake: Mutex::new(Intake { inlet, waiting: None, epoch, last_request, draft }),
            frames: Mutex::new(Frames::new(outlet, spec.settings.batch_size)?),
            work: Work::new(spec.settings.num_envs, group.is_synchronous(), threads),
            job_frame: SharedFrame::none(&spec.layout()),
            group,
            is_local: AtomicBool::new(false),
            failure: OnceLock::new(),
            stats: Mutex::default(),
        })
    }

    /// What no thread has taken yet.
    pub(crate) fn work(&self) -> &Work {
        &self.work
    }

    /// Serves `session` from now on, beginning with a reset; `None` is no learner. Nothing of an earlier
    /// session reaches it. Its work is still carried out, so that later episodes do not depend on how far the
    /// threads had come, but its results get no slots.
    pub fn set_session(&self, session: Option<SessionId>) {
        let mut intake = lock(&self.intake);
        intake.begin_session(session);
        self.is_local.store(false, Ordering::Release);
        lock(&self.frames).begin_session(session);
    }

    /// Whether the learner of `session` is a thread of this process, which orders by itself. Changes nothing
    /// and returns `false` if that is not the lane's session.
    pub(crate) fn set_local(&self, session: SessionId, is_local: bool) -> bool {
        let intake = lock(&self.intake);
        let is_current = intake.session() == Some(session);
        if is_current {
            self.is_local.store(is_local, Ordering::Release);
        }
        is_current
    }

    /// Whether the learner is a thread of this process, which orders by itself.
    pub(crate) fn is_local(&self) -> bool {
        self.is_local.load(Ordering::Acquire)
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
        self.group.follow(envs, follower)
    }

    /// Removes a follower of an environment.
    ///
    /// # Panics
    /// As [`follow`](Lane::follow).
    pub fn unfollow(&self, env: usize, follower: FollowerId) {
        self.group.unfollow(env, follower);
    }

    /// What an environment did since the follower's last call, until `budget` bytes are used up; if that is 0
    /// afterwards, there may be more.
    ///
    /// # Panics
    /// As [`follow`](Lane::follow).
    pub fn read_log(&self, env: usize, follower: FollowerId, budget: &mut usize) -> Vec<EpisodePart> {
        self.group.read_log(env, follower, budget)
    }

    /// Its statistics.
    pub fn stats(&self) -> LaneStats {
        *lock(&self.stats)
    }

    /// Why it failed, if it did.
    pub fn failure(&self) -> Option<&str> {
        self.failure.get().map(String::as_str)
    }

    /// Receives the next request and accepts or refuses it. Returns for how many threads its environments are
    /// work; `None` if there was no request.
    pub(crate) fn receive(&self) -> Option<usize> {
        let mut intake = lock(&self.intake);
        let waiting = intake.waiting.take().map(|message| Ok(Received::Request(message)));
        let message = match waiting.unwrap_or_else(|| intake.inlet.receive()) {
            Ok(Received::Nothing) => return None,
            Ok(Received::Request(message)) => message,
            Ok(Received::Malformed(rejection)) => {
                // It names no sender to answer. Our own client sends well-formed requests.
                tracing::warn!(lane = self.name, %rejection, "request ignored");
                lock(&self.stats).rejected += 1;
                return Some(0);
            }
            Err(error) => {
                tracing::warn!(lane = self.name, %error, "requests cannot be received");
                return None;
            }
        };
        let is_current = intake.session() == Some(message.request().session);
        if is_current && self.is_too_early(&intake, &message.request()) {
            intake.waiting = Some(message);
            drop(intake);
            yield_now(); // to the threads that have the orders
            return Some(0);
        }
        drop(intake);
        let request = message.request();
        let ordered = self.order(&request, message.waited());
        Some(ordered.unwrap_or_else(|rejection| {
            self.reject(&request, &rejection);
            0
        }))
    }

    /// Whether this begins an epoch and some environments have orders. These are carried out before, so that
    /// what follows does not depend on how far the threads had come.
    pub(crate) fn must_wait<N>(&self, request: &Request<'_, N>) -> bool {
        self.group.is_at_work() && self.is_too_early(&lock(&self.intake), request)
    }

    fn is_too_early<N>(&self, intake: &Intake<T::Inlet>, request: &Request<'_, N>) -> bool {
        self.group.is_at_work()
            && self.failure().is_none()
            && self.group.begins_epoch(request, intake.was_reset())
    }

    /// Accepts all of a request or nothing. Returns for how many threads its environments are work; 0 if the
    /// request is not of the present session, or still [must wait](Lane::must_wait), because the pool ends.
    /// It was sent so long ago.
    ///
    /// # Errors
    /// Why it is refused.
    pub(crate) fn order<N: Number>(
        &self,
        request: &Request<'_, N>,
        waited: Duration,
    ) -> Result<usize, Rejection> {
        let ordered = self.try_order(request, waited);
        if let Err(rejection) = &ordered {
            tracing::debug!(lane = self.name, %rejection, "request rejected");
            lock(&self.stats).rejected += 1;
        }
        ordered
    }

    fn try_order<N: Number>(&self, request: &Request<'_, N>, waited: Duration) -> Result<usize, Rejection> {
        let mut intake = lock(&self.intake);
        let Some(epoch) = intake.epoch.filter(|epoch| epoch.session == request.session) else {
            let session = request.session.0;
            tracing::debug!(lane = self.name, session, "request of another session ignored");
            lock(&self.stats).rejected += 1;
            return Ok(0);
        };
        intake.count(request.number)?;
        if let Some(text) = self.failure() {
            return Err(Rejection::LaneFailed { text: text.to_owned() });
        }
        if self.is_too_early(&intake, request) {
            return Ok(0); // its frames are being written
        }
        let was_reset = intake.was_reset();
        let checked = self.group.check(&mut intake.draft, request, was_reset);
        // One that is refused ends the results of earlier requests all the same: its learner expects none.
        if self.group.begins_epoch(request, was_reset) && (checked.is_ok() || was_reset) {
            let epoch = Epoch { reset: Some(request.number), ..epoch };
            intake.epoch = Some(epoch);
            lock(&self.frames).begin_epoch(epoch);
        }
        checked?;
        let mut stats = lock(&self.stats);
        stats.accepted += 1;
        stats.waited_ns += waited.as_nanos() as u64;
        drop(stats);
        if !self.group.is_synchronous() {
            self.group.begin(&intake.draft.envs);
            self.work.add(&intake.draft.envs);
            return Ok(intake.draft.envs.len());
        }
        self.group.begin_all();
        drop(intake); // to open a frame may wait
        let claim = self.with_frame(|frames| frames.claim()).unwrap_or_else(|error| {
            self.fail(error.to_string());
            None
        });
        self.job_frame.store(claim.map(|claim| claim.memory));
        Ok(self.work.publish())
    }

    /// Answers a request with the reason why it was refused. May wait for a frame, so the caller holds no
    /// lock.
    fn reject(&self, request: &Request<'_>, rejection: &Rejection) {
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

    /// Carries out the orders of environments that were taken from [`work`](Lane::work).
    pub(crate) fn serve(&self, envs: Range<usize>, scratch: &mut Scratch) {
        if self.failure().is_some() {
            return; // after a panic the environments may be in any state
        }
        let served = catch_unwind(AssertUnwindSafe(|| {
            if self.group.is_synchronous() {
                self.serve_chunk(envs, scratch);
                Ok(())
            } else {
                self.serve_one(envs.start, scratch)
            }
        }));
        match served {
            Ok(Ok(())) => {}
            Ok(Err(error)) => self.fail(error.to_string()),
            Err(panic) => self.fail(panic_text(panic.as_ref())),
        }
    }

    /// A chunk of a synchronous request. The thread that carries out the last one publishes the frame.
    fn serve_chunk(&self, envs: Range<usize>, scratch: &mut Scratch) {
        let frame = self.job_frame.load();
        let mut counts = LaneStats::default();
        // All are locked before the first is written: to lock or unlock is to wait until every earlier write
        // has reached the cache, and those to a frame take long, since the learner has read it.
        let mut locked: ArrayVec<_, CHUNK> = envs.clone().map(|env| self.group.lock(env)).collect();
        for (env, hosted) in envs.clone().zip(&mut locked) {
            let step = self.group.step(env, hosted, scratch, &mut counts);
            self.group.write(env, hosted, step, frame.map(|memory| (memory, env)), scratch);
        }
        drop(locked);
        lock(&self.stats).add(&counts);
        if self.group.end_some(envs.len()) {
            let mut frames = lock(&self.frames);
            // The environments are idle before the frame is sent, so that the learner's next request finds
            // them so; and a request that is accepted in between can send nothing before this frame.
            self.group.end_all();
            if frames.complete_all(self.is_local()) {
                lock(&self.stats).frames += 1;
            }
        }
    }

    /// An environment of an asynchronous lane; results get slots in the order in which they are ready.
    fn serve_one(&self, env: usize, scratch: &mut Scratch) -> Result<(), TransportError> {
        let mut counts = LaneStats::default();
        let mut hosted = self.group.lock(env);
        let step = self.group.step(env, &mut hosted, scratch, &mut counts);
        drop(hosted); // the claim may wait for a frame
        let claim = self.with_frame(|frames| frames.claim())?;
        let slot = claim.map(|claim| (claim.memory, claim.slot));
        self.group.write(env, &mut self.group.lock(env), step, slot, scratch);
        lock(&self.stats).add(&counts);
        self.complete(env, claim);
        Ok(())
    }

    /// The environment is idle before its frame is sent, as in a synchronous lane.
    fn complete(&self, env: usize, claim: Option<SlotClaim>) {
        let mut frames = lock(&self.frames);
        self.group.end(env);
        if claim.is_some_and(|claim| frames.complete(claim)) {
            lock(&self.stats).frames += 1;
        }
    }

    /// Takes the lane out of service and reports why to its learner. Other lanes go on.
    pub(crate) fn fail(&self, mut text: String) {
        // Learners are told in a frame, which has room for this in any lane.
        let end = (0..=MOST_TEXT).rev().find(|end| text.is_char_boundary(*end)).unwrap_or(0);
        text.truncate(end.min(text.len()));
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
