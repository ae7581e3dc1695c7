//! Uniformly random available actions.

use super::request_validator::RequestValidator;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use smaclite_pool::Rejection;

/// Draws actions by the masks that a [`RequestValidator`] remembers.
pub(super) struct Sampler {
    generator: Pcg64Mcg,
}

impl Sampler {
    pub(super) fn new(seed: u64) -> Sampler {
        Sampler { generator: Pcg64Mcg::seed_from_u64(seed) }
    }

    /// Writes an action for every agent of the environments (all, if `None`), `[count, n_agents]`.
    pub(super) fn fill(
        &mut self,
        validator: &RequestValidator,
        env_ids: Option<&[i32]>,
        out: &mut [i32],
    ) -> Result<(), Rejection> {
        validator.check_was_reset()?;
        for (i, actions) in out.chunks_exact_mut(validator.n_agents()).enumerate() {
            let env = env_ids.map_or(Ok(i), |ids| validator.env_index(ids[i]))?;
            for (agent, action) in actions.iter_mut().enumerate() {
                *action = pick(validator.mask(env, agent), self.generator.next_u64()) as i32;
            }
        }
        Ok(())
    }
}

/// One of the available actions, as uniformly as `random` is; 0 if none is available.
fn pick(mask: &[u8], random: u64) -> usize {
    let count: u32 = mask.iter().map(|available| u32::from(*available != 0)).sum();
    let skip = smaclite_engine::policy::uniform_below(count, random);
    // The index of the available action number `skip` is the number of prefixes of the mask that contain at
    // most `skip` available actions. It is counted without branches, since random ones would be
    // mispredicted.
    let mut seen = 0;
    let action = mask.iter().filter(|available| {
        seen += u32::from(**available != 0);
        seen <= skip
    });
    let action = action.count();
    if action < mask.len() { action } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_available_action_and_no_other_is_picked_alike() {
        let picked = |mask: &[u8]| [0, 1, 2, 3].map(|quarter| pick(mask, quarter << 62));
        assert_eq!(picked(&[0, 1, 1, 0, 1, 0, 1, 0]), [1, 2, 4, 6]);
        assert_eq!(picked(&[1, 0, 0, 1]), [0, 0, 3, 3]);
        assert_eq!(picked(&[0, 0, 1]), [2; 4]);
        assert_eq!(picked(&[0; 9]), [0; 4], "no action is available");
        let mut long = [1; 200];
        long[0] = 0;
        assert_eq!([pick(&long, 0), pick(&long, u64::MAX)], [1, 199]);
    }
}
