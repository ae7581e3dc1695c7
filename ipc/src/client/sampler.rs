//! Uniformly random available actions, drawn by the newest batch.

use super::error::ClientError;
use crate::batch::Batch;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use smaclite_engine::{Faction, Sizes};
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

    /// Writes an action for every actor of the environments of `ids`, which must be in the batch; if `None`,
    /// of those of the batch in order of their ids. `out` is `[count, n_actors]`.
    pub(super) fn fill(
        &mut self,
        batch: &Batch,
        ids: Option<&[i32]>,
        num_envs: usize,
        out: &mut [i32],
    ) -> Result<(), ClientError> {
        let sizes = batch.layout().sizes();
        let masks = Masks::of(batch, Faction::Ally, Field::AvailActions).ok_or(ClientError::NoMasks)?;
        let enemy_masks = match sizes.enemies {
            None => None,
            Some(_) => {
                let masks = Masks::of(batch, Faction::Enemy, Field::EnemyAvailActions);
                Some(masks.ok_or(ClientError::NoEnemyMasks)?)
            }
        };
        let envs = batch.env_id();
        for (i, actions) in out.chunks_exact_mut(sizes.n_actors()).enumerate() {
            let id = ids.map_or(i as i32, |ids| ids[i]);
            // In a synchronous batch, and where the ids are the batch's, the slot is the index.
            let slot =
                if envs.get(i) == Some(&id) { Some(i) } else { envs.iter().position(|env| *env == id) };
            let Some(slot) = slot else {
                env_index(id, num_envs)?;
                return Err(ClientError::NotInBatch { env: id });
            };
            let rows = masks.rows(slot).chain(enemy_masks.iter().flat_map(|masks| masks.rows(slot)));
            for (action, mask) in actions.iter_mut().zip(rows) {
                *action = pick(mask, self.generator.next_u64()) as i32;
            }
        }
        Ok(())
    }
}

/// The available actions of a side, `[M, n_units, n_actions]`.
struct Masks<'a> {
    bytes: &'a [u8],
    n_units: usize,
    n_actions: usize,
}

impl<'a> Masks<'a> {
    fn of(batch: &'a Batch, side: Faction, field: Field) -> Option<Masks<'a>> {
        let Sizes { n_agents: n_units, n_actions, .. } = batch.layout().sizes().of(side)?;
        Some(Masks { bytes: batch.field(field)?, n_units, n_actions })
    }

    fn rows(&self, slot: usize) -> impl Iterator<Item = &'a [u8]> {
        let len = self.n_units * self.n_actions;
        self.bytes[slot * len..][..len].chunks_exact(self.n_actions)
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
