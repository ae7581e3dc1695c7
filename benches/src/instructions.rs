//! Number of instructions of the phases of a step, counted by callgrind (`valgrind` must be installed). The
//! recorded counts, which no change may exceed, are in `recorded_instructions.rs`.
//!
//! The phases of the engine are not inlined into each other, so each is a function in callgrind's output.

use crate::engine::{Plays, record};
use smaclite_cli::bench::policy::Policy;
use smaclite_engine::{Arena, Battle, RecordLayout, RecordSizes, Rules, Scratch, Snapshot};
use smaclite_lab::{ActionTrace, TracePlayer};
use smaclite_scenarios::{Scenario, ScenarioError};
use std::collections::HashMap;
use std::error::Error;
use std::process::{Command, Stdio};
use std::sync::Arc;

/// The phases of a step as columns: the name of each, and how the name of its function ends. Those of a
/// tick have the names of the engine's modules; `move` and `hits` are of rules `starcraft`.
const PHASES: [(&str, &[&str]); 15] = [
    ("order", &["battle::Battle::set_execution_order"]),
    ("targets", &["tick::targets::drop_lost", "starcraft::choice::choose_targets"]),
    ("preferred", &["tick::preferred::decide", "starcraft::walk::prefer"]),
    ("avoid", &["tick::avoid::plan_velocities", "starcraft::detours::take", "starcraft::bodies::push_apart"]),
    ("move", &["starcraft::walk::move_all"]),
    (
        "hits",
        &[
            "starcraft::choice::remember",
            "starcraft::choice::alarm",
            "starcraft::hits::land",
            "starcraft::hits::explode_killed",
        ],
    ),
    ("execute", &["tick::execute::take_turns", "starcraft::attack::act"]),
    ("deaths", &["tick::deaths::remove_dead"]),
    ("look", &["battle::perceiver::Perceiver::look"]),
    ("perceive", &["smacv2::perception::<impl smaclite_engine::smacv2::Interface>::perceive"]),
    ("masks", &["encode::avail::Available::update", "Interface>::write_available"]),
    ("tables", &["encode::unit_tables::UnitTables::update"]),
    ("obs", &["encode::obs::write_obs", "Interface>::write_obs"]),
    ("state", &["encode::state::write_state", "Interface>::write_state"]),
    ("avail", &["encode::avail::Available::write"]),
];

/// Prints the instructions of each phase per living unit and tick.
pub(crate) fn measure(plays: &Plays) -> Result<(), Box<dyn Error>> {
    println!("instructions per living unit and tick, policy {}, {} steps", plays.policy.name(), plays.steps);
    print!("{:16} {:>9}", "scenario", "all");
    PHASES.iter().for_each(|(phase, _)| print!(" {phase:>9}"));
    println!(" {:>9}", "rest");
    for scenario in plays.scenarios() {
        let unit_ticks = record(&scenario, plays.rules, plays.policy, plays.steps)?.1.unit_ticks() as f64;
        let counts = count(&scenario, plays.rules, plays.policy, plays.steps)?;
        let total = counts.total();
        let phases =
            PHASES.map(|(_, functions)| functions.iter().map(|function| counts.of(function)).sum::<f64>());
        print!("{scenario:16} {:9.0}", total / unit_ticks);
        phases.iter().for_each(|count| print!(" {:9.1}", count / unit_ticks));
        println!(" {:9.1}", (total - phases.iter().sum::<f64>()) / unit_ticks);
    }
    Ok(())
}

/// All instructions per living unit and tick.
pub(crate) fn per_unit_tick(scenario: &str, policy: Policy, steps: usize) -> Result<f64, CountError> {
    let unit_ticks = record(scenario, Rules::default(), policy, steps)?.1.unit_ticks() as f64;
    Ok(count(scenario, Rules::default(), policy, steps)?.total() / unit_ticks)
}

/// Why there is no count.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CountError {
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    #[error("valgrind cannot be started ({0}); install it to count instructions")]
    NotStarted(#[source] std::io::Error),
    #[error("valgrind: {0}")]
    Failed(String),
    #[error("callgrind's output cannot be read: {0}")]
    Output(#[from] std::io::Error),
    #[error("callgrind counted nothing: its output does not have the function `{COUNTED}`")]
    NothingCounted,
}

/// Plays once, in the process that callgrind runs.
pub(crate) fn play_once(
    scenario: &str,
    rules: Rules,
    policy: Policy,
    steps: usize,
) -> Result<(), Box<dyn Error>> {
    let (mut player, trace) = record(scenario, rules, policy, steps)?;
    play_counted(&mut player, &trace, &mut Scratch::new());
    Ok(())
}

/// How the names of [`play_counted`] and [`play_counted_fork`] end.
const COUNTED: &str = "instructions::play_counted";
const COUNTED_FORK: &str = "instructions::play_counted_fork";

/// Not inlined: callgrind counts inside this function only.
#[inline(never)]
fn play_counted(player: &mut TracePlayer, trace: &ActionTrace, scratch: &mut Scratch) {
    player.play(trace, scratch);
}

/// This program as `second` under valgrind. glibc chooses `memcpy` by the processor, which changes counts by
/// up to 0.6 %; here the choice is the same everywhere.
pub(crate) fn under_valgrind(options: &[&str], second: &[&str]) -> Result<Command, CountError> {
    let mut command = Command::new("valgrind");
    command.args(options).arg(std::env::current_exe()?).arg("second").args(second);
    command.env("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-AVX2,-AVX2_Usable,-ERMS,-FSRM");
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    Ok(command)
}

/// What a fork costs the worker that does it, once `steps` times, in the process that callgrind runs: the
/// state is saved, another battle takes it, and writes its snapshot.
pub(crate) fn fork_once(scenario: &str, forks: usize) -> Result<(), Box<dyn Error>> {
    let arena = Arc::new(Arena::new(&Scenario::resolve(scenario)?, Rules::default()));
    let layout = RecordLayout::new(RecordSizes::new(&arena.sizes(), 0));
    let [mut from, mut to] = [1, 2].map(|seed| Battle::new(Arc::clone(&arena), seed));
    let (mut scratch, mut snapshot, mut record) =
        (Scratch::new(), Snapshot::default(), vec![0; layout.size()]);
    let east: Vec<i32> = vec![4; arena.sizes().n_agents];
    from.step(&east, &mut scratch)?;
    for _ in 0..forks {
        play_counted_fork(&from, &mut to, &mut snapshot, &layout, &mut record);
    }
    Ok(())
}

/// As [`play_counted`].
#[inline(never)]
fn play_counted_fork(
    from: &Battle,
    to: &mut Battle,
    snapshot: &mut Snapshot,
    layout: &RecordLayout,
    record: &mut [u8],
) {
    from.save_into(snapshot);
    to.restore_checked(snapshot);
    to.write_record(layout, &[], record);
}

/// Instructions of a fork per unit.
pub(crate) fn per_fork_and_unit(scenario: &str, forks: usize) -> Result<f64, CountError> {
    let n_units = Scenario::resolve(scenario)?.units.len();
    let counts = count_second(&["fork", scenario, &forks.to_string()])?;
    Ok(counts.total() / (n_units * forks) as f64)
}

fn count(scenario: &str, rules: Rules, policy: Policy, steps: usize) -> Result<Counts, CountError> {
    count_second(&["play", scenario, &rules.to_string(), &policy.name(), &steps.to_string()])
}

/// The counts of this program as `second`.
fn count_second(second: &[&str]) -> Result<Counts, CountError> {
    let folder = std::env::temp_dir();
    let options = [
        "--tool=callgrind",
        &format!("--toggle-collect=*{COUNTED}*"),
        &format!("--callgrind-out-file={}/callgrind-%p", folder.display()), // %p: id of the process
    ];
    let child = under_valgrind(&options, second)?.spawn().map_err(CountError::NotStarted)?;
    let file = folder.join(format!("callgrind-{}", child.id()));
    let output = child.wait_with_output()?;
    if !output.status.success() {
        return Err(CountError::Failed(String::from_utf8_lossy(&output.stderr).into_owned()));
    }
    let text = std::fs::read(&file)?;
    std::fs::remove_file(&file)?;
    let counts = Counts::parse(&String::from_utf8_lossy(&text));
    if counts.total() > 0.0 { Ok(counts) } else { Err(CountError::NothingCounted) }
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

    /// Everything that was counted.
    fn total(&self) -> f64 {
        self.of(COUNTED) + self.of(COUNTED_FORK)
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
