//! Numbers that summarise the scores of an algorithm.

use super::Scores;

/// The mean of the middle half of all scores: a quarter of them, rounded down, is left out at either end. It
/// depends less on single runs than the mean, and on more of them than the median. NaN if there are none.
pub fn interquartile_mean(scores: &Scores) -> f64 {
    let mut all: Vec<f64> = scores.iter().flatten().copied().collect();
    all.sort_unstable_by(f64::total_cmp);
    let cut = all.len() / 4;
    let middle = &all[cut..all.len() - cut];
    middle.iter().sum::<f64>() / middle.len() as f64
}

/// The share of runs whose score is above each of the thresholds.
pub fn profile(scores: &Scores, thresholds: &[f64]) -> Vec<f64> {
    let mut all: Vec<f64> = scores.iter().flatten().copied().collect();
    all.sort_unstable_by(f64::total_cmp);
    let above = |threshold: &f64| all.len() - all.partition_point(|score| score <= threshold);
    thresholds.iter().map(|threshold| above(threshold) as f64 / all.len() as f64).collect()
}

/// The probability that a run of one algorithm is better than a run of another on the same task, which is
/// drawn at random: the mean over tasks of the share of pairs of runs in which the score of the first is
/// higher. An equal pair counts as a half (the statistic of Mann and Whitney, 1947).
///
/// Both have the same tasks, in the same order.
pub fn probability_of_improvement(scores: &Scores, of_other: &Scores) -> f64 {
    let on_task = |(ours, theirs): (&Vec<f64>, &Vec<f64>)| {
        let points = |ours: &f64| -> f64 {
            let half = |theirs: &f64| f64::from(u8::from(ours > theirs) + u8::from(ours >= theirs)) / 2.0;
            theirs.iter().map(half).sum()
        };
        ours.iter().map(points).sum::<f64>() / (ours.len() * theirs.len()) as f64
    };
    scores.iter().zip(of_other).map(on_task).sum::<f64>() / scores.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_is_cut_at_either_end() {
        let check = |scores: &[f64], expected: f64| {
            assert_eq!(interquartile_mean(&vec![scores.to_vec()]), expected, "{scores:?}");
        };
        check(&[7.0], 7.0);
        check(&[1.0, 2.0, 6.0], 3.0);
        check(&[-100.0, 1.0, 2.0, 100.0], 1.5);
        check(&[5.0, 1.0, 3.0, 2.0, 4.0], 3.0);
        check(&[0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 9.0, 9.0, 9.0, 9.0], 22.0 / 6.0);
        assert_eq!(interquartile_mean(&vec![vec![1.0, 100.0], vec![-100.0, 2.0]]), 1.5);
        assert!(interquartile_mean(&Scores::new()).is_nan());
    }

    #[test]
    fn a_profile_falls_from_all_to_none() {
        let scores = vec![vec![0.0, 0.5], vec![0.5, 1.0]];
        assert_eq!(profile(&scores, &[-0.1, 0.0, 0.49, 0.5, 1.0]), [1.0, 0.75, 0.75, 0.25, 0.0]);
    }

    #[test]
    fn improvement_is_the_share_of_pairs() {
        let check = |ours: &[f64], theirs: &[f64], expected: f64| {
            let (ours, theirs) = (vec![ours.to_vec()], vec![theirs.to_vec()]);
            assert_eq!(probability_of_improvement(&ours, &theirs), expected);
            assert_eq!(probability_of_improvement(&theirs, &ours), 1.0 - expected);
        };
        check(&[2.0, 3.0], &[0.0, 1.0, 1.5], 1.0);
        check(&[1.0, 3.0], &[1.0, 2.0], 0.625);
        check(&[1.0, 1.0], &[1.0], 0.5);
        let (ours, theirs) = (vec![vec![2.0], vec![1.0]], vec![vec![1.0], vec![1.0]]);
        assert_eq!(probability_of_improvement(&ours, &theirs), 0.75);
    }
}
