//! Minimum, maximum and floor in one or two instructions.
//!
//! `f64::min` and `f64::max` must treat NaN specially, and on baseline x86-64 `f64::floor` is a call into the
//! C library. The simulator compares no NaN, and these functions run for every unit and tick, so they do
//! without. For all other values they give the bits of the standard functions, except that of 0.0 and -0.0
//! both count as equal and the second argument is returned.

/// The lesser of two numbers; the second if they are equal or one is NaN.
#[inline]
pub(crate) fn min<T: PartialOrd>(a: T, b: T) -> T {
    if a < b { a } else { b }
}

/// The greater of two numbers; the second if they are equal or one is NaN.
#[inline]
pub(crate) fn max<T: PartialOrd>(a: T, b: T) -> T {
    if a > b { a } else { b }
}

/// The greatest integer that is at most `x`, saturated to the range of `i64`; 0 for NaN.
#[inline]
pub(crate) fn floor(x: f64) -> i64 {
    // `as` truncates towards zero and saturates, so it exceeds x exactly for negative fractions.
    let truncated = x as i64;
    if truncated as f64 > x { truncated.saturating_sub(1) } else { truncated }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floor_is_that_of_the_standard_library() {
        for x in [0.0, -0.0, 0.5, -0.5, 1.0, -1.0, 31.999, -1e-300, 1e15 + 0.5, -1e15 - 0.5] {
            assert_eq!(floor(x), x.floor() as i64, "{x}");
        }
        assert_eq!([floor(f64::NAN), floor(f64::INFINITY), floor(-1e300)], [0, i64::MAX, i64::MIN]);
    }

    #[test]
    fn of_equal_numbers_the_second_is_returned() {
        assert_eq!([min(1.0, 2.0), min(2.0, 1.0), max(1.0, 2.0), max(2.0, 1.0)], [1.0, 1.0, 2.0, 2.0]);
        assert!(min(-0.0_f64, 0.0).is_sign_positive() && max(0.0_f64, -0.0).is_sign_negative());
        assert!(min(1.0, f64::NAN).is_nan() && max(f64::NAN, 1.0) == 1.0);
    }
}
