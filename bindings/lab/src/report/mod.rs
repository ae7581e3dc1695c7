//! A report of runs that were evaluated: what can be said of algorithms from some seeds on some tasks.
//!
//! | file | contents |
//! | --- | --- |
//! | `run` | a run as it is read from its folder |
//! | `algorithm` | the runs of an algorithm, found in folders |
//! | `scores` | one number per run: win rates, and returns between 0 and 1 |
//! | `summary` | curves, interquartile means, profiles, probabilities of improvement |
//! | `time_to_win` | how long the training took until the team won |
//! | `marl_eval` | `metrics.json` |
//!
//! What runs have in common is checked before anything is computed: runs of one algorithm and task must be
//! complete and have evaluations at the same steps, and all runs of a task must play the same battles. What
//! is only unequal, such as numbers of seeds, is noted in the report.

mod algorithm;
mod error;
mod marl_eval;
mod run;
mod scores;
mod summary;
mod time_to_win;

pub use algorithm::AlgorithmRuns;
pub use error::ReportError;
pub use marl_eval::{ENVIRONMENT, marl_eval_json};
pub use run::{EvaluatedRun, PlayedEvaluation};
pub use scores::Metric;
pub use summary::{Aggregate, Curve, Improvement, Profile, Report, THRESHOLDS};
pub use time_to_win::{CRITERION_EPISODES, CRITERION_WIN_RATE, FirstWin, Spread, TimeToWin, time_to_win};

use std::collections::BTreeSet;
use std::path::PathBuf;

/// The runs of all algorithms.
#[derive(Clone, Debug)]
pub struct Benchmark {
    /// In the order in which they were named.
    pub algorithms: Vec<AlgorithmRuns>,
}

impl Benchmark {
    /// Reads the runs in folders. Each folder comes with the name of its algorithm; those of one name are
    /// joined.
    ///
    /// # Errors
    /// If a folder has no runs, or runs are not complete, damaged, or not comparable.
    pub fn read(folders: &[(String, PathBuf)]) -> Result<Benchmark, ReportError> {
        let mut names: Vec<&str> = Vec::new();
        for (name, _) in folders {
            if !names.contains(&name.as_str()) {
                names.push(name);
            }
        }
        let read = |name: &str| {
            let of_name = folders.iter().filter(|(of, _)| of == name);
            let paths: Vec<PathBuf> = of_name.map(|(_, path)| path.clone()).collect();
            AlgorithmRuns::read(name, &paths)
        };
        let algorithms = names.into_iter().map(read).collect::<Result<_, _>>()?;
        let benchmark = Benchmark { algorithms };
        benchmark.check_battles()?;
        Ok(benchmark)
    }

    /// All tasks, by name.
    pub fn tasks(&self) -> Vec<&str> {
        let names = self.algorithms.iter().flat_map(|algorithm| algorithm.tasks.keys());
        names.map(String::as_str).collect::<BTreeSet<_>>().into_iter().collect()
    }

    /// The tasks that all algorithms have runs of: those over which they are compared.
    pub fn common_tasks(&self) -> Vec<&str> {
        let has_all = |task: &&str| self.algorithms.iter().all(|of| of.tasks.contains_key(*task));
        self.tasks().into_iter().filter(has_all).collect()
    }

    /// All runs of a task.
    pub fn runs_of<'a>(&'a self, task: &'a str) -> impl Iterator<Item = &'a EvaluatedRun> {
        self.algorithms.iter().filter_map(move |algorithm| algorithm.tasks.get(task)).flatten()
    }

    /// All runs of a task play the same battles, as far as their descriptions say what these are.
    fn check_battles(&self) -> Result<(), ReportError> {
        for task in self.tasks() {
            // Those of `train` say it in another way than those of other learners.
            for by_program in [true, false] {
                let of_kind = |run: &&EvaluatedRun| run.description.is_some() == by_program;
                let described = self.runs_of(task).filter(of_kind).filter(|run| run.battles.is_some());
                let described: Vec<_> = described.collect();
                let opponents =
                    |run: &EvaluatedRun| run.description.as_ref().map(|run| run.setup.opponents.clone());
                let differ = |a: &EvaluatedRun, b: &EvaluatedRun| {
                    a.battles != b.battles || opponents(a) != opponents(b)
                };
                if let Some(pair) = described.windows(2).find(|pair| differ(pair[0], pair[1])) {
                    let [first, second] = [&pair[0], &pair[1]].map(|run| run.folder.clone());
                    return Err(ReportError::OtherBattles { task: task.to_owned(), first, second });
                }
            }
        }
        Ok(())
    }

    /// What a reader should know: where algorithms, tasks, seeds or steps are not equal, and where runs are
    /// few.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        let common = self.common_tasks();
        for task in self.tasks().into_iter().filter(|task| !common.contains(task)) {
            let missing: Vec<&str> = self
                .algorithms
                .iter()
                .filter(|of| !of.tasks.contains_key(task))
                .map(|of| &*of.name)
                .collect();
            notes.push(format!("{task} is not compared: {} has no runs of it", missing.join(" and ")));
        }
        let counts: BTreeSet<usize> =
            self.algorithms.iter().flat_map(|of| of.tasks.values()).map(Vec::len).collect();
        if counts.len() > 1 {
            let each = self.algorithms.iter().flat_map(|algorithm| {
                algorithm
                    .tasks
                    .iter()
                    .map(|(task, runs)| format!("{} on {task} {}", algorithm.name, runs.len()))
            });
            notes.push(format!("numbers of seeds differ: {}", each.collect::<Vec<_>>().join(", ")));
        }
        notes.extend(self.few_runs());
        for algorithm in &self.algorithms {
            for task in algorithm.tasks.keys().filter(|task| algorithm.has_mixed_settings(task)) {
                notes.push(format!(
                    "the runs of {} on {task} differ in more than their seeds",
                    algorithm.name
                ));
            }
        }
        if self.common_steps().is_none() {
            notes.push("evaluations of algorithms or tasks are at different steps".to_owned());
        }
        notes
    }

    /// Where runs are few; one note for algorithms of which the same is to be said.
    fn few_runs(&self) -> Vec<String> {
        let mut notes: Vec<(String, Vec<&str>)> = Vec::new();
        for algorithm in &self.algorithms {
            let Some(text) = few_runs(algorithm) else { continue };
            match notes.iter_mut().find(|(known, _)| *known == text) {
                Some((_, names)) => names.push(&algorithm.name),
                None => notes.push((text, vec![&algorithm.name])),
            }
        }
        let note = |(text, names): (String, Vec<&str>)| {
            let have = if names.len() == 1 { "has" } else { "have" };
            format!("{} {have} {text}", names.join(" and "))
        };
        notes.into_iter().map(note).collect()
    }

    /// The step counts of the evaluations, if they are equal in all runs.
    pub(crate) fn common_steps(&self) -> Option<Vec<u64>> {
        let mut all = self.algorithms.iter().flat_map(|of| of.tasks.values()).flatten();
        let steps: Vec<u64> = all.next()?.steps().collect();
        all.all(|run| run.steps().eq(steps.iter().copied())).then_some(steps)
    }
}

/// Fewer runs of a task than these say little: a quarter of three is none, and of one, every draw is the
/// same.
const FEW_RUNS: usize = 5;

fn few_runs(algorithm: &AlgorithmRuns) -> Option<String> {
    let few: Vec<_> = algorithm.tasks.iter().filter(|(_, runs)| runs.len() < FEW_RUNS).collect();
    let fewest = few.iter().map(|(_, runs)| runs.len()).min()?;
    let tasks = match few.len() == algorithm.tasks.len() && few.len() > 1 {
        true => "every task".to_owned(),
        false => few.iter().map(|(task, _)| task.as_str()).collect::<Vec<_>>().join(", "),
    };
    let meaning = match fewest {
        1 => "the interval of a single run has no width",
        2 | 3 => {
            "their interval is narrow by chance, and the interquartile mean of fewer than four is the mean"
        }
        _ => "their interval is narrow by chance",
    };
    Some(format!("fewer than five runs of {tasks} (at least {fewest}): {meaning}"))
}
