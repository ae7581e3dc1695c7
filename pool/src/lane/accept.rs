//! How a lane accepts a request: either all of it, with its environments busy and their actions copied, or
//! nothing. First everything is checked, in which nothing changes but memory that is not read yet; then it is
//! carried out.
//!
//! An environment has at most one order at a time: a request to one that has not carried out its last order
//! is refused. Only a reset of all environments may come at any time. It waits until earlier orders are
//! carried out (their results are dropped by the learner, since their epoch is over), and later requests wait
//! behind it.

use super::Lane;
use super::pairing::{Halves, Incoming, Joint, Paired};
use crate::autoreset::Autoreset;
use crate::env_ids::env_index;
use crate::hosted_env::Task;
use crate::rejection::Rejection;
use crate::sync::{MutexGuard, Ordering, lock};
use crate::transport::{
    Epoch, Inlet, MAX_AHEAD, Message, Received, Request, RequestKind, RequestNumber, SessionId, Transport,
};
use crate::work::Work;
use smaclite_engine::{Actor, Faction};
use std::hint::black_box;
use std::sync::atomic::{AtomicI32, Ordering::Relaxed};

/// The receiving side of a lane. The thread that accepts requests locks it, and the control thread to change
/// the session.
pub(super) struct Intake<I: Inlet> {
    inlet: I,
    /// A reset of all environments that waits.
    waiting: Option<Incoming<I::Message>>,
    halves: Halves<I::Message>,
    /// The side that a scripted policy plays, because its learner left.
    left: Option<Faction>,
    /// `None` while the lane has no learner.
    pub(super) epoch: Option<Epoch>,
    /// The session's last request.
    last_request: Option<RequestNumber>,
    /// The environments of the request that is being accepted, each once.
    pub(super) envs: Vec<u32>,
    /// By environment: whether it is one of them.
    named: Vec<bool>,
    /// The snapshot that is being read, as words. The learner could change its own while it is checked.
    pub(super) record: Vec<i32>,
}

impl<I: Inlet> Intake<I> {
    pub(super) fn new(inlet: I, num_envs: usize, snapshot_size: usize) -> Self {
        let (envs, named) = (Vec::with_capacity(num_envs), vec![false; num_envs]);
        let record = vec![0; snapshot_size / size_of::<i32>()];
        let halves = Halves::new();
        let (waiting, left, epoch, last_request) = (None, None, None, None);
        Intake { inlet, waiting, halves, left, epoch, last_request, envs, named, record }
    }

    /// The learner's session.
    pub(super) fn session(&self) -> Option<SessionId> {
        self.epoch.map(|epoch| epoch.session)
    }

    pub(super) fn begin_session(&mut self, session: Option<SessionId>) {
        self.waiting = None;
        self.halves.clear();
        self.left = None;
        self.last_request = None;
        self.epoch = session.map(|session| Epoch { session, reset: None });
    }

    /// From now on the learner of the other side sends whole requests; those of `side` are dropped.
    pub(super) fn set_left(&mut self, side: Faction) {
        self.halves.drop_side(side);
        self.left = Some(side);
    }

    /// Notes an environment of the request.
    fn name(&mut self, env: usize) -> Result<(), Rejection> {
        if std::mem::replace(&mut self.named[env], true) {
            return Err(Rejection::DuplicateEnv { env });
        }
        self.envs.push(env as u32);
        Ok(())
    }

    fn forget_envs(&mut self) {
        for env in self.envs.drain(..) {
            self.named[env as usize] = false;
        }
    }
}

/// What [`Lane::accept`] found.
pub(crate) enum Accepted {
    /// No request, or one that waits.
    Nothing,
    /// A request that the lane ignored or rejected.
    Refused,
    /// A request that the lane accepted: work for this many threads.
    Work(usize),
}

/// What a lane has to accept or to refuse.
enum Arrival<M> {
    Nothing,
    Malformed(Rejection),
    /// A request that cannot even wait.
    Refused(M, Rejection),
    Request(Incoming<M>),
}

impl<T: Transport> Lane<T> {
    /// Receives the next request and accepts or refuses it.
    pub(crate) fn accept(&self) -> Accepted {
        let mut intake = lock(&self.intake);
        let incoming = match self.next_arrival(&mut intake) {
            Arrival::Nothing => return Accepted::Nothing,
            Arrival::Malformed(rejection) => {
                // It names no sender to answer. Our own client sends well-formed requests.
                tracing::warn!(lane = self.name, %rejection, "request ignored");
                lock(&self.stats).rejected += 1;
                return Accepted::Refused;
            }
            Arrival::Refused(message, rejection) => {
                drop(intake);
                self.reject(&message.request(), &rejection);
                return Accepted::Refused;
            }
            Arrival::Request(incoming) => incoming,
        };
        let joint = incoming.request();
        let request = joint.first;
        if intake.session() != Some(request.session) {
            let session = request.session.0;
            tracing::debug!(lane = self.name, session, "request of another session ignored");
            lock(&self.stats).rejected += 1;
            return Accepted::Refused;
        }
        if self.must_wait(&request) {
            intake.waiting = Some(incoming);
            return Accepted::Nothing;
        }
        if let Err(rejection) = self.check(&mut intake, &joint) {
            intake.forget_envs();
            // The answer may wait for a frame, and the control thread must not wait for that.
            drop(intake);
            self.reject(&request, &rejection);
            return Accepted::Refused;
        }
        let mut stats = lock(&self.stats);
        stats.accepted += 1;
        stats.waited_ns += incoming.waited().as_nanos() as u64;
        drop(stats);
        Accepted::Work(self.publish(intake))
    }

    /// Publishes the environments of the accepted request. Returns for how many threads they are work.
    fn publish(&self, mut intake: MutexGuard<'_, Intake<T::Inlet>>) -> usize {
        match &self.work {
            Work::Synchronous(ranges) => {
                self.outstanding.store(self.num_envs + 1, Ordering::SeqCst);
                intake.forget_envs();
                drop(intake); // to open a frame may wait, too
                let claim = self.with_frame(|frames| frames.claim(self.num_envs)).unwrap_or_else(|error| {
                    self.fail(error.to_string());
                    None
                });
                self.job_frame.store(claim.map(|claim| claim.memory));
                ranges.publish()
            }
            Work::Asynchronous(queue) => {
                let count = intake.envs.len();
                self.outstanding.fetch_add(count, Ordering::SeqCst);
                for &env in &intake.envs {
                    self.table.set_busy(env as usize, true);
                    let queued = queue.push(env);
                    debug_assert!(queued.is_ok(), "an environment has one order at a time");
                }
                intake.forget_envs();
                count
            }
        }
    }

    fn next_arrival(&self, intake: &mut Intake<T::Inlet>) -> Arrival<<T::Inlet as Inlet>::Message> {
        if let Some(waiting) = intake.waiting.take() {
            return Arrival::Request(waiting);
        }
        if let Some(side) = intake.left
            && let Some(message) = intake.halves.take(side.opponent())
        {
            return Arrival::Request(Incoming::Whole(message));
        }
        loop {
            let message = match intake.inlet.receive() {
                Ok(Received::Nothing) => return Arrival::Nothing,
                Ok(Received::Malformed(rejection)) => return Arrival::Malformed(rejection),
                Ok(Received::Request(message)) => message,
                Err(error) => {
                    tracing::warn!(lane = self.name, %error, "requests cannot be received");
                    return Arrival::Nothing;
                }
            };
            let Request { session, side, .. } = message.request();
            let Some(side) = side.filter(|_| Some(session) == intake.session()) else {
                return Arrival::Request(Incoming::Whole(message));
            };
            if intake.left == Some(side) {
                continue; // sent before that learner left; now a script acts in its place
            }
            if intake.left.is_some() {
                return Arrival::Request(Incoming::Whole(message));
            }
            match intake.halves.pair(side, message) {
                Paired::Waits => {}
                Paired::Both(pair) => return Arrival::Request(pair),
                Paired::TooMany(message) => {
                    return Arrival::Refused(message, Rejection::TooFarAhead { side, waiting: MAX_AHEAD });
                }
            }
        }
    }

    /// Whether this is a reset of all environments and some are outstanding. The thread that carries out the
    /// last of them accepts it then: it ends them and then looks whether a reset waits; here it is the other
    /// way round.
    fn must_wait(&self, request: &Request<'_>) -> bool {
        if !matches!(request.kind, RequestKind::Reset { .. }) || self.failure().is_some() {
            return false;
        }
        let waits = request.env_ids.len() == self.num_envs && self.outstanding.load(Ordering::SeqCst) > 0;
        self.reset_waits.store(waits, Ordering::SeqCst);
        waits && self.outstanding.load(Ordering::SeqCst) > 0
    }

    /// Checks a request and writes the orders of its environments.
    fn check(&self, intake: &mut Intake<T::Inlet>, joint: &Joint<'_>) -> Result<(), Rejection> {
        let request = &joint.first;
        check_order(intake.last_request, request.number)?;
        intake.last_request = Some(request.number);
        if let Some(text) = self.failure() {
            return Err(Rejection::LaneFailed { text: text.to_owned() });
        }
        joint.check()?;
        match joint.kind() {
            RequestKind::Step => self.check_step(intake, joint),
            RequestKind::Reset { seed, levels } => self.check_reset(intake, request, seed, levels),
            RequestKind::Restore { seed } => self.check_restore(intake, request, seed),
            RequestKind::Fork { seed } => self.check_fork(intake, request, seed),
        }
    }

    fn check_step(&self, intake: &mut Intake<T::Inlet>, joint: &Joint<'_>) -> Result<(), Rejection> {
        let Request { env_ids, body: actions, .. } = joint.first;
        let sizes = self.layout.sizes();
        // The actions of the enemies come from their own learner, or are in the row of the agents'.
        let mut of_enemies = joint.enemies.map(|enemies| enemies.body.chunks_exact(sizes.n_enemies));
        let (first, row) = match joint.first.side {
            None => (0, sizes.n_actors()),
            Some(Faction::Ally) => (0, sizes.n_agents),
            Some(Faction::Enemy) => (sizes.n_agents, sizes.n_enemies),
        };
        if intake.epoch.is_none_or(|epoch| epoch.reset.is_none()) {
            return Err(Rejection::NotReset);
        }
        if self.is_synchronous() && env_ids.len() != self.num_envs {
            return Err(Rejection::IncompleteBatch { given: env_ids.len(), expected: self.num_envs });
        }
        prefetch(env_ids);
        prefetch(actions);
        for (id, actions) in env_ids.iter().zip(actions.chunks_exact(row)) {
            let actions =
                actions.iter().chain(of_enemies.as_mut().and_then(Iterator::next).unwrap_or_default());
            let env = self.check_env(intake, id.load(Relaxed))?;
            let is_over = self.table.is_over(env);
            if is_over && self.autoreset == Autoreset::Disabled {
                return Err(Rejection::FinishedEnv { env });
            }
            // Each action is read once: a learner could change its sample after the check.
            let own = self.table.actions(env).iter().zip(self.table.masks(env)).enumerate().skip(first);
            for ((place, (own, mask)), sent) in own.zip(actions) {
                let action = sent.load(Relaxed);
                if !is_over && !mask.has(action) {
                    let (available, actor) = (mask.actions(), Actor::at(place, sizes.n_agents));
                    let has_sides = joint.first.side.is_some();
                    return Err(Rejection::UnavailableAction { env, actor, action, available, has_sides });
                }
                own.store(action, Relaxed);
            }
            self.table.order(env, Task::Step);
        }
        Ok(())
    }

    fn check_reset(
        &self,
        intake: &mut Intake<T::Inlet>,
        request: &Request<'_>,
        seed: Option<u64>,
        levels: bool,
    ) -> Result<(), Rejection> {
        let Some(epoch) = intake.epoch else { return Err(Rejection::NotReset) };
        let is_full = request.env_ids.len() == self.num_envs;
        if epoch.reset.is_none() && !is_full {
            return Err(Rejection::NotReset);
        }
        for id in request.env_ids {
            self.check_env(intake, id.load(Relaxed))?;
        }
        if levels {
            self.check_levels(&intake.envs, request)?;
        }
        let task = if levels { Task::ResetTo } else { Task::Reset };
        // Every session begins with the lane's own seed, so that it does not depend on earlier learners.
        let seed = if epoch.reset.is_none() { seed.or(Some(self.seed)) } else { seed };
        for &env in &intake.envs {
            if let Some(seed) = seed {
                lock(&self.envs[env as usize]).battle.reseed(seed.wrapping_add(u64::from(env)));
            }
            self.table.order(env as usize, task);
        }
        if is_full {
            let epoch = Epoch { reset: Some(request.number), ..epoch };
            intake.epoch = Some(epoch);
            lock(&self.frames).begin_epoch(epoch);
        } else {
            self.observe_others(intake);
        }
        Ok(())
    }

    /// Reads every level into the memory of its environment, which begins with it when it is served.
    fn check_levels(&self, envs: &[u32], request: &Request<'_>) -> Result<(), Rejection> {
        let level_len = self.layout.level_len();
        if level_len == 0 {
            let what =
                "the lane has no field `level`, without which no episode begins with a level".to_owned();
            return Err(Rejection::Malformed { what });
        }
        for (&env, level) in envs.iter().zip(request.body.chunks_exact(level_len)) {
            // Each number is read once: a learner could change its sample after the check.
            let numbers = level.iter().map(|number| f32::from_bits(number.load(Relaxed) as u32));
            let staged = lock(&self.envs[env as usize]).stage_level(numbers);
            staged.map_err(|why| Rejection::BadLevel { env: env as usize, why })?;
        }
        Ok(())
    }

    /// A synchronous batch has every environment: those that the request does not name are observed again.
    pub(super) fn observe_others(&self, intake: &Intake<T::Inlet>) {
        if self.is_synchronous() {
            let others = (0..self.num_envs).filter(|env| !intake.named[*env]);
            others.for_each(|env| self.table.order(env, Task::Observe));
        }
    }

    /// Names the environment of this id, if the request may have it.
    pub(super) fn check_env(&self, intake: &mut Intake<T::Inlet>, id: i32) -> Result<usize, Rejection> {
        let env = self.idle_env(id)?;
        intake.name(env)?;
        Ok(env)
    }

    /// The environment of this id, if it has no order.
    pub(super) fn idle_env(&self, id: i32) -> Result<usize, Rejection> {
        let env = env_index(id, self.num_envs)?;
        let is_busy = match &self.work {
            Work::Synchronous(_) => self.outstanding.load(Ordering::SeqCst) > 0,
            Work::Asynchronous(_) => self.table.is_busy(env),
        };
        if is_busy { Err(Rejection::BusyEnv { env }) } else { Ok(env) }
    }
}

/// Reads one integer per cache line (the last line may be left out). The learner's core wrote these lines, so
/// each first read is a transfer between cores; reading them in a row lets the transfers overlap.
fn prefetch(integers: &[AtomicI32]) {
    const LINE: usize = 64 / size_of::<i32>();
    black_box(integers.iter().step_by(LINE).fold(0, |sum, x| sum ^ x.load(Relaxed)));
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
