//! Uniformly random available actions, drawn by the newest batch.

use super::error::ClientError;
use crate::batch::Batch;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use smaclite_pool::env_ids::env_index;
use smaclite_pool::fields::Field;

/// Draws actions by the masks of a batch.
pub(super) struct Sampler {
    generator: Pcg64Mcg,
}

impl Sampler {
    pub(super) fn new(seed: u64) -> Sampler {
        Sampler { generator: Pcg64Mcg::seed_from_u64(seed) }
    }

    /// Writes an action for every agent of the environments of `ids`, which must be in the batch; if `None`,
    /// of those of the batch in order of their ids. `out` is `[count, n_agents]`.
    pub(super) fn fill(
        &mut self,
        batch: &Batch,
        ids: Option<&[i32]>,
        num_envs: usize,
        out: &mut [i32],
    ) -> Result<(), ClientError> {
        let sizes = batch.layout().sizes();
        let masks = batch.field::<u8>(Field::AvailActions).ok_or(ClientError::NoMasks)?;
        let envs = batch.env_id();
        for (i, actions) in out.chunks_exact_mut(sizes.n_agents).enumerate() {
            let id = ids.map_or(i as i32, |ids| ids[i]);
            // In a synchronous batch, and where the ids are the batch's, the slot is the index.
            let slot =
                if envs.get(i) == Some(&id) { Some(i) } else { envs.iter().position(|env| *env == id) };
            let Some(slot) = slot else {
                env_index(id, num_envs)?;
                return Err(ClientError::NotInBatch { env: id });
            };
            let rows = masks[slot * sizes.n_agents * sizes.n_actions..].chunks_exact(sizes.n_actions);
            for (action, mask) in actions.iter_mut().zip(rows) {
                *action = pick(mask, self.generator.next_u64()) as i32;
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
