//! The tables of a report, for people.

use super::{Results, figures, key};
use crate::CommandResult;
use crate::table::{Table, percent};
use smaclite_lab::{
    Aggregate, AlgorithmRuns, Benchmark, CRITERION_EPISODES, CRITERION_WIN_RATE, Estimate, EvaluatedRun,
    FirstWin, Metric, Spread, TimeToWin,
};
use smaclite_learn::Choice;

const AGGREGATES: &str = "Final episodes of the best weights: interquartile means with 95 % intervals";
const TASKS: &str = "By task: won episodes and return of the final episodes";
const IMPROVEMENTS: &str = "Probability that the first is better than the second on a task";
const TIMES: &str = "Training until a team won: median of the seeds (worst)";

/// Prints the tables and notes.
pub(super) fn print(results: &Results) -> CommandResult {
    out!("{}", headline(results))?;
    for (title, table) in all(results) {
        out!("\n{title}:")?;
        table.print()?;
    }
    for note in &results.notes {
        out!("\nnote: {note}")?;
    }
    Ok(())
}

/// The page, with pictures and explanations.
pub(super) fn markdown(results: &Results) -> String {
    let mut text = format!("# Report\n\n{}\n", headline(results));
    if !results.notes.is_empty() {
        text += "\n";
        results.notes.iter().for_each(|note| text += &format!("- Note: {note}.\n"));
    }
    for (title, table) in all(results) {
        text += &format!("\n{title}:\n\n{}", table.markdown());
    }
    for (name, title) in figures::titles(results) {
        text += &format!(
            "\n<picture>\n  <source media=\"(prefers-color-scheme: dark)\" srcset=\"{name}-dark.svg\">\n  \
             <img alt=\"{title}\" src=\"{name}.svg\">\n</picture>\n"
        );
    }
    text + &explanations(results)
}

fn headline(results: &Results) -> String {
    let Benchmark { algorithms } = &results.benchmark;
    let runs: Vec<usize> = algorithms.iter().flat_map(|of| of.tasks.values()).map(Vec::len).collect();
    let (fewest, most) = (runs.iter().min().unwrap_or(&0), runs.iter().max().unwrap_or(&0));
    let seeds = if fewest == most { most.to_string() } else { format!("{fewest} to {most}") };
    let tasks = results.benchmark.tasks().len();
    let plural = |count: usize, word: &str| if count == 1 { word.to_owned() } else { format!("{word}s") };
    format!(
        "{} {}, {tasks} {}, {seeds} {} each, {} actions",
        algorithms.len(),
        plural(algorithms.len(), "algorithm"),
        plural(tasks, "task"),
        plural(*most, "seed"),
        results.actions
    )
}

/// The tables that there are, with their titles.
fn all(results: &Results) -> Vec<(&'static str, Table)> {
    let mut tables = Vec::new();
    if !results.benchmark.common_tasks().is_empty() {
        tables.push((AGGREGATES, overall(results)));
    }
    tables.push((TASKS, by_task(results)));
    if !results.report.improvements.is_empty() {
        tables.push((IMPROVEMENTS, improvements(results)));
    }
    if let Some(times) = times(results) {
        tables.push((TIMES, times));
    }
    tables
}

fn with_interval(estimate: Estimate, form: impl Fn(f64) -> String) -> String {
    let Estimate { value, low, high } = estimate;
    format!("{} ({} to {})", form(value), form(low), form(high))
}

fn find<'a>(
    results: &'a Results,
    algorithm: &str,
    task: Option<&str>,
    metric: Metric,
) -> Option<&'a Aggregate> {
    let fits = |aggregate: &&Aggregate| {
        aggregate.algorithm == algorithm && aggregate.task.as_deref() == task && aggregate.metric == metric
    };
    results.report.aggregates.iter().find(fits)
}

/// Over the tasks that are compared, a row per algorithm.
fn overall(results: &Results) -> Table {
    let mut table = Table::new(["algorithm", "tasks", "runs", "won", "normalised return"]);
    let tasks = results.benchmark.common_tasks().len().to_string();
    for AlgorithmRuns { name, .. } in &results.benchmark.algorithms {
        let of = |metric| find(results, name, None, metric);
        if let (Some(wins), Some(returns)) = (of(Metric::WinRate), of(Metric::Return)) {
            let returns = with_interval(returns.mean, |value| format!("{value:.3}"));
            let (runs, wins) = (wins.runs.to_string(), with_interval(wins.mean, percent));
            table.push([name.clone(), tasks.clone(), runs, wins, returns]);
        }
    }
    table
}

/// A row per task and algorithm.
fn by_task(results: &Results) -> Table {
    let [own, other] = match results.actions {
        Choice::Greedy => ["greedy", "sampled"],
        Choice::Sampled => ["sampled", "greedy"],
    };
    let won = format!("won, {own}");
    let other_won = format!("won, {other} (mean)");
    let headings = ["task", "algorithm", "seeds", &won, "worst seed", &other_won, "return (mean)"];
    let mut table = Table::new(headings);
    for task in results.benchmark.tasks() {
        for AlgorithmRuns { name, tasks } in &results.benchmark.algorithms {
            let (Some(runs), Some(wins)) =
                (tasks.get(task), find(results, name, Some(task), Metric::WinRate))
            else {
                continue;
            };
            let mean = |value: &dyn Fn(&EvaluatedRun) -> f64| {
                runs.iter().map(value).sum::<f64>() / runs.len() as f64
            };
            let [returns, others] = match results.actions {
                Choice::Greedy => {
                    [mean(&|run| run.result.greedy.mean_return), mean(&|run| run.result.sampled.win_rate)]
                }
                Choice::Sampled => {
                    [mean(&|run| run.result.sampled.mean_return), mean(&|run| run.result.greedy.win_rate)]
                }
            };
            table.push([
                task.to_owned(),
                name.clone(),
                wins.runs.to_string(),
                with_interval(wins.mean, percent),
                percent(wins.worst),
                percent(others),
                format!("{returns:.2}"),
            ]);
        }
    }
    table
}

fn improvements(results: &Results) -> Table {
    let mut table = Table::new(["better", "than", "by won episodes", "by return"]);
    let of_metric = |metric| results.report.improvements.iter().filter(move |of| of.metric == metric);
    for (by_wins, by_return) in of_metric(Metric::WinRate).zip(of_metric(Metric::Return)) {
        let cells = [by_wins, by_return].map(|of| probability(of.probability));
        let [wins, returns] = cells;
        table.push([by_wins.better.clone(), by_wins.than.clone(), wins, returns]);
    }
    table
}

/// A probability of improvement. If it holds for every pair of runs, it does so in every draw of the
/// bootstrap, whose interval then says nothing, least of all that a few runs are certain.
fn probability(estimate: Estimate) -> String {
    match estimate.low == estimate.high && [0.0, 1.0].contains(&estimate.value) {
        true => format!("{} (all pairs of runs; no interval)", percent(estimate.value)),
        false => with_interval(estimate, percent),
    }
}

/// When teams first won, two rows per task and algorithm.
fn times(results: &Results) -> Option<Table> {
    let times = results.times.as_ref()?;
    let headings = ["task", "algorithm", "actions", "seeds that won", "steps", "CPU-seconds", "seconds"];
    let mut table = Table::new(headings);
    for task in results.benchmark.tasks() {
        for AlgorithmRuns { name, tasks } in &results.benchmark.algorithms {
            let Some(runs) = tasks.get(task) else { continue };
            for actions in Choice::BOTH {
                let of_run = |run: &EvaluatedRun| times.get(&key(run)).map(|times| times[actions.index()]);
                let of_runs: Vec<FirstWin> = runs.iter().filter_map(of_run).collect();
                let before = [task.to_owned(), name.to_owned(), actions.to_string()];
                table.push(before.into_iter().chain([seeds_that_won(&of_runs)]).chain(spreads(&of_runs)));
            }
        }
    }
    Some(table)
}

/// Of those that were measured.
fn seeds_that_won(wins: &[FirstWin]) -> String {
    match wins.iter().filter(|win| win.is_measured()).count() {
        0 => "not measured".to_owned(),
        measured => format!("{} of {measured}", wins.iter().filter_map(FirstWin::time).count()),
    }
}

/// Median and worst of steps and times.
fn spreads(wins: &[FirstWin]) -> [String; 3] {
    let cell = |value: fn(&TimeToWin) -> f64, digits: usize| {
        let Spread { median, worst } = Spread::of(wins, value);
        let text = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.digits$}"));
        format!("{} ({})", text(median), text(worst))
    };
    [cell(|time| time.steps as f64, 0), cell(|time| time.cpu_seconds, 1), cell(|time| time.seconds, 1)]
}

/// What the numbers mean.
fn explanations(results: &Results) -> String {
    let (win_rate, actions) = (100.0 * CRITERION_WIN_RATE, results.actions);
    let enough = if results.times.is_some() {
        format!(
            "- **Training until a team won**: the training time of the first evaluation whose weights won so \
             many of {CRITERION_EPISODES} episodes with fresh seeds that the lower end of the 95 % \
             interval (Wilson) of the win rate is at least {win_rate:.0} %. Evaluations are not counted. A \
             dash: not in its run; such a seed is worse than all others. A seed that was not measured is \
             left out. Where battles begin equal, all greedy episodes can be one battle, which is won by \
             chance: read the sampled ones too.\n"
        )
    } else {
        String::new()
    };
    format!(
        "\nHow to read this:\n\n\
         - **Final episodes** are played with the best weights of a run after its training, {actions}, with \
         seeds of their own. The best weights are those of the evaluation with most wins.\n\
         - **Interquartile mean**: the mean of the middle half of all runs. Its 95 % interval is that of the \
         bootstrap, stratified by task: how it would vary with other seeds.\n\
         - **Normalised return**: 0 is the lowest and 1 the highest return of an episode of the task, \
         {actions}, in any evaluation of these runs, so it depends on what is compared.\n\
         - **Performance profile**: the share of runs above each score. A curve above another is better.\n\
         - **Probability of improvement**: that a run of one algorithm is better than a run of the other on \
         a random task; a draw counts as a half.\n\
         {enough}"
    )
}
