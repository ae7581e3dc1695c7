//! Whole numbers in the arguments: counts and seeds, also as people write large ones.

use crate::THREADS;
use clap::Args;
use smaclite_pool::PoolOptions;
use std::ops::RangeInclusive;

/// An argument is no whole number of the range.
#[derive(Debug, thiserror::Error)]
#[error("must be a whole number between {min} and {max}{}", if *max < LARGE { "" } else { FORMS })]
pub(super) struct InvalidNumber {
    min: u64,
    max: u64,
}

/// Ranges of numbers that people abbreviate.
const LARGE: u64 = 100_000;
const FORMS: &str = ", such as 20000, 20_000, 2e4 or 20k";

/// A parser of counts.
pub(super) fn count(range: RangeInclusive<usize>) -> impl Parser<usize> {
    whole(range)
}

/// A parser of seeds.
pub(super) fn seed() -> impl Parser<u64> {
    whole(0..=u64::MAX)
}

/// The threads of commands whose results do not depend on them.
#[derive(Args, Clone, Copy)]
pub(super) struct Threads {
    /// Number of threads, 1 to 1024; they change no result [default: the CPU cores available to this process]
    #[arg(long, value_name = "N", value_parser = count(THREADS))]
    threads: Option<usize>,
}

impl Threads {
    pub(super) fn number(self) -> usize {
        self.threads.unwrap_or(PoolOptions::default().threads)
    }
}

/// What clap takes for a parser.
pub(super) trait Parser<T>:
    Fn(&str) -> Result<T, InvalidNumber> + Clone + Send + Sync + 'static
{
}

impl<T, F: Fn(&str) -> Result<T, InvalidNumber> + Clone + Send + Sync + 'static> Parser<T> for F {}

/// A parser of the numbers in `range`. Their type must be that of the argument, which the compiler does not
/// check.
pub(super) fn whole<T>(range: RangeInclusive<T>) -> impl Parser<T>
where
    T: Copy + PartialOrd + TryFrom<u64> + TryInto<u64> + Send + Sync + 'static,
{
    move |text: &str| {
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
            ("007", 7),
            ("1e6", 1_000_000),
            ("1E+6", 1_000_000),
            ("500_000", 500_000),
            ("2M", 2_000_000),
            ("1.5k", 1500),
            ("2.50e1", 25),
            ("3.0", 3),
            ("18446744073709551615", u64::MAX),
        ] {
            assert_eq!(parse(text), Some(expected), "{text}");
        }
        for text in [
            "",
            "-1",
            "+1",
            "1.5",
            "1e-3",
            "e6",
            "M",
            "_1",
            "1_",
            "1e40",
            "1e99999999999",
            "1 000",
            "1,000",
            "0x10",
            "inf",
            "1.2_5M",
            "18446744073709551616",
        ] {
            assert_eq!(parse(text), None, "{text}");
        }
    }

    #[test]
    fn errors_name_the_range_and_how_large_numbers_can_be_written() {
        let error = count(1..=1024)("-5").expect_err("negative").to_string();
        assert_eq!(error, "must be a whole number between 1 and 1024");
        let error = seed()("many").expect_err("no number").to_string();
        assert!(error.ends_with("18446744073709551615, such as 20000, 20_000, 2e4 or 20k"), "{error}");
        assert!(whole(0..=u16::MAX)("70000").is_err());
    }
}
