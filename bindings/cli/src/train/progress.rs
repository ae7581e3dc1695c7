//! How far runs are that train: one, or one per seed.

use super::display::{Lines, by_enemies, evaluation, json_of, minutes};
use super::maps::name_of;
use super::{Opened, incomplete};
use crate::process::Interrupted;
use crate::{CommandResult, runtime_dir};
use serde_json::Value;
use smaclite_learn::{Record, RunDescription, TrainError, TrainEvent};
use std::collections::BTreeMap;
use std::error::Error;
use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Trains what was opened, which is in the folder, and shows how far it is.
pub(super) fn train(
    opened: Opened,
    steps: Option<u64>,
    threads: usize,
    json: bool,
    folder: &Path,
    interrupted: &(dyn Fn() -> bool + Sync),
) -> CommandResult {
    let display = Mutex::new(Display::new(&opened, steps, json)?);
    let is_closed = AtomicBool::new(false); // the output: then the runs end with their checkpoints
    let show = |seed, event| {
        let mut display = display.lock().unwrap_or_else(PoisonError::into_inner);
        if let Err(error) = display.show(seed, event) {
            is_closed.store(true, Ordering::Relaxed);
            // All errors of the display are of the output.
            let error =
                error.downcast().map_or_else(|error| io::Error::other(error.to_string()), |error| *error);
            display.error.get_or_insert(error);
        }
    };
    let stop = || interrupted() || is_closed.load(Ordering::Relaxed);
    match opened {
        Opened::One(mut run, _) => {
            let seed = run.config().seed;
            run.train(&mut || stop(), &|event| show(seed, event)).map_err(|error| match error {
                TrainError::Client(_) => format!("{error}; resume with --resume {}", folder.display()).into(),
                error => Box::<dyn Error>::from(error),
            })?;
        }
        Opened::Several(runs) => {
            let results = runs.train(steps, threads, &runtime_dir()?, &stop, &show);
            let failed = results.iter().filter_map(|(seed, result)| Some((seed, result.as_ref().err()?)));
            let failed: Vec<String> = failed.map(|(seed, error)| format!("seed {seed}: {error}")).collect();
            if !failed.is_empty() {
                return Err(failed.join("\n").into());
            }
        }
    }
    let mut display = display.into_inner().unwrap_or_else(PoisonError::into_inner);
    let is_complete = display.completed == display.count;
    if let Some(error) = display.error.take() {
        return Err(if is_complete { error.into() } else { incomplete(error.into(), folder) });
    }
    display.end()?;
    if is_complete { Ok(()) } else { Err(Interrupted.into()) }
}

/// How far the runs are.
struct Display {
    json: bool,
    lines: Lines,
    name: String,
    /// Runs of several seeds, even if it is one of them: then JSON and lines say so.
    are_seeds: bool,
    count: usize,
    completed: usize,
    /// Steps of all runs together, when they are complete.
    total: u64,
    runs: BTreeMap<u64, Progress>,
    /// When the first of them began or continued.
    begin: Option<Instant>,
    error: Option<io::Error>,
}

/// How far a run is.
struct Progress {
    /// The steps that it had made when it began or continued here.
    first_steps: u64,
    last: Record,
}

impl Display {
    fn new(opened: &Opened, steps: Option<u64>, json: bool) -> Result<Display, Box<dyn Error>> {
        let (mut name, mut total, mut count) = (String::new(), 0, 1);
        match opened {
            Opened::One(run, of_run) => (name, total) = (of_run.clone(), run.config().steps),
            Opened::Several(runs) => {
                count = runs.runs().len();
                for (_, folder) in runs.runs() {
                    let run = RunDescription::read(folder)?;
                    total += steps.unwrap_or(run.config.steps);
                    name = name_of(&run);
                }
            }
        }
        Ok(Display {
            json,
            lines: Lines::new(),
            name,
            are_seeds: matches!(opened, Opened::Several(_)),
            count,
            completed: 0,
            total,
            runs: BTreeMap::new(),
            begin: None,
            error: None,
        })
    }

    /// JSON is of updates alone.
    fn show(&mut self, seed: u64, event: TrainEvent) -> CommandResult {
        match event {
            TrainEvent::Began(record) => {
                self.begin.get_or_insert_with(Instant::now);
                self.runs.insert(seed, Progress { first_steps: record.steps, last: record });
            }
            TrainEvent::Updated(record) if self.json => {
                let mut object = json_of(&record);
                if self.are_seeds {
                    object.insert("seed".to_owned(), seed.into());
                }
                out!("{}", Value::Object(object))?;
            }
            TrainEvent::Updated(record) => {
                self.runs.entry(seed).and_modify(|run| run.last = record);
                let line = self.line(self.begin.map(|begin| begin.elapsed()).unwrap_or_default());
                self.lines.show(line)?;
            }
            TrainEvent::Evaluated(row) if !self.json => {
                let of_seed = if self.are_seeds { format!(" seed {seed}") } else { String::new() };
                self.lines.keep(&format!("{}{of_seed}: {}", self.name, evaluation(&row)))?;
            }
            TrainEvent::Evaluated(_) => {}
            TrainEvent::Completed => self.completed += 1,
        }
        Ok(())
    }

    /// After so much time.
    fn line(&self, elapsed: Duration) -> String {
        let steps: u64 = self.runs.values().map(|run| run.last.steps).sum();
        // A run that is resumed has made steps before: they took none of this time.
        let made: u64 = self.runs.values().map(|run| run.last.steps - run.first_steps).sum();
        let per_s = made as f64 / elapsed.as_secs_f64().max(1e-9);
        let left = minutes(self.total.saturating_sub(steps) as f64 / per_s);
        let seeds = match self.are_seeds {
            true => format!("{} of {} seeds complete  ", self.completed, self.count),
            false => String::new(),
        };
        let (name, total, teams) = (&self.name, self.total, self.teams());
        format!("{name}: {seeds}{steps} of {total} steps  {per_s:.0} steps/s  {teams}  {left} left")
    }

    /// How well they play.
    fn teams(&self) -> String {
        if let (false, Some(Progress { last, .. })) = (self.are_seeds, self.runs.values().next()) {
            let Record { mean_return, win_rate, .. } = last;
            let wins = format!("wins {:5.1} %{}", 100.0 * win_rate, by_enemies(last));
            return match last.episodes {
                0 => "no episode yet".to_owned(),
                _ => format!("return {mean_return:5.2}  {wins}"),
            };
        }
        let rates = self.runs.values().map(|run| 100.0 * run.last.win_rate);
        let mut rates: Vec<f64> = rates.filter(|rate| !rate.is_nan()).collect();
        rates.sort_by(f64::total_cmp);
        match rates[..] {
            [] => "no episode yet".to_owned(),
            [.., highest] => {
                let mean = rates.iter().sum::<f64>() / rates.len() as f64;
                format!("wins {mean:.1} % ({:.1} to {highest:.1})", rates[0])
            }
        }
    }

    fn end(self) -> CommandResult {
        if self.json {
            return Ok(());
        }
        let Display { completed, count, .. } = self;
        let end = match (completed == count, self.are_seeds) {
            (true, true) => format!("complete: {count} seeds"),
            (true, false) => "complete".to_owned(),
            (false, true) => {
                format!("interrupted: {completed} of {count} seeds complete; resume with --resume")
            }
            (false, false) => "interrupted; resume with --resume".to_owned(),
        };
        self.lines.end(&end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use smaclite_learn::UpdateStats;

    fn record(steps: u64, win_rate: f64) -> Record {
        Record {
            updates: 1,
            steps,
            episodes: 9,
            mean_return: 0.0,
            win_rate,
            mean_length: 0.0,
            stats: UpdateStats::default(),
            seconds: 0.0,
            cpu_seconds: 0.0,
            steps_per_s: 0.0,
            wait_share: 0.0,
            learn_share: 0.0,
            self_play: None,
            win_rates: Vec::new(),
        }
    }

    /// The first update of each run counted as if all its steps had been made since then; and runs that were
    /// complete had made none.
    #[test]
    fn steps_before_a_resumption_are_made_and_took_no_time() {
        let mut display = Display {
            json: false,
            lines: Lines::new(),
            name: "3m".to_owned(),
            are_seeds: true,
            count: 3,
            completed: 0,
            total: 3000,
            runs: BTreeMap::new(),
            begin: None,
            error: None,
        };
        display.show(1, TrainEvent::Began(record(1000, 0.9))).unwrap();
        display.show(1, TrainEvent::Completed).unwrap();
        display.show(2, TrainEvent::Began(record(500, 0.5))).unwrap();
        display.show(2, TrainEvent::Updated(record(600, 0.7))).unwrap();
        let expected = "3m: 1 of 3 seeds complete  1600 of 3000 steps  50 steps/s  \
                        wins 80.0 % (70.0 to 90.0)  0:28 left";
        assert_eq!(display.line(Duration::from_secs(2)), expected);
    }
}
