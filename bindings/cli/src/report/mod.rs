//! `smaclite-pool report`: compare runs of several seeds and algorithms. The numbers are those of
//! `smaclite_learn`; here are the options and the files. `tables` has what people read, `files` what programs
//! read, and `figures` the pictures, which `chart` draws.

mod chart;
mod figures;
mod files;
mod tables;

use super::CommandResult;
use super::files::{check_out, make_out, write_files};
use crate::number::{Threads, seed};
use crate::process::interruption;
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use smaclite_lab::{Benchmark, EvaluatedRun, FirstWin, Report, ReportError, marl_eval_json, time_to_win};
use smaclite_learn::Choice;
use smaclite_units::Keyword;
use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};

#[derive(Args)]
#[command(after_help = "\
Examples:
  smaclite-pool train 3m --seeds 10 --evaluate-every 10k --steps 200k --out runs/3m
  smaclite-pool report runs/3m --out report
  smaclite-pool report ours=runs/ippo theirs=runs/mappo --out report

A FOLDER is that of a run, of `train --seeds`, or one with such folders in it. All runs in it are those of \
one algorithm. Its name in the report is NAME, by default that of the folder; folders with the same NAME are \
joined. The task of a run is its scenario. Algorithms are compared over the tasks that all of them have.

Tables and curves are interquartile means with 95 % intervals of the stratified bootstrap \
(docs/how-to/benchmark.md). The time to win is that until the lower end of the 95 % interval (Wilson) of the \
win rate is at least 90 %, over 200 episodes with fresh seeds, which this command plays with the weights of \
one evaluation after the other, greedy ones and sampled ones.")]
pub(super) struct WriteReport {
    /// Folders of runs that were evaluated, with the name of their algorithm if it is another than that of
    /// the folder
    #[arg(required = true, value_name = "[NAME=]FOLDER")]
    runs: Vec<String>,
    /// Folder for report.md, its pictures (SVG), CSV files, and metrics.json for marl-eval; those of an
    /// earlier report are replaced or removed
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    /// Which episodes are compared: those with the most probable actions, or with sampled ones
    #[arg(long, value_parser = choice(), default_value_t = Choice::Greedy)]
    actions: Choice,
    /// Play no episodes to find out when teams first won
    #[arg(long)]
    skip_times: bool,
    /// Seed of the bootstrap
    #[arg(long, default_value_t = 0, value_parser = seed())]
    seed: u64,
    #[command(flatten)]
    threads: Threads,
}

/// A parser of `greedy` and `sampled`.
fn choice() -> impl TypedValueParser<Value = Choice> {
    PossibleValuesParser::new(Choice::names()).try_map(|name| name.parse::<Choice>())
}

/// When the teams of runs first won, with greedy and with sampled actions, by [`key`].
type Times = BTreeMap<(PathBuf, String), [FirstWin; 2]>;

/// The folder of a run on several maps has a run of each.
fn key(run: &EvaluatedRun) -> (PathBuf, String) {
    (run.folder.clone(), run.task.clone())
}

/// The file for marl-eval, which a report has if it can be made.
const METRICS: &str = "metrics.json";

/// Everything that is written.
struct Results {
    benchmark: Benchmark,
    actions: Choice,
    report: Report,
    /// `None` if they were not asked for.
    times: Option<Times>,
    notes: Vec<String>,
    /// The file for marl-eval, if it can be made.
    metrics: Option<String>,
}

impl WriteReport {
    pub(super) fn run(self) -> CommandResult {
        check_out(&self.out)?;
        let folders: Vec<(String, PathBuf)> = self.runs.iter().map(|text| named(text)).collect();
        let benchmark = Benchmark::read(&folders)?;
        make_out(&self.out)?;
        let interrupted = interruption()?;
        let threads = self.threads.number();
        let times = (!self.skip_times).then(|| play(&benchmark, threads, &interrupted)).transpose()?;
        let actions = self.actions;
        let mut notes = benchmark.notes();
        notes.extend(times.iter().flat_map(|times| not_measured(&benchmark, times)));
        let metrics = match marl_eval_json(&benchmark, actions) {
            Ok(text) => Some(text),
            Err(why) => {
                notes.push(format!("there is no metrics.json, which marl-eval would not read: {why}"));
                None
            }
        };
        let report = Report::new(&benchmark, actions, self.seed);
        let results = Results { benchmark, actions, report, times, notes, metrics };
        write(&self.out, &results)?; // first: the files do not depend on who reads the output
        tables::print(&results)
    }
}

/// The name of an algorithm and its folder. A folder whose name has an equals sign is none with a name.
fn named(text: &str) -> (String, PathBuf) {
    if let Some((name, folder)) = text.split_once('=')
        && !name.is_empty()
        && !Path::new(text).exists()
    {
        return (name.to_owned(), PathBuf::from(folder));
    }
    let whole = std::path::absolute(text).unwrap_or_default(); // as that of `.`
    let name = whole.file_name().map(|name| name.to_string_lossy().into_owned());
    (name.unwrap_or_else(|| text.to_owned()), PathBuf::from(text))
}

/// Finds out when the teams of all runs first won.
fn play(benchmark: &Benchmark, threads: usize, stop: &dyn Fn() -> bool) -> Result<Times, Box<dyn Error>> {
    let runs = benchmark.algorithms.iter().flat_map(|algorithm| algorithm.tasks.values()).flatten();
    let times = |run: &EvaluatedRun| {
        let time = |actions| time_to_win(run, actions, threads, &mut || stop());
        Ok((key(run), [time(Choice::Greedy)?, time(Choice::Sampled)?]))
    };
    runs.map(times).collect::<Result<_, _>>().map_err(|error| match error {
        ReportError::NoTime(_) => format!("{error}; --skip-times leaves this out").into(),
        error => error.into(),
    })
}

/// Notes of the runs of which nobody knows when their teams first won.
fn not_measured(benchmark: &Benchmark, times: &Times) -> Vec<String> {
    let mut notes = Vec::new();
    for algorithm in &benchmark.algorithms {
        for (task, runs) in &algorithm.tasks {
            let is_unknown = |run: &&EvaluatedRun| times[&key(run)].iter().any(|win| !win.is_measured());
            let unknown: Vec<&EvaluatedRun> = runs.iter().filter(is_unknown).collect();
            if let [first, ..] = unknown[..] {
                notes.push(format!(
                    "the time to win of {} of {} runs of {} on {task} was not measured: `{}` has no \
                     time_to_win.json",
                    unknown.len(),
                    runs.len(),
                    algorithm.name,
                    first.folder.display()
                ));
            }
        }
    }
    notes
}

/// Writes the files of the report, and removes those of an earlier one, which would be taken for files of
/// this one.
fn write(folder: &Path, results: &Results) -> CommandResult {
    let mut all = vec![("report.md".to_owned(), tables::markdown(results))];
    all.extend(files::all(results).map(|(name, text)| (name.to_owned(), text)));
    all.extend(figures::all(results));
    all.extend(results.metrics.iter().map(|text| (METRICS.to_owned(), text.clone())));
    write_files(folder, &all)?;
    let not_always = figures::file_names().chain([METRICS.to_owned()]);
    for name in not_always.filter(|name| all.iter().all(|(written, _)| written != name)) {
        let path = folder.join(name);
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(format!("{}: {error}", path.display()).into());
            }
            _ => {}
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_has_the_name_before_it_or_its_own() {
        let check = |text: &str, name: &str, folder: &str| {
            assert_eq!(named(text), (name.to_owned(), PathBuf::from(folder)), "{text}");
        };
        check("ours=runs/a", "ours", "runs/a");
        check("runs/a/", "a", "runs/a/");
        check("=runs/a", "a", "=runs/a");
        check("a=b=c", "a", "b=c");
    }
}
