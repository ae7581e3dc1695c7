//! Intervals by the stratified bootstrap: the runs of every task are drawn again, with replacement, and the
//! statistic is computed of what was drawn. The 2.5th and the 97.5th percentile of its values are the 95 %
//! interval (Efron, 1979). It says how the statistic would vary with other seeds on the same tasks.

use super::Scores;
use rand::Rng;
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use smaclite_learn::random::{Purpose, generator};

/// The percentiles of a 95 % interval.
const PERCENTILES: [f64; 2] = [0.025, 0.975];

/// A statistic and its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// Of the scores.
    pub value: f64,
    /// The lower end.
    pub low: f64,
    /// The upper end.
    pub high: f64,
}

/// A statistic of the scores of one or several algorithms, whose runs are drawn independently. Equal seeds
/// give equal intervals.
pub fn estimate(
    samples: &[&Scores],
    statistic: impl Fn(&[&Scores]) -> f64,
    repetitions: usize,
    seed: u64,
) -> Estimate {
    estimates(samples, |samples| vec![statistic(samples)], repetitions, seed)[0]
}

/// The same for several numbers, as those of a profile; the statistic always has equally many.
pub fn estimates(
    samples: &[&Scores],
    statistic: impl Fn(&[&Scores]) -> Vec<f64>,
    repetitions: usize,
    seed: u64,
) -> Vec<Estimate> {
    let values = statistic(samples);
    let mut drawn: Vec<Scores> = samples.iter().map(|scores| (*scores).clone()).collect();
    let mut resampled: Vec<Vec<f64>> = vec![Vec::with_capacity(repetitions); values.len()];
    for repetition in 0..repetitions {
        let mut generator = generator(seed, Purpose::Bootstrap, [repetition as u64, 0]);
        for (scores, drawn) in samples.iter().zip(&mut drawn) {
            draw(scores, drawn, &mut generator);
        }
        let values = statistic(&drawn.iter().collect::<Vec<_>>());
        resampled.iter_mut().zip(values).for_each(|(all, value)| all.push(value));
    }
    let interval = |(value, mut resampled): (f64, Vec<f64>)| {
        resampled.sort_unstable_by(f64::total_cmp);
        let [low, high] = PERCENTILES.map(|share| quantile(&resampled, share).unwrap_or(value));
        Estimate { value, low, high }
    };
    values.into_iter().zip(resampled).map(interval).collect()
}

/// Draws as many runs of every task as it has.
fn draw(scores: &Scores, drawn: &mut Scores, generator: &mut Pcg64Mcg) {
    for (runs, drawn) in scores.iter().zip(drawn) {
        // The high half of a product is a number below `len`; its bias is below 1 in 2^30 for any number of
        // runs.
        let mut index = |len: usize| (((generator.next_u64() >> 32) * len as u64) >> 32) as usize;
        drawn.iter_mut().for_each(|drawn| *drawn = runs[index(runs.len())]);
    }
}

/// Of sorted values, between the two nearest ones by linear interpolation; `None` if there are none.
pub(crate) fn quantile(sorted: &[f64], share: f64) -> Option<f64> {
    let place = share * sorted.len().checked_sub(1)? as f64;
    let (below, part) = (place.floor() as usize, place.fract());
    let above = (below + 1).min(sorted.len() - 1);
    Some(sorted[below] + (sorted[above] - sorted[below]) * part)
}

#[cfg(test)]
mod tests {
    use super::super::interquartile_mean;
    use super::*;
    use smaclite_learn::random::normal;

    fn mean(samples: &[&Scores]) -> f64 {
        let all = || samples[0].iter().flatten();
        all().sum::<f64>() / all().count() as f64
    }

    #[test]
    fn quantiles_lie_between_neighbours() {
        let sorted = [0.0, 1.0, 2.0, 4.0];
        let found = [0.0, 0.5, 1.0, 0.9].map(|share| quantile(&sorted, share).unwrap());
        assert!(found.iter().zip([0.0, 1.5, 4.0, 3.4]).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
        assert_eq!(quantile(&[], 0.5), None);
    }

    #[test]
    fn equal_seeds_give_equal_intervals() {
        let scores = vec![vec![0.1, 0.7, 0.3, 0.9], vec![0.5, 0.2]];
        let of_seed = |seed| estimate(&[&scores], |s| interquartile_mean(s[0]), 200, seed);
        assert_eq!(of_seed(1), of_seed(1));
        assert_ne!(of_seed(1), of_seed(2));
        assert_eq!(of_seed(1).value, of_seed(2).value);
        let constant = vec![vec![0.5; 10]];
        let of_constant = estimate(&[&constant], mean, 100, 1);
        assert_eq!((of_constant.low, of_constant.high), (0.5, 0.5));
    }

    /// Tasks of different levels: if runs were drawn across tasks, the interval would be as wide as their
    /// distance.
    #[test]
    fn runs_are_drawn_within_their_task() {
        let scores = vec![vec![0.0; 10], vec![10.0; 10]];
        let drawn = estimate(&[&scores], mean, 500, 1);
        assert_eq!((drawn.low, drawn.high), (5.0, 5.0));
    }

    /// Of the mean of normal numbers, the interval is that of their standard error: ± 1.96 / sqrt(400).
    #[test]
    fn the_interval_of_a_mean_is_that_of_its_standard_error() {
        let mut numbers = generator(5, Purpose::Weights, [0, 0]);
        let scores = vec![(0..400).map(|_| normal(&mut numbers)).collect::<Vec<f64>>()];
        let drawn = estimate(&[&scores], mean, 20_000, 3);
        let deviation = (scores[0].iter().map(|x| (x - drawn.value).powi(2)).sum::<f64>() / 400.0).sqrt();
        let half = 1.96 * deviation / 20.0;
        for (found, expected) in [(drawn.low, drawn.value - half), (drawn.high, drawn.value + half)] {
            assert!((found - expected).abs() < 0.03 * half, "{drawn:?} {expected}");
        }
    }
}
