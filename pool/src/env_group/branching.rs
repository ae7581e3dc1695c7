//! How requests that branch battles are checked: the states come into the memory of their environments, where
//! they wait until these are served.

use super::{Draft, EnvGroup};
use crate::hosted_env::Task;
use crate::rejection::Rejection;
use crate::transport::Number;

impl EnvGroup {
    /// Reads every snapshot into the memory of its environment, which takes that state when it is served.
    pub(super) fn check_restore<N: Number>(
        &self,
        draft: &mut Draft,
        records: &[N],
        seed: Option<u64>,
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
        self.order_restore(draft, seed);
        Ok(())
    }

    /// Saves every state that is forked before any environment changes.
    pub(super) fn check_fork<N: Number>(
        &self,
        draft: &Draft,
        from: &[N],
        seed: Option<u64>,
    ) -> Result<(), Rejection> {
        for (&env, from) in draft.envs.iter().zip(from) {
            let (env, from) = (env as usize, self.idle_env(from)?);
            let mut state = self.lock(env).exchange_staged(None).unwrap_or_default();
            self.lock(from).save_into(&mut state);
            self.lock(env).exchange_staged(Some(state));
        }
        self.order_restore(draft, seed);
        Ok(())
    }

    fn order_restore(&self, draft: &Draft, seed: Option<u64>) {
        for &env in &draft.envs {
            if let Some(seed) = seed {
                self.lock(env as usize).reseed_staged(seed.wrapping_add(u64::from(env)));
            }
            self.table.order(env as usize, Task::Restore);
        }
        self.observe_others(draft);
    }
}
