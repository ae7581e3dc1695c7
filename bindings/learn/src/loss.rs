//! The losses of PPO (Schulman et al., 2017) and their gradients with respect to the outputs of the networks.
//! Each function takes one row and overwrites its outputs by the gradient.
//!
//! **Policy.** With the probability ratio ρ = exp(ln p_a - ln p_a,old) of the chosen action a and its
//! advantage A, the loss of a row is
//!
//!   L = -min(ρ A, clip(ρ, 1 - ε, 1 + ε) A) - c H,    H = -Σ_j p_j ln p_j.
//!
//! The minimum has the derivative ρ A with respect to ln p_a where its first term is the smaller one or both
//! are equal, and 0 where the clipped term is. For a softmax, ∂ln p_a/∂z_j = \[j = a\] - p_j, and from
//! ∂p_k/∂z_j = p_k (\[j = k\] - p_j) follows ∂H/∂z_j = -p_j (ln p_j + H). Together
//!
//!   ∂L/∂z_j = -g (\[j = a\] - p_j) + c p_j (ln p_j + H),    g = ρ A or 0.
//!
//! **Value.** With the target R, the old prediction v_old and the Huber loss h (x²/2 up to d, then d (|x| -
//! d/2)), the loss of a row is the larger one of h(v - R) and h(clip(v, v_old ± ε) - R). The second has the
//! derivative 0 where v is clipped. Elsewhere it equals the first.

use crate::math::{WIDTH, sum};
use crate::policy::exponentials;

/// The constants of the policy loss.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PolicyLoss {
    /// ε.
    pub clip: f32,
    /// c.
    pub entropy: f32,
    /// Factor of the gradient: 1 / rows of the minibatch.
    pub scale: f32,
}

/// What was done in a row, and how good it was.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PolicyRow<'a> {
    /// Available actions, padded.
    pub mask: &'a [u8],
    pub action: usize,
    /// ln p_a when the action was chosen.
    pub old_log_prob: f32,
    pub advantage: f32,
}

/// Sums over rows, for the log.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct PolicyStats {
    pub rows: f64,
    /// The negative of the smaller surrogate.
    pub loss: f64,
    pub entropy: f64,
    /// ρ - 1 - ln ρ, whose mean estimates the Kullback-Leibler divergence of the old policy from the new.
    pub kl: f64,
    /// Rows whose ratio is outside of 1 ± ε.
    pub clipped: f64,
}

impl PolicyStats {
    pub fn add(&mut self, other: &PolicyStats) {
        self.rows += other.rows;
        self.loss += other.loss;
        self.entropy += other.entropy;
        self.kl += other.kl;
        self.clipped += other.clipped;
    }
}

impl PolicyLoss {
    /// Replaces the outputs of a row, padded, by the gradient; `powers` is memory of the same length.
    ///
    /// With m and S of the `policy` module, ln p_j = z_j - m - ln S, and the entropy is
    /// ln S - Σ p_j (z_j - m).
    #[inline(always)]
    pub fn differentiate(
        &self,
        row: &PolicyRow<'_>,
        outputs: &mut [f32],
        powers: &mut [f32],
        stats: &mut PolicyStats,
    ) {
        let total = exponentials(outputs, row.mask, powers);
        let (inverse, log_total) = (1.0 / total, total.ln());
        let log_ratio = outputs[row.action] - log_total - row.old_log_prob;
        let ratio = log_ratio.exp();
        let surrogate = ratio * row.advantage;
        let clipped = ratio.clamp(1.0 - self.clip, 1.0 + self.clip) * row.advantage;
        let g = if surrogate <= clipped { surrogate } else { 0.0 };
        let mut products = [0.0; WIDTH];
        for (powers, outputs) in powers.as_chunks::<WIDTH>().0.iter().zip(outputs.as_chunks::<WIDTH>().0) {
            for i in 0..WIDTH {
                products[i] += powers[i] * outputs[i];
            }
        }
        let entropy = log_total - sum(products) * inverse;
        for (output, power) in outputs.iter_mut().zip(powers) {
            let (p, log) = (*power * inverse, *output - log_total);
            *output = self.scale * p * (g + self.entropy * (log + entropy));
        }
        outputs[row.action] -= self.scale * g;
        stats.rows += 1.0;
        stats.loss -= f64::from(surrogate.min(clipped));
        stats.entropy += f64::from(entropy);
        stats.kl += f64::from(ratio - 1.0 - log_ratio);
        stats.clipped += f64::from(u8::from((ratio - 1.0).abs() > self.clip));
    }
}

/// The constants of the value loss.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ValueLoss {
    /// ε.
    pub clip: f32,
    /// d.
    pub huber: f32,
    /// Factor of the gradient: 1 / rows of the minibatch.
    pub scale: f32,
}

impl ValueLoss {
    /// The loss of a prediction, and its derivative, scaled.
    #[inline(always)]
    pub fn differentiate(&self, value: f32, old: f32, target: f32) -> (f32, f32) {
        let limited = value.clamp(old - self.clip, old + self.clip);
        let (free, clipped) = (self.huber(value - target), self.huber(limited - target));
        let derivative = (value - target).clamp(-self.huber, self.huber);
        if free >= clipped { (free, self.scale * derivative) } else { (clipped, 0.0) }
    }

    #[inline(always)]
    fn huber(&self, x: f32) -> f32 {
        let (size, d) = (x.abs(), self.huber);
        if size <= d { 0.5 * x * x } else { d * (size - 0.5 * d) }
    }
}

#[cfg(test)]
mod tests;
