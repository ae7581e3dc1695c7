//! How requests that branch battles are checked: the states come into the memory of their environments, where
//! they wait until these are served.

use super::{Draft, EnvGroup};
use crate::hosted_env::Task;
use crate::rejection::Rejection;
use crate::transport::Number;

impl EnvGroup {
    /// Reads every snapshot into the memory of its environment, which takes that state when it is served.
    pub(super) fn stage_snapshots<N: Number>(
        &self,
        draft: &mut Draft,
        records: &[N],
    ) -> Result<(), Rejection> {
        if draft.record.is_empty() {
            let what = "the lane has no field `snapshot`, without which nothing can be restored".to_owned();
            return Err(Rejection::Malformed { what });
        }
        let records = records.chunks_exact(draft.record.len());
        for (&env, record) in draft.envs.iter().zip(records) {
            draft.record.iter_mut().zip(record).for_each(|(own, sent)| *own = sent.read());
            let staged = self.lock(env as usize).stage(bytemuck::cast_slice(&draft.record), self.autoreset);
            staged.map_err(|why| Rejection::BadSnapshot { env: env as usize, why })?;
        }
        Ok(())
    }

    /// Saves every state that is forked before any environment changes.
    pub(super) fn stage_others<N: Number>(&self, draft: &Draft, from: &[N]) -> Result<(), Rejection> {
        for (&env, from) in draft.envs.iter().zip(from) {
            let (env, from) = (env as usize, self.idle_env(from)?);
            let mut state = self.lock(env).exchange_staged(None).unwrap_or_default();
            self.lock(from).save_into(&mut state);
            self.lock(env).exchange_staged(Some(state));
        }
        Ok(())
    }

    pub(super) fn order_restore(&self, draft: &Draft) {
        draft.seeded().for_each(|(env, seed)| self.lock(env).reseed_staged(seed));
        draft.envs.iter().for_each(|env| self.table.order(*env as usize, Task::Restore));
    }
}
