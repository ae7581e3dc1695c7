//! Number of instructions of the phases of a step, counted by callgrind (`valgrind` must be installed).
//!
//! The phases of the engine are not inlined into each other, so each is a function in callgrind's output.

use crate::engine::{Plays, record};
use smaclite_benches::play::{Player, Policy, Recording};
use std::collections::HashMap;
use std::error::Error;
use std::process::Command;

/// The phases of a step as columns: the name of each, and how the name of its function ends. Those of a tick
/// have the names of the engine's modules.
const PHASES: [(&str, &str); 10] = [
    ("order", "battle::Battle::set_execution_order"),
    ("targets", "tick::targets::drop_lost"),
    ("preferred", "tick::preferred::decide"),
    ("avoid", "tick::avoid::plan_velocities"),
    ("execute", "tick::execute::take_turns"),
    ("deaths", "tick::deaths::remove_dead"),
    ("masks", "encode::avail::Available::update"),
    ("obs", "encode::obs::write_obs"),
    ("state", "encode::state::write_state"),
    ("avail", "encode::avail::Available::write"),
];

/// Prints the instructions of each phase per living unit and tick.
pub(crate) fn measure(plays: &Plays) -> Result<(), Box<dyn Error>> {
    println!("instructions per living unit and tick, policy {}, {} steps", plays.policy.name(), plays.steps);
    print!("{:16} {:>9}", "scenario", "all");
    PHASES.iter().for_each(|(phase, _)| print!(" {phase:>9}"));
    println!(" {:>9}", "rest");
    for scenario in plays.scenarios() {
        let unit_ticks = record(&scenario, plays.policy, plays.steps)?.1.unit_ticks() as f64;
        let counts = count(&scenario, plays)?;
        let total = counts.of("instructions::play_counted");
        let phases = PHASES.map(|(_, function)| counts.of(function));
        print!("{scenario:16} {:9.0}", total / unit_ticks);
        phases.iter().for_each(|count| print!(" {:9.1}", count / unit_ticks));
        println!(" {:9.1}", (total - phases.iter().sum::<f64>()) / unit_ticks);
    }
    Ok(())
}

/// Plays once, in the process that callgrind runs.
pub(crate) fn play_once(scenario: &str, policy: Policy, steps: usize) -> Result<(), Box<dyn Error>> {
    let (mut player, recording) = record(scenario, policy, steps)?;
    play_counted(&mut player, &recording);
    Ok(())
}

/// Not inlined: callgrind counts inside this function only.
#[inline(never)]
fn play_counted(player: &mut Player, recording: &Recording) {
    player.play(recording);
}

fn count(scenario: &str, plays: &Plays) -> Result<Counts, Box<dyn Error>> {
    let file = std::env::temp_dir().join(format!("callgrind-{}", std::process::id()));
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--toggle-collect=*instructions::play_counted*"])
        .arg(format!("--callgrind-out-file={}", file.display()))
        .arg(std::env::current_exe()?)
        .args(["second", "play", scenario, &plays.policy.name(), &plays.steps.to_string()])
        .output()
        .map_err(|error| format!("valgrind cannot be started ({error}); install it to count instructions"))?;
    if !output.status.success() {
        return Err(format!("valgrind: {}", String::from_utf8_lossy(&output.stderr)).into());
    }
    let text = std::fs::read(&file)?;
    std::fs::remove_file(&file)?;
    Ok(Counts::parse(&String::from_utf8_lossy(&text)))
}

/// Instructions by function, including the functions that it called.
struct Counts(HashMap<String, f64>);

impl Counts {
    /// Reads callgrind's output. Lines with costs follow the name of their function; the line after `calls=`
    /// has the whole cost of a call.
    fn parse(text: &str) -> Counts {
        let (mut names, mut counts) = (HashMap::new(), HashMap::<String, f64>::new());
        let mut function = String::new();
        for line in text.lines() {
            if let Some(name) = line.strip_prefix("fn=") {
                function = full_name(name, &mut names);
            } else if let Some(name) = line.strip_prefix("cfn=") {
                full_name(name, &mut names);
            } else if line.starts_with(|first: char| first.is_ascii_digit() || "+-*".contains(first)) {
                let cost = line.split_whitespace().nth(1).and_then(|cost| cost.parse::<f64>().ok());
                *counts.entry(function.clone()).or_default() += cost.unwrap_or(0.0);
            }
        }
        Counts(counts)
    }

    fn of(&self, function: &str) -> f64 {
        self.0.iter().filter(|(name, _)| name.ends_with(function)).map(|(_, count)| count).sum()
    }
}

/// A name is written in full where it first appears, `(7) name`, and as `(7)` later.
fn full_name(written: &str, names: &mut HashMap<String, String>) -> String {
    let (number, name) = written.split_once(' ').unwrap_or((written, ""));
    if !name.is_empty() {
        names.insert(number.to_owned(), name.to_owned());
    }
    names.get(number).cloned().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn callgrinds_output_is_read() {
        let text = "events: Ir\nfn=(1) a::b::outer\n10 5\n+1 7\ncfn=(2) a::inner\ncalls=3 20\n11 100\n\
                    fn=(2)\n20 100\nfn=(1)\n* 1\n";
        let counts = Counts::parse(text);
        assert_eq!([counts.of("b::outer"), counts.of("a::inner"), counts.of("other")], [113.0, 100.0, 0.0]);
    }
}
