//! Actions of a policy: a categorical distribution over the available actions, from the outputs of the actor.
//!
//! The probability of action j is p_j = exp(z_j - m) / S, where m is the largest output of an available
//! action and S the sum of the exponentials; that of an unavailable one is 0. Rows of outputs and of masks
//! are padded to a multiple of [`WIDTH`] with actions that are unavailable.

use crate::math::{WIDTH, exp, sum};

/// Stands for the output of an unavailable action: so small that its exponential vanishes beside any other.
const UNAVAILABLE: f32 = -1e30;

/// How an action is chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// The most probable one, the first of equal ones.
    Greedy,
    /// With its probability.
    Sampled,
}

impl Choice {
    /// Both, in the order of files and tables.
    pub const BOTH: [Choice; 2] = [Choice::Greedy, Choice::Sampled];

    /// The place in [`BOTH`](Choice::BOTH).
    pub fn index(self) -> usize {
        self as usize
    }

    /// What an option `--greedy` says.
    pub fn of(greedy: bool) -> Choice {
        if greedy { Choice::Greedy } else { Choice::Sampled }
    }
}

smaclite_units::keywords!(Choice, "actions", "greedy" => Greedy, "sampled" => Sampled);

/// Replaces a row of outputs by z_j - m, writes exp(z_j - m) to `powers`, 0 for unavailable actions, and
/// returns S.
#[inline(always)]
pub(crate) fn exponentials(outputs: &mut [f32], mask: &[u8], powers: &mut [f32]) -> f32 {
    let (outputs, mask) = (outputs.as_chunks_mut::<WIDTH>().0, mask.as_chunks::<WIDTH>().0);
    let mut largest = [UNAVAILABLE; WIDTH];
    for (outputs, mask) in outputs.iter_mut().zip(mask) {
        for i in 0..WIDTH {
            outputs[i] = if mask[i] != 0 { outputs[i] } else { UNAVAILABLE };
            largest[i] = if largest[i] > outputs[i] { largest[i] } else { outputs[i] };
        }
    }
    let largest = largest.into_iter().fold(UNAVAILABLE, f32::max);
    let mut sums = [0.0; WIDTH];
    for ((outputs, mask), powers) in outputs.iter_mut().zip(mask).zip(powers.as_chunks_mut::<WIDTH>().0) {
        for i in 0..WIDTH {
            outputs[i] -= largest;
            let power = exp(outputs[i]);
            powers[i] = if mask[i] != 0 { power } else { 0.0 };
            sums[i] += powers[i];
        }
    }
    sum(sums)
}

/// Chooses an action of a row, whose outputs it overwrites; `powers` is memory of the same length. Returns
/// the action and the logarithm of its probability. `random` is uniform in 0..1. If no action is available,
/// that is action 0.
#[inline(always)]
pub(crate) fn choose(
    outputs: &mut [f32],
    mask: &[u8],
    powers: &mut [f32],
    choice: Choice,
    random: f32,
) -> (usize, f32) {
    let total = exponentials(outputs, mask, powers);
    let action = match choice {
        // The largest one is 0 now. Its exponential is 1, but so are those of others that are hardly smaller.
        Choice::Greedy => {
            let is_largest = |(output, available): (&f32, &u8)| *output == 0.0 && *available != 0;
            outputs.iter().zip(mask).position(is_largest).unwrap_or(0)
        }
        Choice::Sampled => sample(powers, mask, random * total),
    };
    (action, outputs[action] - total.max(1.0).ln())
}

/// The first available action at which the sum of the exponentials exceeds `threshold`; because of rounding
/// that may be none, and then it is the last available one.
#[inline(always)]
fn sample(powers: &[f32], mask: &[u8], threshold: f32) -> usize {
    let (mut action, mut sum) = (0, 0.0);
    for (i, (power, available)) in powers.iter().zip(mask).enumerate() {
        if *available != 0 {
            action = i;
            sum += power;
            if sum > threshold {
                break;
            }
        }
    }
    action
}

#[cfg(test)]
mod tests {
    use super::*;

    const MASK: [u8; 8] = [0, 1, 0, 1, 1, 0, 0, 0];
    const OUTPUTS: [f32; 8] = [50.0, 1.0, 9.0, 3.0, 2.0, 0.0, 0.0, 0.0];

    #[test]
    fn actions_have_their_probabilities() {
        let powers = [1.0f64, 3.0, 2.0].map(f64::exp);
        let total: f64 = powers.iter().sum();
        let mut counts = [0; 8];
        for i in 0..10_000 {
            let (action, log_prob) =
                choose(&mut OUTPUTS.clone(), &MASK, &mut [0.0; 8], Choice::Sampled, (i as f32 + 0.5) / 1e4);
            counts[action] += 1;
            let expected = (powers[[0, 0, 0, 1, 2][action]] / total).ln();
            assert!((f64::from(log_prob) - expected).abs() < 1e-5, "{action}: {log_prob} {expected}");
        }
        for (action, power) in [(1, powers[0]), (3, powers[1]), (4, powers[2])] {
            let expected = power / total * 1e4;
            assert!((f64::from(counts[action]) - expected).abs() < 2.0, "{action}: {counts:?}");
        }
        assert_eq!(choose(&mut OUTPUTS.clone(), &MASK, &mut [0.0; 8], Choice::Greedy, 0.5).0, 3);
    }

    #[test]
    fn unavailable_actions_are_never_chosen() {
        for random in [0.0, 0.5, 0.999_999_94] {
            let choice = |outputs: [f32; 8], mask: [u8; 8]| {
                choose(&mut outputs.clone(), &mask, &mut [0.0; 8], Choice::Sampled, random).0
            };
            assert_eq!(choice([0.0; 8], [0, 0, 0, 0, 0, 1, 0, 0]), 5);
            assert!([1, 3, 4].contains(&choice([-1e29, 1e3, 1e3, -1e3, -1e9, 0.0, 0.0, 0.0], MASK)));
            assert_eq!(choice([0.0; 8], [0; 8]), 0);
        }
        assert_eq!(choose(&mut [-5.0; 8], &MASK, &mut [0.0; 8], Choice::Greedy, 0.0).0, 1);
    }

    /// Of outputs whose difference has an exponential of 1, the first was taken, and not the largest.
    #[test]
    fn the_largest_output_is_the_greedy_choice_however_close_others_are() {
        let mut close = [0.0, 0.1_f32, 0.3, 0.1_f32.next_up(), 0.1_f32, 0.0, 0.0, 0.0];
        assert_eq!(choose(&mut close, &MASK, &mut [0.0; 8], Choice::Greedy, 0.0).0, 3);
    }
}
