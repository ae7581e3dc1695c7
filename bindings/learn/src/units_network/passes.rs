//! What the passes of a network over units have in common: loops over rows of samples.

use crate::config::Activation;
use crate::linear::sum_rows_by;
use crate::math::{WIDTH, sum, tanh};

/// Applies the activation.
#[inline(always)]
pub(super) fn activate(z: &mut [f32], activation: Activation) {
    match activation {
        Activation::Relu => z.iter_mut().for_each(|z| *z = z.max(0.0)),
        Activation::Tanh => z.iter_mut().for_each(|z| *z = tanh(*z)),
    }
}

/// Adds to each row the row of its sample.
#[inline(always)]
pub(super) fn add_of_sample(rows: &mut [f32], of_samples: &[f32], samples: &[u32], width: usize) {
    for (row, sample) in rows.chunks_exact_mut(width).zip(samples) {
        let of_sample = &of_samples[*sample as usize * width..][..width];
        row.iter_mut().zip(of_sample).for_each(|(to, value)| *to += value);
    }
}

/// Sums the rows of each sample.
pub(super) fn sum_by_sample(to: &mut [f32], rows: &[f32], samples: &[u32], width: usize) {
    to.fill(0.0);
    sum_rows_by(to, rows, samples.iter().map(|sample| *sample as usize), width);
}

/// The scalar product, in a fixed order.
#[inline(always)]
pub(super) fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut parts = [0.0; WIDTH];
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<WIDTH>(), b.as_chunks::<WIDTH>());
    for (a, b) in a.iter().zip(b) {
        for i in 0..WIDTH {
            parts[i] += a[i] * b[i];
        }
    }
    let rest: f32 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    sum(parts) + rest
}
