//! Gradient clipping and Adam.
//!
//! Adam (Kingma and Ba, 2015, algorithm 1) keeps moving averages of the gradient and of its square,
//! m = 0.9 m + 0.1 g and v = 0.999 v + 0.001 g². Both start at 0, so after t steps they are too small by the
//! factors 1 - 0.9^t and 1 - 0.999^t, which are divided out. A step is -lr m / (√v + eps).

use crate::math::{sum_of_squares, vectorised};

const BETA_1: f64 = 0.9;
const BETA_2: f64 = 0.999;

/// The state of an optimiser.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Adam {
    /// Steps made.
    pub steps: u64,
    /// Moving average of the gradient.
    pub mean: Vec<f32>,
    /// Moving average of its square.
    pub square: Vec<f32>,
}

impl Adam {
    pub fn new(n_params: usize) -> Adam {
        Adam { steps: 0, mean: vec![0.0; n_params], square: vec![0.0; n_params] }
    }

    /// Changes the parameters by one step against the gradient.
    pub fn step(&mut self, params: &mut [f32], gradient: &[f32], lr: f64, eps: f64) {
        self.steps += 1;
        let steps = self.steps.min(1 << 20) as i32; // by then, the powers are 0
        let step_size = (lr / (1.0 - BETA_1.powi(steps))) as f32;
        let correction = (1.0 / (1.0 - BETA_2.powi(steps))).sqrt() as f32;
        let (keep_1, keep_2, eps) = (BETA_1 as f32, BETA_2 as f32, eps as f32);
        let (new_1, new_2) = ((1.0 - BETA_1) as f32, (1.0 - BETA_2) as f32);
        let moments = self.mean.iter_mut().zip(&mut self.square);
        let all = params.iter_mut().zip(gradient).zip(moments);
        vectorised(
            #[inline(always)]
            || {
                all.for_each(|((param, g), (mean, square))| {
                    *mean = keep_1 * *mean + new_1 * g;
                    *square = keep_2 * *square + new_2 * (g * g);
                    *param -= step_size * *mean / (square.sqrt() * correction + eps);
                });
            },
        );
    }
}

/// Shortens the gradient to length `max`, if it is longer, and returns the length that it had.
pub(crate) fn clip(gradient: &mut [f32], max: f64) -> f64 {
    let norm = sum_of_squares(gradient).sqrt();
    if norm > max {
        let factor = (max / norm) as f32;
        vectorised(
            #[inline(always)]
            || gradient.iter_mut().for_each(|g| *g *= factor),
        );
    }
    norm
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three steps of the published algorithm on f(x) = x², in f64.
    #[test]
    fn adam_equals_the_published_algorithm() {
        let (mut x, mut m, mut v) = (3.0f64, 0.0, 0.0);
        let (mut params, mut adam) = (vec![3.0f32], Adam::new(1));
        for t in 1..=3 {
            let g = 2.0 * x;
            m = 0.9 * m + 0.1 * g;
            v = 0.999 * v + 0.001 * g * g;
            let (m_hat, v_hat) = (m / (1.0 - 0.9f64.powi(t)), v / (1.0 - 0.999f64.powi(t)));
            x -= 0.1 * m_hat / (v_hat.sqrt() + 1e-5);
            let gradient = [2.0 * params[0]];
            adam.step(&mut params, &gradient, 0.1, 1e-5);
            assert!((f64::from(params[0]) - x).abs() < 1e-6, "step {t}: {} {x}", params[0]);
        }
    }

    #[test]
    fn long_gradients_are_shortened_and_short_ones_are_not() {
        let mut gradient = [3.0, 4.0];
        assert_eq!(clip(&mut gradient, 5.0), 5.0);
        assert_eq!(gradient, [3.0, 4.0]);
        assert_eq!(clip(&mut gradient, 1.0), 5.0);
        assert!((gradient[0] - 0.6).abs() < 1e-6 && (gradient[1] - 0.8).abs() < 1e-6);
        assert!(clip(&mut [f32::NAN], 1.0).is_nan());
    }
}
