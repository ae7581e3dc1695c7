//! The result of one evaluation.

use crate::rollout::Episode;
use serde::{Deserialize, Serialize};

/// Means of the episodes with one kind of actions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Share of won episodes.
    pub win_rate: f64,
    /// Mean of the episodes' sums of rewards.
    pub mean_return: f64,
    /// Mean number of steps.
    pub mean_length: f64,
}

impl Summary {
    /// Of these episodes.
    pub fn of(episodes: &[Episode]) -> Summary {
        let mean = |value: &dyn Fn(&Episode) -> f64| {
            episodes.iter().map(value).sum::<f64>() / episodes.len().max(1) as f64
        };
        Summary {
            win_rate: mean(&|episode| f64::from(u8::from(episode.won))),
            mean_return: mean(&|episode| f64::from(episode.episode_return)),
            mean_length: mean(&|episode| f64::from(episode.length)),
        }
    }
}

/// A row of `evaluations.csv`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EvaluationRow {
    /// The step count, the same for every seed.
    pub steps: u64,
    /// Steps of training that the weights were learnt from, at least `steps`.
    pub trained_steps: u64,
    /// Updates of the same.
    pub updates: u64,
    /// With the most probable actions.
    pub greedy: Summary,
    /// With actions that are drawn.
    pub sampled: Summary,
    /// Seconds of training until then, without evaluations.
    pub seconds: f64,
    /// Processor time of the same.
    pub cpu_seconds: f64,
}

impl EvaluationRow {
    /// The columns of the file.
    pub const COLUMNS: [&str; 11] = [
        "steps",
        "trained_steps",
        "updates",
        "greedy_win_rate",
        "greedy_mean_return",
        "greedy_mean_length",
        "sampled_win_rate",
        "sampled_mean_return",
        "sampled_mean_length",
        "seconds",
        "cpu_seconds",
    ];

    /// Names and values of what was measured, as in the logs.
    pub fn values(&self) -> [(&'static str, f64); 8] {
        let EvaluationRow { greedy, sampled, .. } = self;
        let values = [
            greedy.win_rate,
            greedy.mean_return,
            greedy.mean_length,
            sampled.win_rate,
            sampled.mean_return,
            sampled.mean_length,
            self.seconds,
            self.cpu_seconds,
        ];
        std::array::from_fn(|i| (Self::COLUMNS[i + 3], values[i]))
    }

    /// The line of the file.
    pub fn line(&self) -> String {
        let counts = [self.steps, self.trained_steps, self.updates].map(|count| count.to_string());
        let values = self.values().map(|(_, value)| value.to_string());
        counts.into_iter().chain(values).collect::<Vec<_>>().join(",") + "\n"
    }

    /// What a line says; `None` if it is none of this file.
    pub(crate) fn parse(line: &str) -> Option<EvaluationRow> {
        let fields: Vec<&str> = line.trim_end().split(',').collect();
        let (counts, values) = fields.split_at_checked(3)?;
        let counts: Vec<u64> = counts.iter().map(|field| field.parse().ok()).collect::<Option<_>>()?;
        // What is no number would be the best of all, and is none in JSON.
        let finite = |field: &&str| field.parse().ok().filter(|value: &f64| value.is_finite());
        let values: Vec<f64> = values.iter().map(finite).collect::<Option<_>>()?;
        let [steps, trained_steps, updates] = counts[..] else { return None };
        let &[a, b, c, d, e, f, seconds, cpu_seconds] = &values[..] else { return None };
        let greedy = Summary { win_rate: a, mean_return: b, mean_length: c };
        let sampled = Summary { win_rate: d, mean_return: e, mean_length: f };
        Some(EvaluationRow { steps, trained_steps, updates, greedy, sampled, seconds, cpu_seconds })
    }

    /// The best of the rows: by the greedy win rate, then by the sampled one, then by the returns; the newest
    /// of equal ones.
    pub fn best(rows: &[EvaluationRow]) -> Option<&EvaluationRow> {
        let merit = |row: &EvaluationRow| {
            let mean_return = row.greedy.mean_return + row.sampled.mean_return;
            [row.greedy.win_rate, row.sampled.win_rate, mean_return]
        };
        rows.iter().max_by(|a, b| {
            let pairs = merit(a).into_iter().zip(merit(b));
            pairs.fold(std::cmp::Ordering::Equal, |order, (a, b)| order.then(a.total_cmp(&b)))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(steps: u64, greedy: f64, sampled: f64, mean_return: f64) -> EvaluationRow {
        let summary = |win_rate| Summary { win_rate, mean_return, mean_length: 20.0 / 3.0 };
        let (greedy, sampled) = (summary(greedy), summary(sampled));
        let trained_steps = steps + 7;
        EvaluationRow { steps, trained_steps, updates: 3, greedy, sampled, seconds: 0.1, cpu_seconds: 0.3 }
    }

    #[test]
    fn a_line_is_read_to_the_bit() {
        let row = row(1000, 1.0 / 3.0, 0.1 + 0.2, -1e-7);
        assert_eq!(EvaluationRow::parse(&row.line()), Some(row));
        assert_eq!(EvaluationRow::parse(&EvaluationRow::COLUMNS.join(",")), None);
        assert_eq!(EvaluationRow::parse("1,2,3,4"), None);
        for value in ["nan", "NaN", "inf", "-inf", "", "0.1.2"] {
            let changed = row.line().replacen("-0.0000001", value, 1);
            assert_ne!(changed, row.line());
            assert_eq!(EvaluationRow::parse(&changed), None, "{value}");
        }
    }

    #[test]
    fn the_newest_of_the_best_is_kept() {
        let check = |rows: &[EvaluationRow], best: u64| {
            assert_eq!(EvaluationRow::best(rows).map(|row| row.steps), Some(best));
        };
        check(&[row(0, 0.5, 0.9, 9.0), row(1, 0.6, 0.1, 1.0)], 1);
        check(&[row(0, 0.5, 0.9, 9.0), row(1, 0.5, 0.8, 10.0)], 0);
        check(&[row(0, 0.5, 0.9, 9.0), row(1, 0.5, 0.9, 9.0), row(2, 0.5, 0.9, 8.0)], 1);
        assert_eq!(EvaluationRow::best(&[]), None);
    }
}
