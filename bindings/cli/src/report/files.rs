//! The numbers of a report as CSV, one row per number with its interval. The task of all tasks together is
//! empty.

use super::{Results, key};
use crate::csv::quoted;
use smaclite_lab::{Estimate, EvaluatedRun, FirstWin, TimeToWin};
use smaclite_learn::Summary;

/// Names and contents.
pub(super) fn all(results: &Results) -> impl Iterator<Item = (&'static str, String)> {
    [
        ("runs.csv", runs(results)),
        ("curves.csv", curves(results)),
        ("aggregates.csv", aggregates(results)),
        ("profiles.csv", profiles(results)),
        ("improvement.csv", improvements(results)),
    ]
    .into_iter()
}

const RUNS: &str = "algorithm,task,seed,folder,evaluations,run_steps,best_steps,greedy_win_rate,\
    greedy_mean_return,greedy_mean_length,sampled_win_rate,sampled_mean_return,sampled_mean_length,seconds,\
    cpu_seconds,greedy_win_steps,greedy_win_seconds,greedy_win_cpu_seconds,greedy_wins,sampled_win_steps,\
    sampled_win_seconds,sampled_win_cpu_seconds,sampled_wins\n";

/// A row per run, with both kinds of actions. The columns of the time to win are empty if the team never won,
/// and if it was not measured, which a note of the report says.
fn runs(results: &Results) -> String {
    let mut text = RUNS.to_owned();
    for algorithm in &results.benchmark.algorithms {
        for run in algorithm.tasks.values().flatten() {
            text += &run_row(&algorithm.name, run, results);
        }
    }
    text
}

fn run_row(algorithm: &str, run: &EvaluatedRun, results: &Results) -> String {
    let EvaluatedRun { folder, task, seed, evaluations, result, .. } = run;
    let means =
        |summary: Summary| format!("{},{},{}", summary.win_rate, summary.mean_return, summary.mean_length);
    let times = results.times.as_ref().and_then(|times| times.get(&key(run)).copied());
    let win = times.unwrap_or([FirstWin::NotMeasured; 2]).map(|win| match win {
        FirstWin::NotMeasured | FirstWin::Never => ",,,".to_owned(),
        FirstWin::At(TimeToWin { steps, wins, seconds, cpu_seconds, .. }) => {
            format!("{steps},{seconds:.2},{cpu_seconds:.2},{wins}")
        }
    });
    let win = win.join(",");
    format!(
        "{},{},{seed},{},{},{},{},{},{},{:.2},{:.2},{win}\n",
        quoted(algorithm),
        quoted(task),
        quoted(&folder.to_string_lossy()),
        evaluations.len(),
        result.run_steps,
        result.steps,
        means(result.greedy),
        means(result.sampled),
        result.seconds,
        result.cpu_seconds,
    )
}

/// Value and interval as three columns.
fn columns(estimate: Estimate) -> String {
    let Estimate { value, low, high } = estimate;
    format!("{value:.6},{low:.6},{high:.6}")
}

fn curves(results: &Results) -> String {
    let mut text = "metric,algorithm,task,steps,interquartile_mean,low,high\n".to_owned();
    for curve in &results.report.curves {
        let (algorithm, task) = (quoted(&curve.algorithm), quoted(curve.task.as_deref().unwrap_or_default()));
        for (steps, estimate) in &curve.points {
            let metric = curve.metric.name();
            text += &format!("{metric},{algorithm},{task},{steps},{}\n", columns(*estimate));
        }
    }
    text
}

fn aggregates(results: &Results) -> String {
    let mut text = "metric,algorithm,task,runs,interquartile_mean,low,high,worst_run\n".to_owned();
    for aggregate in &results.report.aggregates {
        let (metric, algorithm) = (aggregate.metric.name(), quoted(&aggregate.algorithm));
        let task = quoted(aggregate.task.as_deref().unwrap_or_default());
        let (mean, runs, worst) = (columns(aggregate.mean), aggregate.runs, aggregate.worst);
        text += &format!("{metric},{algorithm},{task},{runs},{mean},{worst:.6}\n");
    }
    text
}

fn profiles(results: &Results) -> String {
    let mut text = "metric,algorithm,threshold,share_above,low,high\n".to_owned();
    for profile in &results.report.profiles {
        let (metric, algorithm) = (profile.metric.name(), quoted(&profile.algorithm));
        for (threshold, estimate) in &profile.points {
            text += &format!("{metric},{algorithm},{threshold},{}\n", columns(*estimate));
        }
    }
    text
}

fn improvements(results: &Results) -> String {
    let mut text = "metric,better,than,probability,low,high\n".to_owned();
    for improvement in &results.report.improvements {
        let [better, than] = [&improvement.better, &improvement.than].map(|name| quoted(name));
        let (metric, columns) = (improvement.metric.name(), columns(improvement.probability));
        text += &format!("{metric},{better},{than},{columns}\n");
    }
    text
}
