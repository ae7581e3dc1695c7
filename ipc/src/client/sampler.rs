//! Uniformly random available actions.

use super::request_validator::RequestValidator;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use smaclite_engine::policy::pick;
use smaclite_pool::Rejection;

/// Draws actions by the masks that a [`RequestValidator`] remembers.
pub(super) struct Sampler {
    generator: Pcg64Mcg,
    /// The mask of one agent, one bit per action.
    bits: Vec<u64>,
}

impl Sampler {
    pub(super) fn new(seed: u64) -> Sampler {
        Sampler { generator: Pcg64Mcg::seed_from_u64(seed), bits: Vec::new() }
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
                *action = self.draw(validator.mask(env, agent));
            }
        }
        Ok(())
    }

    fn draw(&mut self, mask: &[u8]) -> i32 {
        self.bits.clear();
        self.bits.extend(mask.chunks(64).map(pack_word));
        pick(&self.bits, self.generator.next_u64()) as i32
    }
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

    #[test]
    fn bytes_become_bits() {
        assert_eq!(pack_word(&[1, 0, 1, 1, 0, 0, 0, 1]), 0b1000_1101);
        assert_eq!(pack_word(&[0, 1]), 0b10);
        assert_eq!(pack_word(&[1, 0, 0, 0, 0, 0, 0, 0, 0, 1, 1]), 0b110_0000_0001);
        assert_eq!(pack_word(&[1; 64]), u64::MAX);
    }
}
