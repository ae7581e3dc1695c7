//! Lines of progress of `train`: one that changes in a terminal, or one every five seconds; and what is in
//! them.

use crate::CommandResult;
use crate::output::Output;
use serde_json::Value;
use smaclite_learn::{EvaluationRow, Record};
use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

/// How often a line is printed, if standard output is not a terminal.
const LINE_INTERVAL: Duration = Duration::from_secs(5);

/// The win rates of a team that plays itself, as far as there are any.
pub(super) fn by_enemies(record: &Record) -> String {
    let Some(self_play) = record.self_play else { return String::new() };
    let rates = [
        ("self", self_play.win_rate_self),
        ("league", self_play.win_rate_league),
        ("attack_move", self_play.win_rate_attack_move),
    ];
    let known = rates.into_iter().filter(|(_, rate)| !rate.is_nan());
    let parts: Vec<String> = known.map(|(name, rate)| format!("{name} {:.0} %", 100.0 * rate)).collect();
    format!(" ({})", parts.join(", "))
}

/// 95 seconds as `1:35`.
pub(super) fn minutes(seconds: f64) -> String {
    let seconds = seconds.min(1e9) as u64;
    format!("{}:{:02}", seconds / 60, seconds % 60)
}

/// A record as JSON, with the names of the log's columns.
pub(super) fn json_of(record: &Record) -> serde_json::Map<String, Value> {
    let number = |i, value: f64| if i < 3 { Value::from(value as u64) } else { Value::from(value) };
    let columns = record.columns().into_iter().enumerate();
    columns.map(|(i, (name, value))| (name.into_owned(), number(i, value))).collect()
}

/// The result of an evaluation in words.
pub(super) fn evaluation(row: &EvaluationRow) -> String {
    let [greedy, sampled] = [row.greedy, row.sampled].map(|summary| 100.0 * summary.win_rate);
    format!("evaluated at {} steps: wins {greedy:.1} % greedy, {sampled:.1} % sampled", row.steps)
}

/// A line that replaces the last one. A terminal that is not wide enough for it cuts it off: of a line that
/// is wrapped, the next one would replace the end alone.
fn in_place(line: &str) -> String {
    let [erase, no_wrap, wrap] = ["\r\x1b[K", "\x1b[?7l", "\x1b[?7h"];
    format!("{erase}{no_wrap}{line}{wrap}")
}

/// Lines of progress: one that changes in a terminal, or one every five seconds.
pub(super) struct Lines {
    terminal: bool,
    last_line: Option<Instant>,
    /// What was to be shown last, if it was not printed as a line.
    last: Option<String>,
}

impl Lines {
    pub(super) fn new() -> Lines {
        // One without escape sequences, as in an editor, gets lines.
        let is_dumb = std::env::var_os("TERM").is_some_and(|term| term == "dumb");
        Lines { terminal: std::io::stdout().is_terminal() && !is_dumb, last_line: None, last: None }
    }

    /// Shows a line that may be replaced by the next one.
    pub(super) fn show(&mut self, line: String) -> CommandResult {
        if self.terminal {
            write!(Output, "{}", in_place(&line))?;
            Output.flush()?;
        } else if self.last_line.is_none_or(|last| last.elapsed() >= LINE_INTERVAL) {
            out!("{line}")?;
            self.last_line = Some(Instant::now());
            self.last = None;
            return Ok(());
        }
        self.last = Some(line);
        Ok(())
    }

    /// Prints a line that stays.
    pub(super) fn keep(&self, line: &str) -> CommandResult {
        if self.terminal {
            write!(Output, "\r\x1b[K")?;
        }
        out!("{line}")?;
        Ok(())
    }

    /// Prints the last line, if it was not printed, and one with the end.
    pub(super) fn end(self, end: &str) -> CommandResult {
        match self.last {
            Some(line) if !self.terminal => out!("{line}")?,
            Some(_) => out!()?,
            None => {}
        }
        out!("{end}")?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A line of more columns than the terminal has was wrapped, and its first rows stayed.
    #[test]
    fn a_line_that_changes_is_not_wrapped() {
        assert_eq!(in_place("3m: 5 of 9 steps"), "\r\x1b[K\x1b[?7l3m: 5 of 9 steps\x1b[?7h");
    }
}
