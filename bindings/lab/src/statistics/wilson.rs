//! The interval of a share, from few trials.

/// Standard deviations on either side of a 95 % interval.
const NORMAL_95: f64 = 1.959_963_984_540_054;

/// The 95 % interval of the probability to win, from the wins among some episodes (Wilson, 1927). Unlike the
/// interval of the standard error, it is right near 0 and 1, where that has no width. Without episodes it is
/// 0 to 1.
pub fn wilson_interval(wins: usize, episodes: usize) -> [f64; 2] {
    let (n, square) = (episodes as f64, NORMAL_95 * NORMAL_95);
    let share = wins as f64 / n.max(1.0);
    let middle = share * n + square / 2.0;
    let half = NORMAL_95 * (share * (1.0 - share) * n + square / 4.0).sqrt();
    [-half, half].map(|half| ((middle + half) / (n + square)).clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The values of `statsmodels.stats.proportion.proportion_confint(method="wilson")`.
    #[test]
    fn intervals_of_known_numbers() {
        let check = |wins, episodes, expected: [f64; 2]| {
            let found = wilson_interval(wins, episodes);
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 5e-7), "{found:?} {expected:?}");
        };
        check(0, 0, [0.0, 1.0]);
        check(0, 10, [0.0, 0.2775328]);
        check(5, 10, [0.2365931, 0.7634069]);
        check(32, 32, [0.8928208, 1.0]);
        check(188, 200, [0.8980683, 0.9653478]);
        check(189, 200, [0.9042130, 0.9690147]);
    }
}
