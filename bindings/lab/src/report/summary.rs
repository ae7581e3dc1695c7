//! The numbers of a report.

use super::scores::Scorer;
use super::{AlgorithmRuns, Benchmark, Metric};
use crate::statistics::{
    Estimate, Scores, estimate, estimates, interquartile_mean, probability_of_improvement, profile,
};
use smaclite_learn::Choice;

/// Repetitions of the bootstrap for a number in a table.
const REPETITIONS: usize = 20_000;

/// The same for a point of a curve, of which there are many.
const CURVE_REPETITIONS: usize = 2_000;

/// The thresholds of profiles are 0 to 1 in that many steps.
pub const THRESHOLDS: usize = 100;

/// How the interquartile mean of the evaluations changed while an algorithm trained.
#[derive(Clone, Debug)]
pub struct Curve {
    /// The algorithm.
    pub algorithm: String,
    /// The task; `None` for all that are compared.
    pub task: Option<String>,
    /// What is measured.
    pub metric: Metric,
    /// Step counts, and the estimate at each.
    pub points: Vec<(u64, Estimate)>,
}

/// The interquartile mean of the final episodes.
#[derive(Clone, Debug)]
pub struct Aggregate {
    /// The algorithm.
    pub algorithm: String,
    /// The task; `None` for all that are compared.
    pub task: Option<String>,
    /// What is measured.
    pub metric: Metric,
    /// The mean, and its interval.
    pub mean: Estimate,
    /// The lowest score of a run.
    pub worst: f64,
    /// Number of runs.
    pub runs: usize,
}

/// The share of runs whose final score is above a threshold.
#[derive(Clone, Debug)]
pub struct Profile {
    /// The algorithm.
    pub algorithm: String,
    /// What is measured.
    pub metric: Metric,
    /// Thresholds and shares.
    pub points: Vec<(f64, Estimate)>,
}

/// The probability that one algorithm is better than another on a task.
#[derive(Clone, Debug)]
pub struct Improvement {
    /// That is better.
    pub better: String,
    /// Than this one.
    pub than: String,
    /// What is measured.
    pub metric: Metric,
    /// The probability, and its interval.
    pub probability: Estimate,
}

/// The numbers of a benchmark, all with one kind of actions.
#[derive(Clone, Debug)]
pub struct Report {
    /// By algorithm: the curve over all tasks, if there is one, and those of the tasks.
    pub curves: Vec<Curve>,
    /// In the same order.
    pub aggregates: Vec<Aggregate>,
    /// Over the tasks that are compared.
    pub profiles: Vec<Profile>,
    /// Of all pairs, over the same.
    pub improvements: Vec<Improvement>,
}

impl Report {
    /// Computes the numbers. Equal runs and seeds give equal ones.
    pub fn new(benchmark: &Benchmark, actions: Choice, seed: u64) -> Report {
        let scorer = Scorer::new(benchmark, actions);
        let common = benchmark.common_tasks();
        let mut report = Report {
            curves: Vec::new(),
            aggregates: Vec::new(),
            profiles: Vec::new(),
            improvements: Vec::new(),
        };
        let maker = Maker { scorer, seed };
        for metric in Metric::ALL {
            for algorithm in &benchmark.algorithms {
                let all = (!common.is_empty()).then_some(None);
                for task in all.into_iter().chain(algorithm.tasks.keys().map(Some)) {
                    let tasks = task.map_or(common.clone(), |task| vec![task]);
                    report.aggregates.push(maker.aggregate(algorithm, task, &tasks, metric));
                    report.curves.extend(maker.curve(algorithm, task, &tasks, metric));
                }
                if !common.is_empty() {
                    report.profiles.push(maker.profile(algorithm, &common, metric));
                    let others = benchmark.algorithms.iter().filter(|other| other.name != algorithm.name);
                    let against = |other| maker.improvement(algorithm, other, &common, metric);
                    report.improvements.extend(others.map(against));
                }
            }
        }
        report
    }
}

struct Maker {
    scorer: Scorer,
    seed: u64,
}

impl Maker {
    fn interquartile_mean(&self, scores: &Scores, repetitions: usize) -> Estimate {
        estimate(&[scores], |samples| interquartile_mean(samples[0]), repetitions, self.seed)
    }

    fn aggregate(
        &self,
        algorithm: &AlgorithmRuns,
        task: Option<&String>,
        tasks: &[&str],
        metric: Metric,
    ) -> Aggregate {
        let scores = self.scorer.final_scores(algorithm, tasks, metric);
        let all = || scores.iter().flatten().copied();
        Aggregate {
            algorithm: algorithm.name.clone(),
            task: task.cloned(),
            metric,
            mean: self.interquartile_mean(&scores, REPETITIONS),
            worst: all().fold(f64::INFINITY, f64::min),
            runs: all().count(),
        }
    }

    /// At the steps that all runs of these tasks were evaluated at; `None` if these are fewer than two.
    fn curve(
        &self,
        algorithm: &AlgorithmRuns,
        task: Option<&String>,
        tasks: &[&str],
        metric: Metric,
    ) -> Option<Curve> {
        let first_runs = tasks.iter().map(|task| &algorithm.tasks[*task][0]);
        let mut steps: Vec<u64> = first_runs.clone().next()?.steps().collect();
        for run in first_runs {
            steps.retain(|count| run.steps().any(|other| other == *count));
        }
        let point = |steps| {
            let scores = self.scorer.scores_at(algorithm, tasks, metric, steps);
            (steps, self.interquartile_mean(&scores, CURVE_REPETITIONS))
        };
        if steps.len() < 2 {
            return None;
        }
        let points = steps.into_iter().map(point).collect();
        Some(Curve { algorithm: algorithm.name.clone(), task: task.cloned(), metric, points })
    }

    fn profile(&self, algorithm: &AlgorithmRuns, tasks: &[&str], metric: Metric) -> Profile {
        let thresholds: Vec<f64> = (0..=THRESHOLDS).map(|i| i as f64 / THRESHOLDS as f64).collect();
        let scores = self.scorer.final_scores(algorithm, tasks, metric);
        let of_scores = |samples: &[&Scores]| profile(samples[0], &thresholds);
        let shares = estimates(&[&scores], of_scores, CURVE_REPETITIONS, self.seed);
        let points = thresholds.iter().copied().zip(shares).collect();
        Profile { algorithm: algorithm.name.clone(), metric, points }
    }

    /// Of the two directions of a pair one is estimated, and the other is what is left to 1.
    fn improvement(
        &self,
        better: &AlgorithmRuns,
        than: &AlgorithmRuns,
        tasks: &[&str],
        metric: Metric,
    ) -> Improvement {
        if better.name > than.name {
            let Improvement { better, than, probability, .. } = self.improvement(than, better, tasks, metric);
            let Estimate { value, low, high } = probability;
            let probability = Estimate { value: 1.0 - value, low: 1.0 - high, high: 1.0 - low };
            return Improvement { better: than, than: better, metric, probability };
        }
        let [x, y] = [better, than].map(|of| self.scorer.final_scores(of, tasks, metric));
        let of_scores = |samples: &[&Scores]| probability_of_improvement(samples[0], samples[1]);
        let probability = estimate(&[&x, &y], of_scores, REPETITIONS, self.seed);
        Improvement { better: better.name.clone(), than: than.name.clone(), metric, probability }
    }
}
