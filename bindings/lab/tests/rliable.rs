//! The statistics on data that rliable (Agarwal et al., 2021) summarised: `rliable/record.py` wrote scores
//! and its numbers. Values are equal; ends of intervals are those of other draws.

use serde::Deserialize;
use smaclite_lab::{
    Estimate, Scores, estimate, estimates, interquartile_mean, probability_of_improvement, profile,
};
use std::collections::BTreeMap;

/// How far an end may be from rliable's, as a share of the width. With 20,000 and 5,000 repetitions, the
/// standard errors of an end are 0.5 % and 1 % of it.
const DRAWS: f64 = 0.05;

/// Value, lower and upper end.
type Recorded = [f64; 3];

#[derive(Deserialize)]
struct File {
    scores: BTreeMap<String, Scores>,
    thresholds: Vec<f64>,
    interquartile_means: BTreeMap<String, Recorded>,
    profiles: BTreeMap<String, Vec<Recorded>>,
    improvement: Recorded,
}

fn recorded() -> File {
    serde_json::from_str(include_str!("rliable/recorded.json")).unwrap()
}

/// `step`: by how much the statistic changes at least, if it changes.
fn check(what: &str, found: Estimate, expected: Recorded, step: f64) {
    let [value, low, high] = expected;
    assert!((found.value - value).abs() < 1e-12, "{what}: {found:?}, expected {expected:?}");
    let near = (DRAWS * (high - low)).max(step) + 1e-9;
    for (end, expected_end) in [(found.low, low), (found.high, high)] {
        assert!((end - expected_end).abs() <= near, "{what}: {found:?}, expected {expected:?}");
    }
}

#[test]
fn interquartile_means_are_those_of_rliable() {
    let File { scores, interquartile_means, .. } = recorded();
    for (name, expected) in interquartile_means {
        assert!(expected[1] < expected[2], "an interval with a width");
        let found = estimate(&[&scores[&name]], |samples| interquartile_mean(samples[0]), 20_000, 5);
        check(&name, found, expected, 0.0);
    }
}

#[test]
fn profiles_are_those_of_rliable() {
    let File { scores, thresholds, profiles, .. } = recorded();
    for (name, expected) in profiles {
        let of_scores = |samples: &[&Scores]| profile(samples[0], &thresholds);
        let found = estimates(&[&scores[&name]], of_scores, 5_000, 5);
        assert_eq!(found.len(), expected.len());
        for ((threshold, found), expected) in thresholds.iter().zip(found).zip(expected) {
            check(&format!("{name} above {threshold}"), found, expected, 1.0 / 40.0); // one of 40 runs
        }
    }
}

#[test]
fn the_probability_of_improvement_is_that_of_rliable() {
    let File { scores, improvement, .. } = recorded();
    let of_scores = |samples: &[&Scores]| probability_of_improvement(samples[0], samples[1]);
    let found = estimate(&[&scores["a"], &scores["b"]], of_scores, 5_000, 5);
    assert!(improvement[0] > 0.55, "the first is better: {improvement:?}");
    check("a better than b", found, improvement, 0.0);
}
