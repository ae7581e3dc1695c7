//! Element-wise arithmetic that the compiler turns into vector instructions.
//!
//! A loop over a slice is vectorised if its steps are independent; a sum of floats is not, because its order
//! would change. So sums are kept in [`WIDTH`] partial sums, and rows of outputs are padded to a multiple of
//! [`WIDTH`]. [`vectorised`] compiles a closure for the widest vectors of the CPU; the closure and every
//! function called in it must be `#[inline(always)]`, or they are compiled for any CPU. The results do not
//! depend on the width: the order of every sum is fixed here, and no multiplication is fused with an
//! addition.

/// Partial sums of a reduction, and the unit of padding.
pub(crate) const WIDTH: usize = 8;

/// Runs `work`, compiled for the widest vectors of the CPU.
#[inline]
pub(crate) fn vectorised<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}

/// The exponential of `x`, to about 1e-7 relative; `x` is limited to -87..=88, where the result is a normal
/// number.
///
/// With n = round(x / ln 2) and r = x - n ln 2, exp(x) = 2^n exp(r). |r| is at most 0.35, where seven terms
/// of the Taylor series suffice. ln 2 is subtracted in two parts, the first of which has so few bits that n
/// times it is exact. Adding and subtracting 1.5 * 2^23 rounds to an integer, and leaves it in the low bits.
#[inline(always)]
pub(crate) fn exp(x: f32) -> f32 {
    const ROUND: f32 = 12_582_912.0; // 1.5 * 2^23
    const LN_2_HIGH: f32 = 0.693_359_4; // 355 / 512
    const LN_2_LOW: f32 = -2.121_944_4e-4; // ln 2 - 355 / 512
    let x = x.clamp(-87.0, 88.0);
    let shifted = x * std::f32::consts::LOG2_E + ROUND;
    let n = shifted - ROUND;
    let r = (x - n * LN_2_HIGH) - n * LN_2_LOW;
    let series = 1.0 / 720.0 + r * (1.0 / 5040.0);
    let series = 1.0 / 24.0 + r * (1.0 / 120.0 + r * series);
    let series = 1.0 + r * (1.0 + r * (0.5 + r * (1.0 / 6.0 + r * series)));
    // The exponent of 2^n: n is in the low bits of `shifted`, and the shift drops all others.
    let power = f32::from_bits((shifted.to_bits().wrapping_add(127)) << 23);
    series * power
}

/// The hyperbolic tangent of `x`: 1 - 2 / (exp(2x) + 1).
#[inline(always)]
pub(crate) fn tanh(x: f32) -> f32 {
    1.0 - 2.0 / (exp(2.0 * x) + 1.0)
}

/// The sum of partial sums, in a fixed order.
#[inline(always)]
pub(crate) fn sum(parts: [f32; WIDTH]) -> f32 {
    let [a, b, c, d, e, f, g, h] = parts;
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}

/// The sum of squares, in f64 and in a fixed order.
pub(crate) fn sum_of_squares(values: &[f32]) -> f64 {
    vectorised(
        #[inline(always)]
        || {
            let mut parts = [0.0f64; WIDTH];
            let square = |value: f32| f64::from(value) * f64::from(value);
            let (chunks, rest) = values.as_chunks::<WIDTH>();
            for chunk in chunks {
                for i in 0..WIDTH {
                    parts[i] += square(chunk[i]);
                }
            }
            parts.iter().sum::<f64>() + rest.iter().map(|value| square(*value)).sum::<f64>()
        },
    )
}

/// Adds `values` to `to`, element by element.
pub(crate) fn add(to: &mut [f32], values: &[f32]) {
    vectorised(
        #[inline(always)]
        || to.iter_mut().zip(values).for_each(|(to, value)| *to += value),
    );
}

/// So many zeros, in the same memory.
pub(crate) fn zeros<T: Clone + Default>(values: &mut Vec<T>, len: usize) {
    values.clear();
    values.resize(len, T::default());
}

/// Mean and standard deviation in f64; (0, 1) without values.
pub(crate) fn mean_and_deviation(values: impl Iterator<Item = f32> + Clone) -> (f64, f64) {
    let count = values.clone().count().max(1) as f64;
    let mean = values.clone().map(f64::from).sum::<f64>() / count;
    let variance = values.map(|value| (f64::from(value) - mean).powi(2)).sum::<f64>() / count;
    (mean, if variance > 0.0 { variance.sqrt() } else { 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_and_tanh_are_accurate() {
        for i in -8700..8800 {
            let x = i as f32 / 100.0 + 0.001;
            let expected = f64::from(x).exp();
            let error = (f64::from(exp(x)) - expected).abs() / expected;
            assert!(error < 3e-7, "exp({x}): {error}");
            let error = (f64::from(tanh(x)) - f64::from(x).tanh()).abs();
            assert!(error < 3e-7, "tanh({x}): {error}");
        }
        assert_eq!([exp(0.0), exp(-1e30), tanh(1e30)], [1.0, exp(-87.0), 1.0]);
    }

    #[test]
    fn sums_are_sums() {
        let values: Vec<f32> = (1..=19).map(|i| i as f32).collect();
        assert_eq!(sum_of_squares(&values), 19.0 * 20.0 * 39.0 / 6.0);
        assert_eq!(sum([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]), 36.0);
        assert_eq!(mean_and_deviation([1.0, 3.0].into_iter()), (2.0, 1.0));
        assert_eq!(mean_and_deviation([2.0, 2.0].into_iter()), (2.0, 1.0));
        assert_eq!(mean_and_deviation(std::iter::empty()), (0.0, 1.0));
    }
}
