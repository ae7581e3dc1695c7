//! Compared values, and which of them differ.

use std::collections::BTreeMap;
use std::fmt;

/// Counts of compared values, by what they are.
#[derive(Debug, Default)]
pub struct Tally {
    n_values: usize,
    differences: BTreeMap<&'static str, usize>,
}

impl Tally {
    /// Compares values; floats by their bits, but for the sign of zero.
    pub fn compare<T: PartialEq>(&mut self, what: &'static str, ours: &[T], recorded: &[T]) {
        self.compare_by(what, ours, recorded, |a, b| a == b);
    }

    /// Compares values by a rule.
    pub fn compare_by<T>(
        &mut self,
        what: &'static str,
        ours: &[T],
        recorded: &[T],
        is_same: impl Fn(&T, &T) -> bool,
    ) {
        let n_pairs = ours.len().min(recorded.len());
        let n_all = ours.len().max(recorded.len());
        let n_same = ours.iter().zip(recorded).filter(|(a, b)| is_same(a, b)).count();
        self.n_values += n_all;
        if n_same < n_all {
            *self.differences.entry(what).or_default() += n_all - n_pairs + (n_pairs - n_same);
        }
    }

    pub fn add(&mut self, other: &Tally) {
        self.n_values += other.n_values;
        for (what, n) in &other.differences {
            *self.differences.entry(what).or_default() += n;
        }
    }

    pub fn n_values(&self) -> usize {
        self.n_values
    }

    pub fn n_different(&self) -> usize {
        self.differences.values().sum()
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parts: Vec<String> = self.differences.iter().map(|(what, n)| format!("{what} {n}")).collect();
        write!(f, "{} of {} values differ: {}", self.n_different(), self.n_values, parts.join(", "))
    }
}
