//! The recorded instruction counts in `benches/instructions.csv`: a change that makes the engine execute more
//! instructions fails in CI. Counts are the same in every run, up to 0.01 %, so this needs no quiet machine.
//!
//! They depend on the compiler and on the instruction set of the processor, so these conditions are recorded
//! too, and every check says which of them differ.

use crate::instructions::{CountError, per_fork_and_unit, per_unit_tick, under_valgrind};
use smaclite_cli::bench::policy::Policy;
use smaclite_scenarios::Scenario;
use std::error::Error;
use std::fmt::Write;
use std::process::Command;

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/instructions.csv");

/// Steps per scenario and policy, from seed 1 on: episodes end and begin in most scenarios.
const STEPS: usize = 200;

/// A count may grow by this share of the recorded count.
const TOLERANCE: f64 = 0.03;

/// What is counted in a scenario.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Work {
    /// Steps with this policy, per living unit and tick.
    Steps(Policy),
    /// Forks, per unit.
    Forks,
}

impl Work {
    const ALL: [Work; 3] = [Work::Steps(Policy::Nearest), Work::Steps(Policy::Random), Work::Forks];

    fn name(self) -> String {
        match self {
            Work::Steps(policy) => policy.name(),
            Work::Forks => "fork".to_owned(),
        }
    }

    fn count(self, scenario: &str) -> Result<f64, CountError> {
        match self {
            Work::Steps(policy) => per_unit_tick(scenario, policy, STEPS),
            Work::Forks => per_fork_and_unit(scenario, STEPS),
        }
    }
}

/// What a count is of.
type Play = (String, Work);

/// Counts, and the conditions under which they were counted.
#[derive(Debug, PartialEq)]
struct Recorded {
    /// Names and values.
    conditions: Vec<(String, String)>,
    /// Instructions per living unit and tick, of forks per unit.
    counts: Vec<(Play, f64)>,
}

/// Counts everything and writes the file.
pub(crate) fn record() -> Result<(), Box<dyn Error>> {
    let plays = all_plays();
    let counts = count_all(&plays)?;
    let recorded = Recorded { conditions: conditions()?, counts: plays.into_iter().zip(counts).collect() };
    std::fs::write(FILE, recorded.write()).map_err(|error| format!("{FILE}: {error}"))?;
    println!("wrote {FILE}");
    Ok(())
}

/// Counts again, and fails if a count has grown. No scenarios means all.
pub(crate) fn check(scenarios: &[String]) -> Result<(), Box<dyn Error>> {
    let text = std::fs::read_to_string(FILE).map_err(|error| format!("{FILE}: {error}"))?;
    let recorded = Recorded::parse(&text)?;
    let plays: Vec<Play> = all_plays()
        .into_iter()
        .filter(|(scenario, _)| scenarios.is_empty() || scenarios.contains(scenario))
        .collect();
    if let Some(unknown) = scenarios.iter().find(|name| !plays.iter().any(|(scenario, _)| scenario == *name))
    {
        return Err(format!("{FILE} has no counts of `{unknown}`; it has those of standard scenarios").into());
    }
    let counts = count_all(&plays)?;
    let now = Recorded { conditions: conditions()?, counts: plays.into_iter().zip(counts).collect() };
    report(&compare(&recorded, &now), now.counts.len())
}

fn report(comparison: &Comparison, counts: usize) -> Result<(), Box<dyn Error>> {
    if !comparison.smaller.is_empty() {
        println!("fewer instructions than recorded; `just figures instructions --record` keeps the gain:");
        print!("{}", comparison.smaller);
    }
    if comparison.larger.is_empty() {
        println!("none of {counts} counts exceeds its record by more than {} %", TOLERANCE * 100.0);
        print!("{}", comparison.conditions);
        return Ok(());
    }
    Err(format!(
        "more instructions than recorded in benches/instructions.csv:\n{}\
         Find the cause: `just figures instructions SCENARIO --policy POLICY` shows the phases of a step.\n\
         If the growth is intended, record it with `just figures instructions --record` and give the reason \
         in the commit message.\n{}",
        comparison.larger,
        comparison.conditions.trim_end()
    )
    .into())
}

/// All standard scenarios and two generated ones with both policies, and their forks.
fn all_plays() -> Vec<Play> {
    let names = Scenario::standard_names().chain(["protoss_5_vs_5", "zerg_20_vs_23"]);
    names.flat_map(|name| Work::ALL.map(|work| (name.to_owned(), work))).collect()
}

/// Counts on all cores.
fn count_all(plays: &[Play]) -> Result<Vec<f64>, Box<dyn Error>> {
    let cores = std::thread::available_parallelism()?.get();
    let mut counts = Vec::with_capacity(plays.len());
    for plays in plays.chunks(cores) {
        let results: Vec<Result<f64, CountError>> = std::thread::scope(|scope| {
            let count = |(scenario, work): &Play| work.count(scenario);
            let threads: Vec<_> = plays.iter().map(|play| scope.spawn(move || count(play))).collect();
            threads.into_iter().map(|thread| thread.join().expect("counting does not panic")).collect()
        });
        for (result, (scenario, work)) in results.into_iter().zip(plays) {
            counts.push(result.map_err(|error| format!("{scenario}, {}: {error}", work.name()))?);
        }
    }
    Ok(counts)
}

/// What changes counts although the code is the same.
fn conditions() -> Result<Vec<(String, String)>, Box<dyn Error>> {
    let compiler = Command::new("rustc").arg("--version").output().map_err(|e| format!("rustc: {e}"))?;
    let processor = under_valgrind(&["-q", "--tool=none"], &["extensions"])?.output();
    let processor = processor.map_err(CountError::NotStarted)?;
    let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).trim().to_owned();
    Ok([
        ("compiler", text(compiler.stdout)),
        ("compiled for", compiled_for()),
        ("extensions of the processor", text(processor.stdout)),
        ("steps per count", STEPS.to_string()),
    ]
    .map(|(name, value)| (name.to_owned(), value))
    .to_vec())
}

fn compiled_for() -> String {
    let level = match (cfg!(target_feature = "sse4.2"), cfg!(target_feature = "avx2")) {
        (_, true) => " with AVX2",
        (true, false) => " with SSE4.2",
        (false, false) => "",
    };
    format!("{}{level}", std::env::consts::ARCH)
}

/// Prints which extensions the processor has. Under valgrind, this is what code can use that chooses its
/// instructions at run time: valgrind hides AVX-512, and AVX2 if the machine does not have it.
pub(crate) fn print_extensions() {
    #[cfg(target_arch = "x86_64")]
    let extensions = [
        ("sse4.2", is_x86_feature_detected!("sse4.2")),
        ("avx2", is_x86_feature_detected!("avx2")),
        ("fma", is_x86_feature_detected!("fma")),
        ("avx512f", is_x86_feature_detected!("avx512f")),
    ];
    #[cfg(not(target_arch = "x86_64"))]
    let extensions: [(&str, bool); 0] = [];
    let present: Vec<_> = extensions.iter().filter(|(_, present)| *present).map(|(name, _)| *name).collect();
    println!("{}", if present.is_empty() { "none".to_owned() } else { present.join(" ") });
}

impl Recorded {
    fn write(&self) -> String {
        let mut text =
            "# Instructions per living unit and tick, of forks per unit; written by `just figures \
                        instructions --record`, compared by `--check`.
"
            .to_owned();
        for (name, value) in &self.conditions {
            let _ = writeln!(text, "# {name}: {value}");
        }
        text.push_str("scenario,work,instructions\n");
        for ((scenario, work), count) in &self.counts {
            let _ = writeln!(text, "{scenario},{},{count:.0}", work.name());
        }
        text
    }

    fn parse(text: &str) -> Result<Recorded, Box<dyn Error>> {
        let (header, rows): (Vec<_>, Vec<_>) = text.lines().partition(|line| line.starts_with('#'));
        let condition = |line: &str| line.trim_start_matches("# ").split_once(": ").map(owned);
        let counts = rows.iter().skip(1).map(|row| {
            parse_row(row).ok_or_else(|| format!("{FILE}: expected `scenario,work,count`, got `{row}`"))
        });
        Ok(Recorded {
            conditions: header.into_iter().filter_map(condition).collect(),
            counts: counts.collect::<Result<_, String>>()?,
        })
    }
}

fn owned((name, value): (&str, &str)) -> (String, String) {
    (name.to_owned(), value.to_owned())
}

fn parse_row(row: &str) -> Option<(Play, f64)> {
    let mut cells = row.split(',');
    let (scenario, work, count) = (cells.next()?, cells.next()?, cells.next()?);
    let work = Work::ALL.into_iter().find(|known| known.name() == work)?;
    Some(((scenario.to_owned(), work), count.parse().ok()?))
}

/// Lines about the counts that differ by more than the tolerance, and about the conditions that differ.
#[derive(Debug, Default)]
struct Comparison {
    larger: String,
    smaller: String,
    conditions: String,
}

fn compare(recorded: &Recorded, now: &Recorded) -> Comparison {
    let mut comparison = Comparison::default();
    for (play, count) in &now.counts {
        let (scenario, work) = (&play.0, play.1.name());
        let Some((_, before)) = recorded.counts.iter().find(|(recorded, _)| recorded == play) else {
            let _ = writeln!(comparison.larger, "  {scenario}, {work}: nothing recorded, {count:.1} now");
            continue;
        };
        let growth = count / before - 1.0;
        let lines = match growth {
            _ if growth > TOLERANCE => &mut comparison.larger,
            _ if growth < -TOLERANCE => &mut comparison.smaller,
            _ => continue,
        };
        let percent = growth * 100.0;
        let _ =
            writeln!(lines, "  {scenario}, {work}: {before:.1} recorded, {count:.1} now, {percent:+.1} %");
    }
    for (name, value) in &now.conditions {
        let before = recorded.conditions.iter().find(|(recorded, _)| recorded == name);
        let before = before.map_or("unknown", |(_, value)| value);
        if before != value {
            let _ = writeln!(
                comparison.conditions,
                "note: {name}: recorded with `{before}`, here `{value}`; counts may differ for this reason"
            );
        }
    }
    comparison
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counted(compiler: &str, nearest: f64, random: f64) -> Recorded {
        let play = |policy| ("2s3z".to_owned(), Work::Steps(policy));
        Recorded {
            conditions: vec![owned(("compiler", compiler)), owned(("steps per count", "200"))],
            counts: vec![(play(Policy::Nearest), nearest), (play(Policy::Random), random)],
        }
    }

    #[test]
    fn growth_of_four_percent_fails_and_of_two_percent_passes() {
        let recorded = counted("rustc 1", 1000.0, 2000.0);
        let two = compare(&recorded, &counted("rustc 1", 1020.0, 2040.0));
        assert_eq!((two.larger, two.smaller, two.conditions), Default::default());
        let four = compare(&recorded, &counted("rustc 1", 1040.0, 2000.0));
        assert_eq!(four.larger, "  2s3z, nearest: 1000.0 recorded, 1040.0 now, +4.0 %\n");
        assert_eq!((four.smaller, four.conditions), Default::default());
    }

    #[test]
    fn what_shrinks_is_a_hint_and_what_is_not_recorded_fails() {
        let mut recorded = counted("rustc 1", 1000.0, 2000.0);
        let shrunk = compare(&recorded, &counted("rustc 1", 1000.0, 1500.0));
        assert_eq!(shrunk.larger, "");
        assert_eq!(shrunk.smaller, "  2s3z, random: 2000.0 recorded, 1500.0 now, -25.0 %\n");
        recorded.counts.pop();
        let new = compare(&recorded, &counted("rustc 1", 1000.0, 1500.0));
        assert_eq!(new.larger, "  2s3z, random: nothing recorded, 1500.0 now\n");
    }

    #[test]
    fn another_compiler_is_named() {
        let recorded = counted("rustc 1", 1000.0, 2000.0);
        let conditions = compare(&recorded, &counted("rustc 2", 1000.0, 2000.0)).conditions;
        assert!(conditions.starts_with("note: compiler: recorded with `rustc 1`, here `rustc 2`"));
        assert_eq!(conditions.lines().count(), 1);
    }

    #[test]
    fn the_file_is_read_as_it_was_written() {
        let recorded = counted("rustc 1", 1000.0, 2000.0);
        assert_eq!(Recorded::parse(&recorded.write()).unwrap(), recorded);
        assert!(Recorded::parse("scenario,work,instructions\n2s3z,furthest,1.0\n").is_err());
    }

    #[test]
    fn every_standard_scenario_is_recorded() {
        let recorded = Recorded::parse(include_str!("../instructions.csv")).unwrap();
        let plays: Vec<Play> = recorded.counts.into_iter().map(|(play, _)| play).collect();
        assert_eq!(plays, all_plays());
    }
}
