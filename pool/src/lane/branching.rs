//! How a lane accepts requests that branch battles: the states come into the memory of their environments,
//! where they wait until these are served.

use super::Lane;
use super::accept::Intake;
use crate::hosted_env::Task;
use crate::rejection::Rejection;
use crate::sync::lock;
use crate::transport::{Request, Transport};
use std::sync::atomic::Ordering::Relaxed;

impl<T: Transport> Lane<T> {
    /// Reads every snapshot into the memory of its environment, which takes that state when it is served.
    pub(super) fn check_restore(
        &self,
        intake: &mut Intake<T::Inlet>,
        request: &Request<'_>,
        seed: Option<u64>,
    ) -> Result<(), Rejection> {
        self.check_branching(intake, request)?;
        if intake.record.is_empty() {
            let what = "the lane has no field `snapshot`, without which nothing can be restored".to_owned();
            return Err(Rejection::Malformed { what });
        }
        let records = request.body.chunks_exact(intake.record.len());
        for (&env, record) in intake.envs.iter().zip(records) {
            intake.record.iter_mut().zip(record).for_each(|(own, sent)| *own = sent.load(Relaxed));
            let mut hosted = lock(&self.envs[env as usize]);
            let staged = hosted.stage(bytemuck::cast_slice(&intake.record), self.autoreset);
            staged.map_err(|why| Rejection::BadSnapshot { env: env as usize, why })?;
        }
        self.order_restore(intake, seed);
        Ok(())
    }

    /// Saves every state that is forked before any environment changes.
    pub(super) fn check_fork(
        &self,
        intake: &mut Intake<T::Inlet>,
        request: &Request<'_>,
        seed: Option<u64>,
    ) -> Result<(), Rejection> {
        self.check_branching(intake, request)?;
        for (&env, from) in intake.envs.iter().zip(request.body) {
            let from = self.idle_env(from.load(Relaxed))?;
            let env = env as usize;
            let mut state = lock(&self.envs[env]).exchange_staged(None).unwrap_or_default();
            lock(&self.envs[from]).save_into(&mut state);
            lock(&self.envs[env]).exchange_staged(Some(state));
        }
        self.order_restore(intake, seed);
        Ok(())
    }

    fn check_branching(&self, intake: &mut Intake<T::Inlet>, request: &Request<'_>) -> Result<(), Rejection> {
        if intake.epoch.is_none_or(|epoch| epoch.reset.is_none()) {
            return Err(Rejection::NotReset);
        }
        request.env_ids.iter().try_for_each(|id| self.check_env(intake, id.load(Relaxed)).map(drop))
    }

    fn order_restore(&self, intake: &Intake<T::Inlet>, seed: Option<u64>) {
        for &env in &intake.envs {
            if let Some(seed) = seed {
                lock(&self.envs[env as usize]).reseed_staged(seed.wrapping_add(u64::from(env)));
            }
            self.table.order(env as usize, Task::Restore);
        }
        self.observe_others(intake);
    }
}
