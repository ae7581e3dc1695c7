//! The environments of a lane, as a plain value. `check` reads a request into orders: all of it, or nothing.
//! `step` and `write` carry out the order of an environment, and may be called by any thread that took it.
//! There are no threads, no transport and no learner here: these are the lane's.

mod branching;
mod check;
mod env_table;

pub(crate) use check::Draft;

use crate::autoreset::Autoreset;
use crate::episode_log::{EpisodeLog, EpisodePart, FollowerId, LogMemory, TooManyFollowed};
use crate::hosted_env::HostedEnv;
use crate::joint_action::JointAction;
use crate::lane_settings::{LaneSettings, LaneSpec};
use crate::lane_stats::LaneStats;
use crate::layout::Layout;
use crate::slot::FrameMemory;
use crate::sync::{AtomicUsize, Mutex, MutexGuard, Ordering, lock};
use crate::transport::Request;
use env_table::EnvTable;
use smaclite_engine::{Scratch, Step};
use std::sync::Arc;

/// Environments of one scenario.
pub(crate) struct EnvGroup {
    num_envs: usize,
    seed: u64,
    autoreset: Autoreset,
    layout: Layout,
    envs: Vec<Mutex<HostedEnv>>,
    table: EnvTable,
    /// Environments with an order that is not carried out. In a synchronous lane at work there is one more,
    /// for its frame: the thread that finds only that left publishes it.
    outstanding: AtomicUsize,
    logs: LogMemory,
}

impl EnvGroup {
    pub(crate) fn new(spec: &LaneSpec) -> EnvGroup {
        let LaneSettings { num_envs, seed, autoreset, .. } = spec.settings;
        let record = spec.settings.record_layout(spec.sizes()).map(Arc::new);
        EnvGroup {
            num_envs,
            seed,
            autoreset,
            layout: spec.layout(),
            envs: (0..num_envs).map(|i| Mutex::new(HostedEnv::new(i, spec, record.clone()))).collect(),
            table: EnvTable::new(num_envs, spec.sizes()),
            outstanding: AtomicUsize::new(0),
            logs: LogMemory::new(),
        }
    }

    /// A request is for all environments, and slot `i` of its only frame is environment `i`.
    pub(crate) fn is_synchronous(&self) -> bool {
        self.layout.slots() == self.num_envs
    }

    /// Whether a request that passes [`check`](EnvGroup::check) begins an epoch.
    pub(crate) fn begins_epoch<N>(&self, request: &Request<'_, N>, was_reset: bool) -> bool {
        let names_all = request.env_ids.len() == self.num_envs;
        request.kind.begins_epoch(names_all, self.is_synchronous(), was_reset)
    }

    /// Whether there are orders that are not carried out.
    pub(crate) fn is_at_work(&self) -> bool {
        self.outstanding.load(Ordering::SeqCst) > 0
    }

    /// All environments have orders from now on.
    pub(crate) fn begin_all(&self) {
        self.outstanding.store(self.num_envs + 1, Ordering::SeqCst);
    }

    /// The environments of an asynchronous lane that have orders from now on.
    pub(crate) fn begin(&self, envs: &[u32]) {
        self.outstanding.fetch_add(envs.len(), Ordering::SeqCst);
        envs.iter().for_each(|env| self.table.set_busy(*env as usize, true));
    }

    /// Some orders of a synchronous lane were carried out. Returns whether they were the last: the caller
    /// then publishes the frame, after [`end_all`](EnvGroup::end_all). Releases what this thread wrote to the
    /// one that gets `true`, and acquires that of the others.
    pub(crate) fn end_some(&self, count: usize) -> bool {
        self.outstanding.fetch_sub(count, Ordering::AcqRel) == count + 1
    }

    pub(crate) fn end_all(&self) {
        self.outstanding.store(0, Ordering::SeqCst);
    }

    /// The order of an environment of an asynchronous lane was carried out.
    pub(crate) fn end(&self, env: usize) {
        self.table.set_busy(env, false);
        self.outstanding.fetch_sub(1, Ordering::SeqCst);
    }

    /// An environment, for the thread that took it.
    pub(crate) fn lock(&self, env: usize) -> MutexGuard<'_, HostedEnv> {
        lock(&self.envs[env])
    }

    /// Carries out the order of an environment, up to the point where its slot is needed.
    #[inline(always)]
    pub(crate) fn step(
        &self,
        env: usize,
        hosted: &mut HostedEnv,
        scratch: &mut Scratch,
        counts: &mut LaneStats,
    ) -> Option<Step> {
        let actions = JointAction::new(self.table.actions(env));
        let step = hosted.run(self.table.task(env), actions, self.autoreset, scratch)?;
        counts.count(&step, hosted.battle.episode_return(), hosted.battle.episode_length());
        Some(step)
    }

    /// Writes an environment's results into its slot, or discards them if their session is over.
    pub(crate) fn write(
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

    /// See [`Lane::follow`](crate::Lane::follow).
    pub(crate) fn follow(&self, envs: &[usize], follower: FollowerId) -> Result<(), TooManyFollowed> {
        // Followers of an environment share its log.
        let more = envs.iter().filter(|env| self.lock(**env).log.is_none()).count();
        if let Some(&env) = envs.first() {
            self.logs.check(more, self.lock(env).battle.record().len())?;
        }
        for &env in envs {
            let HostedEnv { battle, log, .. } = &mut *self.lock(env);
            let n_actors = battle.arena().sizes().n_actors(); // of both sides, if a team plays one
            let begin = || Box::new(EpisodeLog::new(n_actors, battle.record(), self.logs.clone()));
            log.get_or_insert_with(begin).add_reader(follower);
        }
        // More logs share the same memory.
        for env in 0..self.num_envs {
            if let Some(log) = &mut self.lock(env).log {
                log.trim();
            }
        }
        Ok(())
    }

    /// The log ends with its last follower.
    pub(crate) fn unfollow(&self, env: usize, follower: FollowerId) {
        drop(self.lock(env).log.take_if(|log| log.remove_reader(follower)));
    }

    pub(crate) fn read_log(&self, env: usize, follower: FollowerId, budget: &mut usize) -> Vec<EpisodePart> {
        self.lock(env).log.as_mut().map_or(Vec::new(), |log| log.read(follower, budget))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::episode_log::MAX_LOG_BYTES;
    use smaclite_engine::{Arena, Battle, Rules};
    use smaclite_scenarios::Scenario;

    /// A second follower of the same environments was refused: it was counted as if it had logs of its own.
    #[test]
    fn followers_of_the_same_environments_share_their_logs() {
        let arena = Arc::new(Arena::new(&Scenario::resolve("bane_vs_bane").unwrap(), Rules::Smaclite));
        let state = Battle::new(Arc::clone(&arena), 0).record().len();
        let TooManyFollowed { limit } = LogMemory::new().check(usize::MAX / 2, state).unwrap_err();
        assert!(limit * state <= MAX_LOG_BYTES);
        let settings = LaneSettings::new(limit / 2 + 2);
        let group = EnvGroup::new(&LaneSpec { name: String::new(), settings, arena, team: None, hook: None });
        let envs: Vec<usize> = (0..settings.num_envs).collect();
        assert_eq!([1, 2].map(|follower| group.follow(&envs, FollowerId(follower))), [Ok(()); 2]);
    }

    #[test]
    fn an_environment_keeps_its_log_as_long_as_it_has_followers() {
        let arena = Arc::new(Arena::new(&Scenario::resolve("3m").unwrap(), Rules::Smaclite));
        let settings = LaneSettings::new(2);
        let group = EnvGroup::new(&LaneSpec { name: String::new(), settings, arena, team: None, hook: None });
        let [first, second] = [1, 2].map(FollowerId);
        [first, second].iter().for_each(|follower| group.follow(&[1], *follower).unwrap());
        let n_read = |follower| group.read_log(1, follower, &mut usize::MAX.clone()).len();
        group.unfollow(1, first);
        assert_eq!((n_read(first), n_read(second)), (0, 1));
        group.unfollow(1, second);
        assert!([0, 1].iter().all(|env| group.lock(*env).log.is_none()));
    }
}
