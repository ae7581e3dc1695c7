//! What a learner may send next: which actions are legal, which environments still work on an earlier
//! request. The client checks before it sends, with the error the supervisor would answer, and samples legal
//! actions from the same bits.

use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use smaclite_engine::policy::pick;
use smaclite_pool::fields::Field;
use smaclite_pool::layout::Layout;
use smaclite_pool::{Autoreset, Rejection};
use std::hint::black_box;

/// What the client knows of a lane's environments.
pub(crate) struct RequestValidator {
    n_agents: usize,
    n_actions: usize,
    autoreset: Autoreset,
    synchronous: bool,
    /// Words of 64 actions an agent has in `bits`.
    words: usize,
    /// `[num_envs, n_agents, words]`: bit a = action a is available. Every action is, where the lane leaves
    /// the masks out: the supervisor checks in any case.
    bits: Vec<u64>,
    envs: Vec<EnvState>,
    /// Results still to come.
    outstanding: usize,
    was_reset: bool,
    sampler: Pcg64Mcg,
}

#[derive(Clone, Copy, Default)]
struct EnvState {
    /// The request it works on.
    busy: Option<u64>,
    /// Its episode ended and it was not reset since.
    over: bool,
}

impl RequestValidator {
    pub(crate) fn new(layout: &Layout, num_envs: usize, autoreset: Autoreset) -> RequestValidator {
        let sizes = layout.sizes();
        let words = sizes.n_actions.div_ceil(64);
        RequestValidator {
            n_agents: sizes.n_agents,
            n_actions: sizes.n_actions,
            autoreset,
            synchronous: layout.slots() == num_envs,
            words,
            bits: every_action(sizes.n_actions).cycle().take(num_envs * sizes.n_agents * words).collect(),
            envs: vec![EnvState::default(); num_envs],
            outstanding: 0,
            was_reset: false,
            sampler: Pcg64Mcg::seed_from_u64(0),
        }
    }

    pub(crate) fn outstanding(&self) -> usize {
        self.outstanding
    }

    pub(crate) fn seed_sampler(&mut self, seed: u64) {
        self.sampler = Pcg64Mcg::seed_from_u64(seed);
    }

    /// Checks a step of environments `env_ids` (all, if `None`) and marks them busy with request `number`.
    pub(crate) fn reserve_step(
        &mut self,
        number: u64,
        actions: &[i32],
        env_ids: Option<&[i32]>,
    ) -> Result<(), Rejection> {
        if !self.was_reset {
            return Err(Rejection::NotReset);
        }
        let given = env_ids.map_or(self.envs.len(), <[i32]>::len);
        check_not_empty(given)?;
        if self.synchronous && given != self.envs.len() {
            return Err(Rejection::IncompleteBatch { given, expected: self.envs.len() });
        }
        let rows = actions.chunks_exact(self.n_agents);
        let checked = match env_ids {
            None => rows.enumerate().try_for_each(|(env, row)| self.reserve_row(number, env, row)),
            Some(ids) => ids.iter().zip(rows).try_for_each(|(id, row)| {
                let env = self.env_of(*id)?;
                self.reserve_row(number, env, row)
            }),
        };
        self.outstanding += given;
        checked.inspect_err(|_| {
            self.outstanding -= given;
            self.clear(number);
        })
    }

    fn reserve_row(&mut self, number: u64, env: usize, actions: &[i32]) -> Result<(), Rejection> {
        self.reserve_env(number, env)?;
        if self.envs[env].over {
            return match self.autoreset {
                Autoreset::Disabled => Err(Rejection::FinishedEnv { env }),
                _ => Ok(()), // the action is ignored, the environment resets
            };
        }
        for (agent, &action) in actions.iter().enumerate() {
            if !self.is_available(env, agent, action) {
                let available =
                    (0..self.n_actions).filter(|a| self.is_available(env, agent, *a as i32)).collect();
                return Err(Rejection::UnavailableAction { env, agent, action, available });
            }
        }
        Ok(())
    }

    fn reserve_env(&mut self, number: u64, env: usize) -> Result<(), Rejection> {
        match self.envs[env].busy {
            Some(other) if other == number => Err(Rejection::DuplicateEnv { env }),
            Some(_) => Err(Rejection::BusyEnv { env }),
            None => {
                self.envs[env].busy = Some(number);
                Ok(())
            }
        }
    }

    fn env_of(&self, id: i32) -> Result<usize, Rejection> {
        let num_envs = self.envs.len();
        let env = usize::try_from(id).ok().filter(|env| *env < num_envs);
        env.ok_or(Rejection::UnknownEnv { env: i64::from(id), num_envs })
    }

    fn is_available(&self, env: usize, agent: usize, action: i32) -> bool {
        let Ok(action) = usize::try_from(action) else { return false };
        let word = (env * self.n_agents + agent) * self.words + action / 64;
        action < self.n_actions && self.bits[word] >> (action % 64) & 1 == 1
    }

    /// Marks all environments busy with a reset, whatever they do.
    pub(crate) fn reserve_full_reset(&mut self, number: u64) {
        self.was_reset = true;
        self.envs.fill(EnvState { busy: Some(number), over: false });
        self.outstanding = self.envs.len();
    }

    /// Marks the environments of `env_ids` busy with a reset.
    pub(crate) fn reserve_reset(&mut self, number: u64, ids: &[i32]) -> Result<(), Rejection> {
        if !self.was_reset {
            return Err(Rejection::NotReset);
        }
        check_not_empty(ids.len())?;
        let taken = ids.iter().try_for_each(|id| {
            let env = self.env_of(*id)?;
            self.reserve_env(number, env)
        });
        if let Err(rejection) = taken {
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

    /// Does a reset of `env_ids` reset every environment, however they are named?
    pub(crate) fn is_whole(&self, env_ids: Option<&[i32]>) -> bool {
        let Some(ids) = env_ids else { return true };
        let mut named = vec![false; self.envs.len()];
        ids.len() == named.len()
            && ids
                .iter()
                .all(|id| self.env_of(*id).is_ok_and(|env| !std::mem::replace(&mut named[env], true)))
    }

    /// The request was refused as a whole: its environments are free again.
    pub(crate) fn refused(&mut self, number: u64) -> bool {
        let freed = self.clear(number);
        self.outstanding = self.outstanding.saturating_sub(freed); // a frame may have lied
        freed > 0
    }

    fn clear(&mut self, number: u64) -> usize {
        let mut freed = 0;
        for env in self.envs.iter_mut().filter(|env| env.busy == Some(number)) {
            env.busy = None;
            freed += 1;
        }
        freed
    }

    /// Takes in a received batch.
    pub(crate) fn observe_batch(&mut self, layout: &Layout, frame: &[u8]) {
        let ids = layout.view::<i32>(frame, Field::EnvId).expect("every lane has env_id");
        let terminated = layout.view::<u8>(frame, Field::Terminated).expect("every lane has terminated");
        let truncated = layout.view::<u8>(frame, Field::Truncated).expect("every lane has truncated");
        let masks = layout.view::<u8>(frame, Field::AvailActions);
        let row = self.n_agents * self.n_actions;
        masks.into_iter().for_each(fetch);
        for (slot, id) in ids.iter().enumerate() {
            let Some(env) = usize::try_from(*id).ok().filter(|env| *env < self.envs.len()) else { continue };
            let ended = terminated[slot] | truncated[slot] != 0;
            self.envs[env] = EnvState { busy: None, over: ended && self.autoreset != Autoreset::SameStep };
            if let Some(masks) = masks {
                self.pack(env, &masks[slot * row..(slot + 1) * row]);
            }
        }
        self.outstanding = self.outstanding.saturating_sub(ids.len());
    }

    fn pack(&mut self, env: usize, mask: &[u8]) {
        let words = &mut self.bits[env * self.n_agents * self.words..(env + 1) * self.n_agents * self.words];
        for (agent, bits) in mask.chunks_exact(self.n_actions).zip(words.chunks_exact_mut(self.words)) {
            for (bytes, word) in agent.chunks(64).zip(bits) {
                *word = pack_word(bytes);
            }
        }
    }

    /// Writes a uniformly random legal action for every agent of the environments (all, if `None`).
    pub(crate) fn sample(&mut self, env_ids: Option<&[i32]>, out: &mut [i32]) -> Result<(), Rejection> {
        if !self.was_reset {
            return Err(Rejection::NotReset);
        }
        for (i, row) in out.chunks_exact_mut(self.n_agents).enumerate() {
            let env = match env_ids {
                Some(ids) => self.env_of(ids[i])?,
                None => i,
            };
            for (agent, action) in row.iter_mut().enumerate() {
                let start = (env * self.n_agents + agent) * self.words;
                *action = pick(&self.bits[start..start + self.words], self.sampler.next_u64()) as i32;
            }
        }
        Ok(())
    }
}

/// The words of an agent to whom every action is available.
fn every_action(n_actions: usize) -> impl Iterator<Item = u64> + Clone {
    (0..n_actions.div_ceil(64)).map(move |word| match n_actions - word * 64 {
        left if left < 64 => (1 << left) - 1,
        _ => u64::MAX,
    })
}

/// Reads from every cache line (but for the last, where bytes do not begin on one). Another core wrote them
/// last, and this way they come over side by side rather than each when its turn comes.
fn fetch(bytes: &[u8]) {
    const LINE: usize = 64;
    black_box(bytes.iter().step_by(LINE).fold(0, |sum, byte| sum ^ byte));
}

/// A request to no environment would never be answered.
fn check_not_empty(given: usize) -> Result<(), Rejection> {
    if given > 0 { Ok(()) } else { Err(Rejection::NoEnv) }
}

/// Up to 64 mask bytes as bits.
fn pack_word(bytes: &[u8]) -> u64 {
    let (eights, rest) = bytes.as_chunks::<8>();
    let last = rest.iter().rev().fold(0, |bits, byte| bits << 1 | u64::from(byte & 1));
    let start = if rest.is_empty() { 0 } else { last << (8 * eights.len()) };
    eights.iter().enumerate().fold(start, |word, (i, eight)| word | pack_eight(*eight) << (8 * i))
}

/// Eight mask bytes as eight bits: the multiplication gathers the low bit of every byte in the top byte.
fn pack_eight(bytes: [u8; 8]) -> u64 {
    ((u64::from_le_bytes(bytes) & 0x0101_0101_0101_0101).wrapping_mul(0x0102_0408_1020_4080)) >> 56
}

#[cfg(test)]
mod tests {
    use super::*;
    use smaclite_engine::Sizes;
    use smaclite_pool::fields::FieldSet;

    #[test]
    fn bytes_become_bits() {
        assert_eq!(pack_word(&[1, 0, 1, 1, 0, 0, 0, 1]), 0b1000_1101);
        assert_eq!(pack_word(&[0, 1]), 0b10);
        assert_eq!(pack_word(&[1, 0, 0, 0, 0, 0, 0, 0, 0, 1, 1]), 0b110_0000_0001);
        assert_eq!(pack_word(&[1; 64]), u64::MAX);
    }

    #[test]
    fn without_masks_every_action_and_no_other_counts_as_legal() {
        assert_eq!(every_action(3).collect::<Vec<_>>(), [0b111]);
        assert_eq!(every_action(64).collect::<Vec<_>>(), [u64::MAX]);
        assert_eq!(every_action(66).collect::<Vec<_>>(), [u64::MAX, 0b11]);
    }

    /// The refusal said "malformed request", and not what was expected.
    #[test]
    fn a_request_to_no_environment_says_what_is_expected() {
        let sizes = Sizes { n_agents: 1, n_enemies: 1, n_units: 2, n_actions: 7, obs_size: 1, state_size: 1 };
        let layout = Layout::new(sizes, 2, FieldSet::ALL);
        let mut validator = RequestValidator::new(&layout, 3, Autoreset::NextStep);
        validator.reserve_full_reset(1);
        for refused in [validator.reserve_reset(2, &[]), validator.reserve_step(3, &[], Some(&[]))] {
            let said = refused.unwrap_err().to_string();
            assert_eq!(said, "no environment was chosen; expected at least one");
        }
    }

    /// Naming them all one by one was once refused while results were under way, where naming none was not.
    #[test]
    fn a_reset_of_all_drops_what_is_under_way_however_they_are_named() {
        let sizes = Sizes { n_agents: 1, n_enemies: 1, n_units: 2, n_actions: 7, obs_size: 1, state_size: 1 };
        let layout = Layout::new(sizes, 2, FieldSet::ALL);
        let mut validator = RequestValidator::new(&layout, 3, Autoreset::NextStep);
        assert!(validator.is_whole(None) && validator.is_whole(Some(&[2, 0, 1])));
        assert!(!validator.is_whole(Some(&[0, 1])) && !validator.is_whole(Some(&[0, 1, 1])));
        validator.reserve_full_reset(1);
        assert!(matches!(validator.reserve_reset(2, &[0, 1]), Err(Rejection::BusyEnv { env: 0 })));
        validator.reserve_full_reset(3);
        assert_eq!(validator.outstanding(), 3);
    }
}
