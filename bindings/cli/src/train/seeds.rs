//! `train` of several seeds: one line with the progress of all.

use super::display::{Lines, evaluation, json_of, minutes};
use super::incomplete;
use crate::process::Interrupted;
use crate::{CommandResult, runtime_dir};
use serde_json::Value;
use smaclite_learn::{Record, RunDescription, SeedEvent, Seeds};
use std::collections::BTreeMap;
use std::error::Error;
use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Trains the runs, which are in the folder, and shows how far they are.
pub(super) fn train(
    runs: &Seeds,
    steps: Option<u64>,
    threads: usize,
    json: bool,
    folder: &Path,
    interrupted: &(dyn Fn() -> bool + Sync),
) -> CommandResult {
    let display = Mutex::new(Display::new(runs, steps, json)?);
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
    let results = runs.train(steps, threads, &runtime_dir()?, &stop, &show);
    let failed: Vec<String> = results
        .iter()
        .filter_map(|(seed, result)| Some(format!("seed {seed}: {}", result.as_ref().err()?)))
        .collect();
    let mut display = display.into_inner().unwrap_or_else(PoisonError::into_inner);
    if !failed.is_empty() {
        return Err(failed.join("\n").into());
    }
    if let Some(error) = display.error.take() {
        let is_complete = display.complete == display.seeds;
        return Err(if is_complete { error.into() } else { incomplete(error.into(), folder) });
    }
    let is_interrupted = interrupted() && display.complete < display.seeds;
    display.end(is_interrupted)?;
    if is_interrupted { Err(Interrupted.into()) } else { Ok(()) }
}

/// How far the runs are.
struct Display {
    json: bool,
    lines: Lines,
    name: String,
    /// Steps of all runs together, when they are complete.
    total: u64,
    seeds: usize,
    complete: usize,
    ended: usize,
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
    fn new(runs: &Seeds, steps: Option<u64>, json: bool) -> Result<Display, Box<dyn Error>> {
        let (mut total, mut name) = (0, String::new());
        for (_, folder) in runs.runs() {
            let run = RunDescription::read(folder)?;
            total += steps.unwrap_or(run.config.steps);
            name = run.name;
        }
        let lines = Lines::new();
        let seeds = runs.runs().len();
        Ok(Display {
            json,
            lines,
            name,
            total,
            seeds,
            complete: 0,
            ended: 0,
            runs: BTreeMap::new(),
            begin: None,
            error: None,
        })
    }

    fn show(&mut self, seed: u64, event: SeedEvent) -> CommandResult {
        match event {
            SeedEvent::Began(record) => {
                self.begin.get_or_insert_with(Instant::now);
                self.runs.insert(seed, Progress { first_steps: record.steps, last: record });
                Ok(())
            }
            SeedEvent::Updated(record) => {
                let json = self.json.then(|| json_of(&record));
                self.runs.entry(seed).and_modify(|run| run.last = record);
                if let Some(mut object) = json {
                    object.insert("seed".to_owned(), seed.into());
                    out!("{}", Value::Object(object))?;
                    return Ok(());
                }
                let line = self.line(self.begin.map(|begin| begin.elapsed()).unwrap_or_default());
                self.lines.show(line)
            }
            SeedEvent::Evaluated(row) if !self.json => {
                self.lines.keep(&format!("{} seed {seed}: {}", self.name, evaluation(&row)))
            }
            SeedEvent::Evaluated(_) => Ok(()),
            SeedEvent::Ended { is_complete } => {
                self.ended += 1;
                self.complete += usize::from(is_complete);
                Ok(())
            }
        }
    }

    /// After so much time.
    fn line(&self, elapsed: Duration) -> String {
        let steps: u64 = self.runs.values().map(|run| run.last.steps).sum();
        // A run that is resumed has made steps before: they took none of this time.
        let made: u64 = self.runs.values().map(|run| run.last.steps - run.first_steps).sum();
        let per_s = made as f64 / elapsed.as_secs_f64().max(1e-9);
        let left = minutes(self.total.saturating_sub(steps) as f64 / per_s);
        let rates = self.runs.values().map(|run| 100.0 * run.last.win_rate);
        let mut rates: Vec<f64> = rates.filter(|rate| !rate.is_nan()).collect();
        rates.sort_by(f64::total_cmp);
        let wins = match rates[..] {
            [] => "no episode yet".to_owned(),
            [.., highest] => {
                let mean = rates.iter().sum::<f64>() / rates.len() as f64;
                format!("wins {mean:.1} % ({:.1} to {highest:.1})", rates[0])
            }
        };
        format!(
            "{}: {} of {} seeds complete  {steps} of {} steps  {per_s:.0} steps/s  {wins}  {left} left",
            self.name, self.complete, self.seeds, self.total
        )
    }

    fn end(self, interrupted: bool) -> CommandResult {
        if self.json {
            return Ok(());
        }
        let Display { complete, seeds, .. } = self;
        let end = match (complete == seeds, interrupted) {
            (true, _) => format!("complete: {seeds} seeds"),
            (false, true) => {
                format!("interrupted: {complete} of {seeds} seeds complete; resume with --resume")
            }
            (false, false) => format!("{complete} of {seeds} seeds complete"),
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
            json: true,
            lines: Lines::new(),
            name: "3m".to_owned(),
            total: 3000,
            seeds: 3,
            complete: 0,
            ended: 0,
            runs: BTreeMap::new(),
            begin: None,
            error: None,
        };
        display.show(1, SeedEvent::Began(record(1000, 0.9))).unwrap();
        display.show(1, SeedEvent::Ended { is_complete: true }).unwrap();
        display.show(2, SeedEvent::Began(record(500, 0.5))).unwrap();
        display.show(2, SeedEvent::Updated(record(600, 0.7))).unwrap();
        let expected = "3m: 1 of 3 seeds complete  1600 of 3000 steps  50 steps/s  \
                        wins 80.0 % (70.0 to 90.0)  0:28 left";
        assert_eq!(display.line(Duration::from_secs(2)), expected);
    }
}
