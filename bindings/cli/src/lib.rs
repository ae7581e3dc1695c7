//! The `smaclite-pool` program, one file per command. `python -m smaclite_pool` runs it too.

#![forbid(unsafe_code)]

/// Prints a line. A closed standard output is an error here, not a panic as in `println!`.
macro_rules! out {
    ($($part:tt)*) => {{
        use std::io::Write as _;
        writeln!(crate::output::Output, $($part)*)
    }};
}

/// Prints a line to standard error. One that is closed or full is no reason to end, as in `eprintln!`.
macro_rules! err {
    ($($part:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), $($part)*);
    }};
}

mod adapt;
pub mod bench;
mod check;
mod clean;
mod completions;
mod csv;
mod dataset;
mod doctor;
mod edit;
mod evaluate;
mod exploit;
mod files;
mod licences;
mod list;
mod man;
mod new;
mod number;
mod opponent;
mod os;
mod output;
mod picture;
mod play;
pub mod process;
mod record;
mod replay;
mod report;
mod scenarios;
mod schema;
mod serve;
mod show;
mod snapshot;
mod svg;
mod table;
mod tournament;
mod train;
mod usage;
mod verify_run;
mod watch;
mod web;
mod zoo;

use clap::{Parser, Subcommand};
use smaclite_engine::Rules;
use smaclite_ipc::{RuntimeDir, RuntimeDirError};
use smaclite_units::file::{printable_text, without_os_errors};
use std::error::Error;
use std::ffi::{OsStr, OsString};
use std::io::{IsTerminal, Write};
use std::ops::RangeInclusive;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::layer::{Layer, SubscriberExt};
use tracing_subscriber::util::SubscriberInitExt;

/// What a command returns. An error is printed as one line, or one per problem of a file.
type CommandResult = Result<(), Box<dyn Error>>;

/// Battles for multi-agent reinforcement learning, served to learners through shared memory.
#[derive(Parser)]
#[command(name = "smaclite-pool", version, max_term_width = 100)]
struct Cli {
    /// Log level on standard error: error, warn, info, debug, trace or off; or a filter such as
    /// `warn,smaclite_pool=debug`
    #[arg(long, global = true, value_name = "LEVEL", default_value = "warn", env = "SMACLITE_POOL_LOG",
        value_parser = usage::log_filter)]
    log: Targets,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Run a pool that learners attach to
    Serve(serve::Serve),
    /// List the standard scenarios and their sizes
    Scenarios(scenarios::Scenarios),
    /// Write a valid scenario or unit file to start from
    New(new::New),
    /// Validate scenario and unit files
    Check(check::Check),
    /// Print the JSON Schema of scenario or unit files, for editors
    Schema(schema::Schema),
    /// Edit a scenario in the browser
    Edit(edit::Edit),
    /// Draw a scenario or a snapshot as a map of characters or a picture
    Show(show::Show),
    /// Write a replay: of battles of a scripted policy, or of a running pool
    Record(record::Record),
    /// Verify a replay, or convert it to a page, an animation or pictures
    Replay(replay::Replay),
    /// Train a team
    Train(Box<train::Train>),
    /// Play a trained team: win rate and return
    Evaluate(evaluate::Evaluate),
    /// Write a team that plays every map as a team of one map
    Adapt(adapt::Adapt),
    /// Play the recorded evaluations of a run again, and compare every number
    VerifyRun(verify_run::VerifyRun),
    /// Compare runs of several seeds and algorithms: curves, intervals, tables, metrics.json
    Report(report::WriteReport),
    /// List the trained teams that are part of the program
    Zoo(zoo::Zoo),
    /// Play against a script or a trained team, in the browser
    Play(play::Play),
    /// Play scripts and trained teams against each other: payoff matrix and Elo ratings
    Tournament(tournament::PlayTournament),
    /// Train best responses to a trained team: how much they win
    Exploit(exploit::Exploit),
    /// Record what policies play as a dataset for offline learning, expand and export it
    Dataset(dataset::DatasetCommand),
    /// List your pools on this machine, with their lanes and learners
    List(list::List),
    /// Show one pool: learners, steps per second, episodes, win rate
    Status(list::Status),
    /// Show the battles of a running pool in the browser
    Watch(watch::Watch),
    /// Remove the files that killed pools and learners left behind
    Clean(clean::Clean),
    /// Measure steps per second
    Bench(bench::Bench),
    /// Show what a bug report needs, and check that shared memory works here
    Doctor(doctor::Doctor),
    /// Print the script by which a shell completes commands
    Completions(completions::Completions),
    /// Print the man page of the program, or write one per command
    Man(man::Man),
    /// Print the licences of the software in this program
    Licences(licences::Licences),
}

/// A program or library that runs this one, and its version, for `doctor`.
pub type HostVersion = (&'static str, String);

/// Runs the program with these arguments, the first of which is the program's name or path, and returns its
/// exit status: 0 for success, 1 for failure, 2 for wrong usage, 128 + the signal's number for a command that
/// SIGINT or SIGTERM ended before it was complete. `host` is what it runs in, as Python.
pub fn run(args: impl IntoIterator<Item = OsString>, host: &[HostVersion]) -> i32 {
    os::report_large_files();
    process::forget_signals();
    process::end_with_first_process();
    let args: Vec<OsString> = args.into_iter().collect();
    let status = run_args(&args, host);
    // Within Python, an unfinished line would be lost at the end of the process.
    let _ = std::io::stdout().flush();
    status
}

fn run_args(args: &[OsString], host: &[HostVersion]) -> i32 {
    if let Some(status) = completions::answer(args) {
        return status;
    }
    let cli = match usage::parse(args) {
        Ok(cli) => cli,
        Err(error) => {
            usage::print_error(&error, args);
            return error.exit_code();
        }
    };
    log_to_stderr(cli.log);
    output::go_on_if_closed(cli.command.is_verdict());
    let Err(error) = cli.command.run(&args[0], host) else { return 0 };
    let is_closed = output::is_closed(error.as_ref()); // `smaclite-pool scenarios | head`
    if !is_closed && !error.is::<process::Interrupted>() {
        err!("smaclite-pool: {}", without_os_errors(&printable_text(&error.to_string())));
    }
    let otherwise = if is_closed { 0 } else { 1 };
    process::received_signal().map_or(otherwise, |signal| 128 + signal)
}

impl Command {
    /// Whether its exit status says what it found.
    fn is_verdict(&self) -> bool {
        use Command::{Check, Doctor, Replay, VerifyRun};
        matches!(self, Check(_) | Doctor(_) | Replay(_) | VerifyRun(_))
    }

    fn run(self, program: &OsStr, host: &[HostVersion]) -> CommandResult {
        match self {
            Command::Serve(serve) => serve.run(),
            Command::Scenarios(scenarios) => scenarios.run(),
            Command::New(new) => new.run(),
            Command::Check(check) => check.run(),
            Command::Schema(schema) => schema.run(),
            Command::Edit(edit) => edit.run(),
            Command::Show(show) => show.run(),
            Command::Record(record) => record.run(),
            Command::Replay(replay) => replay.run(),
            Command::Train(train) => train.run(),
            Command::Evaluate(evaluate) => evaluate.run(),
            Command::Adapt(adapt) => adapt.run(),
            Command::VerifyRun(verify_run) => verify_run.run(),
            Command::Report(report) => report.run(),
            Command::Zoo(zoo) => zoo.run(),
            Command::Play(play) => play.run(),
            Command::Tournament(tournament) => tournament.run(),
            Command::Exploit(exploit) => exploit.run(),
            Command::Dataset(dataset) => dataset.run(),
            Command::List(list) => list.run(),
            Command::Status(status) => status.run(),
            Command::Watch(watch) => watch.run(),
            Command::Clean(clean) => clean.run(),
            Command::Bench(bench) => bench.run(),
            Command::Doctor(doctor) => doctor.run(host),
            Command::Completions(completions) => completions.run(program),
            Command::Man(man) => man.run(),
            Command::Licences(licences) => licences.run(),
        }
    }
}

fn log_to_stderr(filter: Targets) {
    let layer = tracing_subscriber::fmt::layer().with_writer(std::io::stderr);
    let lines = layer.with_ansi(std::io::stderr().is_terminal()).with_filter(filter);
    // A second run in one process, as from Python, keeps the first subscriber.
    let _ = tracing_subscriber::registry().with(lines).try_init();
}

fn runtime_dir() -> Result<RuntimeDir, RuntimeDirError> {
    RuntimeDir::for_current_user()
}

/// What headings say of rules that are not the default.
fn other_rules(rules: Rules) -> String {
    if rules == Rules::default() { String::new() } else { format!(", rules {rules}") }
}

/// The number of worker threads that a pool may have.
const THREADS: RangeInclusive<usize> = 1..=1024;

/// `1234567` bytes as `1.2 MB`.
fn megabytes(bytes: usize) -> String {
    format!("{:.1} MB", bytes as f64 / 1e6)
}
