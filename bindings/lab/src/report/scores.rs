//! Scores: one number per run, in the strata of the tasks.

use super::{AlgorithmRuns, Benchmark};
use crate::statistics::Scores;
use smaclite_learn::{Choice, Episode, Summary};
use std::collections::BTreeMap;

/// What is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Metric {
    /// The share of won episodes.
    WinRate,
    /// The mean return, where 0 is the lowest and 1 the highest return of all episodes of the task, with the
    /// actions that are compared, that any algorithm was evaluated with (min-max normalisation). These are
    /// the episodes of `metrics.json`, from which marl-eval computes the same numbers.
    Return,
}

impl Metric {
    /// In the order of the files.
    pub const ALL: [Metric; 2] = [Metric::WinRate, Metric::Return];

    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Metric::WinRate => "win_rate",
            Metric::Return => "normalised_return",
        }
    }
}

/// Computes scores of runs.
pub(super) struct Scorer {
    pub actions: Choice,
    /// The lowest and the highest return of every task.
    ranges: BTreeMap<String, [f64; 2]>,
}

impl Scorer {
    pub fn new(benchmark: &Benchmark, actions: Choice) -> Scorer {
        let range = |task: &str| {
            let episodes = benchmark.runs_of(task).flat_map(|run| {
                let evaluations = run.evaluations.iter().flat_map(|played| played.episodes(actions));
                evaluations.chain(run.final_episodes(actions))
            });
            let returns = episodes.map(|episode| f64::from(episode.episode_return));
            let widest = [f64::INFINITY, f64::NEG_INFINITY];
            returns.fold(widest, |[low, high], value| [low.min(value), high.max(value)])
        };
        let ranges = benchmark.tasks().into_iter().map(|task| (task.to_owned(), range(task))).collect();
        Scorer { actions, ranges }
    }

    /// Of some episodes of a task.
    fn score(&self, metric: Metric, task: &str, episodes: &[Episode]) -> f64 {
        let Summary { win_rate, mean_return, .. } = Summary::of(episodes);
        let [low, high] = self.ranges[task];
        match metric {
            Metric::WinRate => win_rate,
            Metric::Return if high > low => (mean_return - low) / (high - low),
            Metric::Return => 0.0,
        }
    }

    /// Of the final episodes, by task.
    pub fn final_scores(&self, algorithm: &AlgorithmRuns, tasks: &[&str], metric: Metric) -> Scores {
        let of_task = |task: &&str| {
            let runs = algorithm.tasks[*task].iter();
            runs.map(|run| self.score(metric, task, run.final_episodes(self.actions))).collect()
        };
        tasks.iter().map(of_task).collect()
    }

    /// Of the evaluations at a step count, which all runs have.
    pub fn scores_at(&self, algorithm: &AlgorithmRuns, tasks: &[&str], metric: Metric, steps: u64) -> Scores {
        let of_task = |task: &&str| {
            let played = algorithm.tasks[*task].iter().flat_map(|run| &run.evaluations);
            let there = played.filter(|played| played.row.steps == steps);
            there.map(|played| self.score(metric, task, played.episodes(self.actions))).collect()
        };
        tasks.iter().map(of_task).collect()
    }
}
