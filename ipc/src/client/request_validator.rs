//! What a learner may send next: which environments work on an earlier request, and which actions are
//! available in the others. A request that the supervisor would refuse is refused here, with the same error,
//! before it is sent.

use smaclite_pool::env_ids::{check_distinct, env_index};
use smaclite_pool::fields::Field;
use smaclite_pool::layout::Layout;
use smaclite_pool::transport::RequestNumber;
use smaclite_pool::{Autoreset, LaneSettings, Rejection};

/// What the client knows of a lane's environments.
pub(super) struct RequestValidator {
    n_agents: usize,
    n_actions: usize,
    autoreset: Autoreset,
    synchronous: bool,
    /// `[num_envs, n_agents, n_actions]`: the masks last received of each environment. Copies, because a
    /// learner may drop a batch before it sends the next actions. All 1 where the lane leaves the masks out:
    /// the supervisor checks in any case.
    masks: Vec<u8>,
    envs: Vec<EnvState>,
    /// Results still to come.
    outstanding: usize,
    was_reset: bool,
}

#[derive(Clone, Copy, Default)]
struct EnvState {
    /// The number of the request that it works on.
    busy: Option<RequestNumber>,
    /// Its episode ended and it was not reset since.
    over: bool,
}

impl RequestValidator {
    pub(super) fn new(layout: &Layout, settings: &LaneSettings) -> RequestValidator {
        let (sizes, num_envs) = (layout.sizes(), settings.num_envs);
        RequestValidator {
            n_agents: sizes.n_agents,
            n_actions: sizes.n_actions,
            autoreset: settings.autoreset,
            synchronous: settings.is_synchronous(),
            masks: vec![1; num_envs * sizes.n_agents * sizes.n_actions],
            envs: vec![EnvState::default(); num_envs],
            outstanding: 0,
            was_reset: false,
        }
    }

    pub(super) fn n_agents(&self) -> usize {
        self.n_agents
    }

    pub(super) fn outstanding(&self) -> usize {
        self.outstanding
    }

    pub(super) fn check_was_reset(&self) -> Result<(), Rejection> {
        if self.was_reset { Ok(()) } else { Err(Rejection::NotReset) }
    }

    pub(super) fn env_index(&self, id: i32) -> Result<usize, Rejection> {
        env_index(id, self.envs.len())
    }

    /// `[n_actions]`: the actions available to an agent; other than 0 if available.
    pub(super) fn mask(&self, env: usize, agent: usize) -> &[u8] {
        let start = (env * self.n_agents + agent) * self.n_actions;
        &self.masks[start..start + self.n_actions]
    }

    /// Checks a step of the environments of `env_ids` (all, if `None`) and marks them busy with request
    /// `number`.
    pub(super) fn reserve_step(
        &mut self,
        number: RequestNumber,
        actions: &[i32],
        env_ids: Option<&[i32]>,
    ) -> Result<(), Rejection> {
        self.check_was_reset()?;
        let (given, expected) = (env_ids.map_or(self.envs.len(), <[i32]>::len), self.envs.len());
        check_not_empty(given)?;
        if self.synchronous && given != expected {
            return Err(Rejection::IncompleteBatch { given, expected });
        }
        let mut rows = actions.chunks_exact(self.n_agents).enumerate();
        let checked = rows.try_for_each(|(i, row)| {
            let env = env_ids.map_or(Ok(i), |ids| self.env_index(ids[i]))?;
            self.reserve_env(number, env)?;
            self.check_actions(env, row)
        });
        match checked {
            Ok(()) => self.outstanding += given,
            Err(_) => drop(self.clear(number)),
        }
        checked
    }

    fn check_actions(&self, env: usize, actions: &[i32]) -> Result<(), Rejection> {
        if self.envs[env].over {
            return match self.autoreset {
                Autoreset::Disabled => Err(Rejection::FinishedEnv { env }),
                _ => Ok(()), // the action is ignored, the environment resets
            };
        }
        for (agent, &action) in actions.iter().enumerate() {
            let mask = self.mask(env, agent);
            let available = usize::try_from(action).ok().and_then(|action| mask.get(action));
            if available.is_none_or(|available| *available == 0) {
                let available = (0..self.n_actions).filter(|action| mask[*action] != 0).collect();
                return Err(Rejection::UnavailableAction { env, agent, action, available });
            }
        }
        Ok(())
    }

    fn reserve_env(&mut self, number: RequestNumber, env: usize) -> Result<(), Rejection> {
        match self.envs[env].busy {
            Some(other) if other == number => Err(Rejection::DuplicateEnv { env }),
            Some(_) => Err(Rejection::BusyEnv { env }),
            None => {
                self.envs[env].busy = Some(number);
                Ok(())
            }
        }
    }

    /// Marks all environments busy with a reset, whether or not they work on an earlier request.
    pub(super) fn reserve_full_reset(&mut self, number: RequestNumber) {
        self.was_reset = true;
        self.envs.fill(EnvState { busy: Some(number), over: false });
        self.outstanding = self.envs.len();
    }

    /// Marks the environments of `ids` busy with a reset.
    pub(super) fn reserve_reset(&mut self, number: RequestNumber, ids: &[i32]) -> Result<(), Rejection> {
        self.check_was_reset()?;
        check_not_empty(ids.len())?;
        let reserved = ids.iter().try_for_each(|id| self.reserve_env(number, self.env_index(*id)?));
        if let Err(rejection) = reserved {
            self.clear(number);
            return Err(rejection);
        }
        if self.synchronous {
            // The rest of the batch comes along, unchanged.
            self.envs.iter_mut().for_each(|env| env.busy = Some(number));
            self.outstanding = self.envs.len();
        } else {
            self.outstanding += ids.len();
        }
        Ok(())
    }

    /// Does `ids` name every environment once, in any order?
    pub(super) fn names_all(&self, ids: &[i32]) -> bool {
        ids.len() == self.envs.len() && check_distinct(ids.iter().copied(), self.envs.len()).is_ok()
    }

    /// Frees the environments of a request that was refused as a whole; `false` if it had none.
    pub(super) fn release(&mut self, number: RequestNumber) -> bool {
        let freed = self.clear(number);
        self.outstanding = self.outstanding.saturating_sub(freed); // a frame may have lied
        freed > 0
    }

    fn clear(&mut self, number: RequestNumber) -> usize {
        let mut freed = 0;
        for env in self.envs.iter_mut().filter(|env| env.busy == Some(number)) {
            env.busy = None;
            freed += 1;
        }
        freed
    }

    /// Remembers what a received batch says about its environments.
    pub(super) fn observe_batch(&mut self, layout: &Layout, frame: &[u8]) {
        let ids = layout.view::<i32>(frame, Field::EnvId).expect("every lane has env_id");
        let terminated = layout.view::<u8>(frame, Field::Terminated).expect("every lane has terminated");
        let truncated = layout.view::<u8>(frame, Field::Truncated).expect("every lane has truncated");
        let masks = layout.view::<u8>(frame, Field::AvailActions);
        let row = self.n_agents * self.n_actions;
        // A synchronous frame has its environments in order, and one copy is faster than many: the workers'
        // cores wrote these lines, and so their transfers overlap.
        let in_order = self.synchronous && ids.iter().zip(0..).all(|(id, slot)| *id == slot);
        let (all, masks) = if in_order { (masks, None) } else { (None, masks) };
        if let Some(all) = all {
            self.masks.copy_from_slice(all);
        }
        for (slot, id) in ids.iter().enumerate() {
            let Ok(env) = self.env_index(*id) else { continue }; // a supervisor may lie
            let ended = terminated[slot] | truncated[slot] != 0;
            self.envs[env] = EnvState { busy: None, over: ended && self.autoreset != Autoreset::SameStep };
            if let Some(masks) = masks {
                let masks = &masks[slot * row..(slot + 1) * row];
                self.masks[env * row..(env + 1) * row].copy_from_slice(masks);
            }
        }
        self.outstanding = self.outstanding.saturating_sub(ids.len());
    }
}

/// A request to no environment would never be answered.
fn check_not_empty(given: usize) -> Result<(), Rejection> {
    if given > 0 { Ok(()) } else { Err(Rejection::NoEnv) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use smaclite_engine::Sizes;

    /// A validator of three environments in batches of two.
    fn validator() -> RequestValidator {
        let sizes = Sizes { n_agents: 1, n_enemies: 1, n_actions: 7, obs_size: 1, state_size: 1 };
        let settings = LaneSettings { batch_size: 2, ..LaneSettings::new(3) };
        RequestValidator::new(&settings.layout(sizes), &settings)
    }

    #[test]
    fn without_masks_every_action_and_no_other_counts_as_available() {
        let mut validator = validator();
        validator.reserve_full_reset(RequestNumber(1));
        for (action, is_available) in [(-1, false), (0, true), (6, true), (7, false), (i32::MAX, false)] {
            assert_eq!(validator.check_actions(0, &[action]).is_ok(), is_available, "{action}");
        }
    }

    /// The refusal said "malformed request", and not what was expected.
    #[test]
    fn a_request_to_no_environment_says_what_is_expected() {
        let mut validator = validator();
        validator.reserve_full_reset(RequestNumber(1));
        for refused in [
            validator.reserve_reset(RequestNumber(2), &[]),
            validator.reserve_step(RequestNumber(3), &[], Some(&[])),
        ] {
            let said = refused.unwrap_err().to_string();
            assert_eq!(said, "a request must name at least one environment, got none");
        }
    }

    /// Naming them all one by one was once refused while results were under way, where naming none was not.
    #[test]
    fn a_reset_of_all_drops_what_is_under_way_however_they_are_named() {
        let mut validator = validator();
        assert!(validator.names_all(&[2, 0, 1]));
        assert!(!validator.names_all(&[0, 1]) && !validator.names_all(&[0, 1, 1]));
        validator.reserve_full_reset(RequestNumber(1));
        assert!(matches!(
            validator.reserve_reset(RequestNumber(2), &[0, 1]),
            Err(Rejection::BusyEnv { env: 0 })
        ));
        validator.reserve_full_reset(RequestNumber(3));
        assert_eq!(validator.outstanding(), 3);
    }
}
