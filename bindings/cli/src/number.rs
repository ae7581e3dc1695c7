//! Whole numbers in the arguments: counts and seeds, also as people write large ones.

use std::ops::RangeInclusive;

/// An argument is no whole number of the range.
#[derive(Debug, thiserror::Error)]
#[error("must be a whole number between {min} and {max}, as 2000000, 2_000_000, 2e6 or 2M")]
pub(super) struct InvalidNumber {
    min: u64,
    max: u64,
}

/// A parser of the numbers in `range`. Options that use it set `allow_negative_numbers`, so that clap takes
/// `-1` for a value and the error names the option and the range, instead of an unknown option `-1`.
pub(super) fn whole<T>(
    range: RangeInclusive<T>,
) -> impl Fn(&str) -> Result<T, InvalidNumber> + Clone + Send + Sync + 'static
where
    T: Copy + PartialOrd + TryFrom<u64> + TryInto<u64> + Send + Sync + 'static,
{
    move |text| {
        let value = parse(text).and_then(|value| T::try_from(value).ok());
        let bound = |bound: T| bound.try_into().unwrap_or(u64::MAX);
        let invalid = || InvalidNumber { min: bound(*range.start()), max: bound(*range.end()) };
        value.filter(|value| range.contains(value)).ok_or_else(invalid)
    }
}

/// The number of a text of decimal digits, which may have underscores, a fraction, an exponent and a suffix
/// k, M or G, if it is a whole number. It is exact, which f64 is not for large seeds.
fn parse(text: &str) -> Option<u64> {
    const SUFFIXES: [(char, u32); 4] = [('k', 3), ('K', 3), ('M', 6), ('G', 9)];
    let suffix = SUFFIXES.iter().find_map(|&(suffix, power)| Some((text.strip_suffix(suffix)?, power)));
    let (text, suffix_power) = suffix.unwrap_or((text, 0));
    let (mantissa, exponent) = text.split_once(['e', 'E']).unwrap_or((text, "0"));
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let fraction = fraction.trim_end_matches('0');
    if !whole.starts_with(|c: char| c.is_ascii_digit()) || whole.ends_with('_') {
        return None;
    }
    let power = exponent.parse::<u32>().ok()?.checked_add(suffix_power)?;
    let power = power.checked_sub(u32::try_from(fraction.len()).ok()?)?;
    let digits = format!("{}{fraction}", whole.replace('_', ""));
    if !digits.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    digits.parse::<u64>().ok()?.checked_mul(10_u64.checked_pow(power)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `--steps 1e6`, as papers write it, was "invalid digit found in string".
    #[test]
    fn large_numbers_are_read_as_people_write_them() {
        for (text, expected) in [
            ("0", 0),
            ("1e6", 1_000_000),
            ("1E+6", 1_000_000),
            ("500_000", 500_000),
            ("2M", 2_000_000),
            ("1.5k", 1500),
            ("2.50e1", 25),
            ("18446744073709551615", u64::MAX),
        ] {
            assert_eq!(parse(text), Some(expected), "{text}");
        }
        for text in
            ["", "-1", "+1", "1.5", "1e-3", "e6", "M", "_1", "1_", "1e40", "1 000", "0x10", "inf", "1.2_5M"]
        {
            assert_eq!(parse(text), None, "{text}");
        }
    }

    #[test]
    fn errors_name_the_range() {
        let error = whole(1..=1024_usize)("-5").expect_err("negative").to_string();
        assert!(error.starts_with("must be a whole number between 1 and 1024"), "{error}");
        assert!(whole(0..=u16::MAX)("70000").is_err());
    }
}
