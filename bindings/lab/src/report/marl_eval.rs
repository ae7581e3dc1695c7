//! `metrics.json` as marl-eval reads it (Gorsane et al., 2022): environment, task, algorithm, run, and then
//! steps, each with one number per episode. It uses the keys of the first algorithm and run for all others,
//! so all must have the same ones; `absolute_metrics` must have the names of metrics that the steps have, and
//! no more.

use super::{AlgorithmRuns, Benchmark, EvaluatedRun};
use serde::{Serialize, Serializer};
use smaclite_learn::{Choice, Episode};
use std::collections::BTreeSet;

/// The name of the environment in the file.
pub const ENVIRONMENT: &str = "smaclite";

/// The file, or why marl-eval would not read it.
///
/// # Errors
/// If algorithms have different tasks, numbers of runs or step counts, or names that it does not accept.
pub fn marl_eval_json(benchmark: &Benchmark, actions: Choice) -> Result<String, String> {
    check(benchmark)?;
    let algorithm = |algorithm: &AlgorithmRuns, task: &str| {
        let runs = algorithm.tasks[task].iter().enumerate();
        Object(runs.map(|(i, run)| (format!("run_{}", i + 1), run_object(run, actions))).collect())
    };
    let task = |task: &str| {
        let algorithms = benchmark.algorithms.iter();
        Object(algorithms.map(|of| (of.name.clone(), algorithm(of, task))).collect())
    };
    let tasks = benchmark.tasks().into_iter().map(|name| (name.to_owned(), task(name)));
    let file = Object(vec![(ENVIRONMENT.to_owned(), Object(tasks.collect()))]);
    serde_json::to_string(&file).map_err(|error| error.to_string())
}

fn check(benchmark: &Benchmark) -> Result<(), String> {
    let names = || benchmark.algorithms.iter().map(|of| of.name.as_str());
    if let Some(name) = names().chain(benchmark.tasks()).find(|name| name.contains(',')) {
        return Err(format!("the name `{name}` has a comma"));
    }
    if names().map(str::to_lowercase).collect::<BTreeSet<_>>().len() < benchmark.algorithms.len() {
        return Err("names of algorithms differ only in upper and lower case".to_owned());
    }
    if benchmark.common_tasks() != benchmark.tasks() {
        return Err("not all algorithms have runs of all tasks".to_owned());
    }
    let counts = benchmark.algorithms.iter().flat_map(|of| of.tasks.values()).map(Vec::len);
    if counts.collect::<BTreeSet<_>>().len() > 1 {
        return Err("numbers of seeds differ".to_owned());
    }
    match benchmark.common_steps() {
        Some(_) => Ok(()),
        None => Err("evaluations are at different steps".to_owned()),
    }
}

fn run_object(run: &EvaluatedRun, actions: Choice) -> Object<Metrics> {
    let steps = run.evaluations.iter().enumerate().map(|(i, evaluation)| {
        let metrics = Metrics::of(Some(evaluation.row.steps), evaluation.episodes(actions));
        (format!("step_{i}"), metrics)
    });
    let absolute = ("absolute_metrics".to_owned(), Metrics::of(None, run.final_episodes(actions)));
    Object(steps.chain([absolute]).collect())
}

#[derive(Serialize)]
struct Metrics {
    #[serde(skip_serializing_if = "Option::is_none")]
    step_count: Option<u64>,
    win_rate: Vec<u8>,
    #[serde(rename = "return")]
    returns: Vec<f32>,
}

impl Metrics {
    fn of(step_count: Option<u64>, episodes: &[Episode]) -> Metrics {
        Metrics {
            step_count,
            win_rate: episodes.iter().map(|episode| u8::from(episode.won)).collect(),
            returns: episodes.iter().map(|episode| episode.episode_return).collect(),
        }
    }
}

/// A JSON object whose keys stay in their order.
struct Object<T>(Vec<(String, T)>);

impl<T: Serialize> Serialize for Object<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(key, value)| (key, value)))
    }
}
