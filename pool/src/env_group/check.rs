//! How a request is checked: everything is read once and becomes an order, or nothing does. What is written
//! meanwhile is not read before the orders are published.
//!
//! An environment has at most one order at a time: a request to one that has not carried out its last order
//! is refused.

use super::EnvGroup;
use crate::autoreset::Autoreset;
use crate::env_ids::env_index;
use crate::hosted_env::Task;
use crate::rejection::Rejection;
use crate::transport::{Number, Request, RequestKind, SEED_WORDS, Seeds, read_seed};
use smaclite_engine::Actor;
use std::hint::black_box;
use std::sync::atomic::Ordering::Relaxed;

/// The request that is being checked. Its memory is kept.
pub(crate) struct Draft {
    /// Its environments, each once.
    pub(crate) envs: Vec<u32>,
    /// By environment: whether it is one of them.
    named: Vec<bool>,
    /// Of each, if they are seeded.
    seeds: Vec<Option<u64>>,
    /// The snapshot that is being read, as words. The learner could change its own while it is checked.
    pub(super) record: Vec<i32>,
}

impl Draft {
    pub(crate) fn new(group: &EnvGroup) -> Draft {
        let record = vec![0; group.layout.snapshot_size() / size_of::<i32>()];
        let (envs, named) = (Vec::with_capacity(group.num_envs), vec![false; group.num_envs]);
        Draft { envs, named, seeds: Vec::new(), record }
    }

    fn clear(&mut self) {
        for env in self.envs.drain(..) {
            self.named[env as usize] = false;
        }
        self.seeds.clear();
    }

    /// Reads the seeds of its environments, and returns the rest of the body.
    fn take_seeds<'a, N: Number>(&mut self, seeds: Seeds<()>, body: &'a [N]) -> &'a [N] {
        match seeds {
            Seeds::Continue => body,
            Seeds::From(seed) => {
                self.seeds.extend(self.envs.iter().map(|env| Some(seed.wrapping_add(u64::from(*env)))));
                body
            }
            Seeds::Each(()) => {
                let (seeds, body) = body.split_at(self.envs.len() * SEED_WORDS);
                self.seeds.extend(seeds.as_chunks().0.iter().map(read_seed));
                body
            }
        }
    }

    /// The environments that are seeded, with their seeds.
    pub(super) fn seeded(&self) -> impl Iterator<Item = (usize, u64)> {
        self.envs.iter().zip(&self.seeds).filter_map(|(env, seed)| seed.map(|seed| (*env as usize, seed)))
    }

    fn name(&mut self, env: usize) -> Result<(), Rejection> {
        if std::mem::replace(&mut self.named[env], true) {
            return Err(Rejection::DuplicateEnv { env });
        }
        self.envs.push(env as u32);
        Ok(())
    }
}

impl EnvGroup {
    /// Checks a request of a session in which the environments were reset, or not yet, and writes the orders
    /// of the environments that `draft` names afterwards.
    pub(crate) fn check<N: Number>(
        &self,
        draft: &mut Draft,
        request: &Request<'_, N>,
        was_reset: bool,
    ) -> Result<(), Rejection> {
        draft.clear();
        if !was_reset && !self.begins_epoch(request, was_reset) {
            return Err(Rejection::NotReset);
        }
        let Request { kind, env_ids, body, .. } = *request;
        if kind == RequestKind::Step {
            return self.check_step(draft, env_ids, body);
        }
        env_ids.iter().try_for_each(|id| self.check_env(draft, id).map(drop))?;
        let body = draft.take_seeds(kind.seeds(), body);
        match kind {
            RequestKind::Restore { .. } => self.stage_snapshots(draft, body)?,
            RequestKind::Fork { .. } => self.stage_others(draft, body)?,
            RequestKind::Reset { levels: true, .. } => self.stage_levels(&draft.envs, body)?,
            RequestKind::Reset { .. } | RequestKind::Step => {}
        }
        if !was_reset {
            self.begin_session();
        }
        match kind {
            RequestKind::Reset { levels, .. } => self.order_reset(draft, levels),
            _ => self.order_restore(draft),
        }
        if self.is_synchronous() {
            // A batch has every environment: those that the request does not name are observed again.
            let task = if was_reset { Task::Observe } else { Task::Reset };
            let others = (0..self.num_envs).filter(|env| !draft.named[*env]);
            others.for_each(|env| self.table.order(env, task));
        }
        Ok(())
    }

    /// A session begins with the lane's own seed and with battles as new, so that it does not depend on
    /// earlier ones.
    fn begin_session(&self) {
        for env in 0..self.num_envs {
            let mut hosted = self.lock(env);
            hosted.battle.reseed(self.seed.wrapping_add(env as u64));
            hosted.battle.forget_episodes();
        }
    }

    fn check_step<N: Number>(
        &self,
        draft: &mut Draft,
        env_ids: &[N],
        actions: &[N],
    ) -> Result<(), Rejection> {
        let sizes = self.layout.sizes();
        if self.is_synchronous() && env_ids.len() != self.num_envs {
            return Err(Rejection::IncompleteBatch { given: env_ids.len(), expected: self.num_envs });
        }
        prefetch(env_ids);
        prefetch(actions);
        for (id, actions) in env_ids.iter().zip(actions.chunks_exact(sizes.n_actors())) {
            let env = self.check_env(draft, id)?;
            let is_over = self.table.is_over(env);
            if is_over && self.autoreset == Autoreset::Disabled {
                return Err(Rejection::FinishedEnv { env });
            }
            let own = self.table.actions(env).iter().zip(self.table.masks(env));
            for (place, ((own, mask), sent)) in own.zip(actions).enumerate() {
                let action = sent.read();
                if !is_over && !mask.has(action) {
                    let (available, actor) = (mask.actions(), Actor::at(place, sizes.n_agents));
                    return Err(Rejection::UnavailableAction { env, actor, action, available });
                }
                own.store(action, Relaxed);
            }
            self.table.order(env, Task::Step);
        }
        Ok(())
    }

    fn order_reset(&self, draft: &Draft, levels: bool) {
        draft.seeded().for_each(|(env, seed)| self.lock(env).battle.reseed(seed));
        let task = if levels { Task::ResetTo } else { Task::Reset };
        draft.envs.iter().for_each(|env| self.table.order(*env as usize, task));
    }

    /// Reads every level into the memory of its environment, which begins with it when it is served.
    fn stage_levels<N: Number>(&self, envs: &[u32], levels: &[N]) -> Result<(), Rejection> {
        let level_len = self.layout.level_len();
        if level_len == 0 {
            let what =
                "the lane has no field `level`, without which no episode begins with a level".to_owned();
            return Err(Rejection::Malformed { what });
        }
        for (&env, level) in envs.iter().zip(levels.chunks_exact(level_len)) {
            let numbers = level.iter().map(|number| f32::from_bits(number.read() as u32));
            let staged = self.lock(env as usize).stage_level(numbers);
            staged.map_err(|why| Rejection::BadLevel { env: env as usize, why })?;
        }
        Ok(())
    }

    /// Names the environment of this id, if the request may have it.
    pub(super) fn check_env<N: Number>(&self, draft: &mut Draft, id: &N) -> Result<usize, Rejection> {
        let env = self.idle_env(id)?;
        draft.name(env)?;
        Ok(env)
    }

    /// The environment of this id, if it has no order.
    pub(super) fn idle_env<N: Number>(&self, id: &N) -> Result<usize, Rejection> {
        let env = env_index(id.read(), self.num_envs)?;
        let is_busy = if self.is_synchronous() { self.is_at_work() } else { self.table.is_busy(env) };
        if is_busy { Err(Rejection::BusyEnv { env }) } else { Ok(env) }
    }
}

/// Reads one integer per cache line (the last line may be left out). The learner's core wrote these lines, so
/// each first read is a transfer between cores; reading them in a row lets the transfers overlap.
fn prefetch<N: Number>(integers: &[N]) {
    const LINE: usize = 64 / size_of::<i32>();
    black_box(integers.iter().step_by(LINE).fold(0, |sum, x| sum ^ x.read()));
}
