//! `train` of several seeds: one line with the progress of all.

use super::display::{Lines, evaluation, json_of, minutes};
use crate::{CommandResult, runtime_dir};
use serde_json::Value;
use smaclite_learn::{Record, RunDescription, SeedEvent, Seeds};
use std::collections::BTreeMap;
use std::error::Error;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Trains the runs and shows how far they are.
pub(super) fn train(
    runs: &Seeds,
    steps: Option<u64>,
    threads: usize,
    json: bool,
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
    match display.error.take() {
        Some(error) => Err(error.into()),
        None => display.end(interrupted()),
    }
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
    /// The last record by seed.
    records: BTreeMap<u64, Record>,
    /// Time and steps of the first event, from which the time that is left is estimated.
    first: Option<(Instant, u64)>,
    error: Option<io::Error>,
}

impl Display {
    fn new(runs: &Seeds, steps: Option<u64>, json: bool) -> Result<Display, Box<dyn Error>> {
        let (mut total, mut name) = (0, String::new());
        for (_, folder) in runs.runs() {
            let run = RunDescription::read(folder)?;
            total += steps.unwrap_or(run.config.steps);
            name = run.name;
        }
        let (lines, records) = (Lines::new(), BTreeMap::new());
        let seeds = runs.runs().len();
        Ok(Display {
            json,
            lines,
            name,
            total,
            seeds,
            complete: 0,
            ended: 0,
            records,
            first: None,
            error: None,
        })
    }

    fn show(&mut self, seed: u64, event: SeedEvent) -> CommandResult {
        match event {
            SeedEvent::Updated(record) => {
                self.records.insert(seed, record);
                if self.json {
                    let mut object = json_of(&record);
                    object.insert("seed".to_owned(), seed.into());
                    out!("{}", Value::Object(object))?;
                    return Ok(());
                }
                let line = self.line();
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

    fn line(&mut self) -> String {
        let steps: u64 = self.records.values().map(|record| record.steps).sum();
        let (begin, first_steps) = *self.first.get_or_insert((Instant::now(), steps));
        let per_s = steps.saturating_sub(first_steps) as f64 / begin.elapsed().as_secs_f64().max(1e-9);
        let left = minutes(self.total.saturating_sub(steps) as f64 / per_s);
        let rates = self.records.values().map(|record| 100.0 * record.win_rate);
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
