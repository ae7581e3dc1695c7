//! The `smaclite-pool` program: one file a command. Also reached from Python as `python -m smaclite_pool`.

/// Prints a line; an error if nobody reads it any more, where `println!` would panic.
macro_rules! out {
    ($($part:tt)*) => {{
        use std::io::Write as _;
        writeln!(std::io::stdout(), $($part)*)
    }};
}

mod bench;
mod check;
mod clean;
mod list;
mod scenarios;
mod serve;

use crate::runtime_dir::RuntimeDir;
use clap::{Parser, Subcommand};
use std::error::Error;
use std::ffi::OsString;

/// What a command returns: nothing, or a reason that is printed as one line.
type Outcome = Result<(), Box<dyn Error>>;

/// Battles for multi-agent reinforcement learning, served to learners through shared memory.
#[derive(Parser)]
#[command(name = "smaclite-pool", version, max_term_width = 100)]
struct Cli {
    /// Log more: info, debug or trace; a filter as in RUST_LOG works too
    #[arg(long, global = true, value_name = "LEVEL", default_value = "warn", env = "SMACLITE_POOL_LOG")]
    log: String,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Run a pool that learners attach to
    Serve(serve::Serve),
    /// List the standard scenarios
    Scenarios(scenarios::Scenarios),
    /// Validate scenario and unit files
    Check(check::Check),
    /// List the pools on this machine and their lanes
    List(list::List),
    /// Show one pool: learners, speed, episodes, win rate
    Status(list::Status),
    /// Remove what dead pools left behind
    Clean(clean::Clean),
    /// Measure steps per second
    Bench(bench::Bench),
}

/// Runs the program with `args` (the first is the program's name) and returns its exit status: 0 done, 1
/// failed, 2 wrong usage.
pub fn run(args: impl IntoIterator<Item = OsString>) -> i32 {
    let cli = match Cli::try_parse_from(args) {
        Ok(cli) => cli,
        Err(error) => {
            let _ = error.print(); // a closed terminal hears nothing
            return error.exit_code();
        }
    };
    log_to_stderr(&cli.log);
    let outcome = match cli.command {
        Command::Serve(serve) => serve.run(),
        Command::Scenarios(scenarios) => scenarios.run(),
        Command::Check(check) => check.run(),
        Command::List(list) => list.run(),
        Command::Status(status) => status.run(),
        Command::Clean(clean) => clean.run(),
        Command::Bench(bench) => bench.run(),
    };
    match outcome {
        Ok(()) => 0,
        Err(error) if is_broken_pipe(error.as_ref()) => 0, // `smaclite-pool scenarios | head`
        Err(error) => {
            eprintln!("smaclite-pool: {error}");
            1
        }
    }
}

fn is_broken_pipe(error: &(dyn Error + 'static)) -> bool {
    error.downcast_ref::<std::io::Error>().is_some_and(|e| e.kind() == std::io::ErrorKind::BrokenPipe)
}

fn log_to_stderr(filter: &str) {
    let filter = tracing_subscriber::EnvFilter::new(filter);
    let subscriber = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr);
    let _ = subscriber.try_init(); // a second call in one process, as from Python, keeps the first
}

fn runtime_dir() -> Result<RuntimeDir, Box<dyn Error>> {
    Ok(RuntimeDir::for_current_user()?)
}

/// `1234567` bytes as `1.2 MB`.
fn megabytes(bytes: usize) -> String {
    format!("{:.1} MB", bytes as f64 / 1e6)
}

/// Prints rows as columns of equal width, the first row being the heading.
fn print_table(rows: &[Vec<String>]) -> std::io::Result<()> {
    use std::io::Write;
    let columns = rows.first().map_or(0, Vec::len);
    let width = |c: usize| rows.iter().map(|row| row[c].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let mut out = std::io::stdout().lock();
    for row in rows {
        let cells = row.iter().zip(&widths).map(|(cell, w)| format!("{cell:<w$}"));
        writeln!(out, "{}", cells.collect::<Vec<_>>().join("  ").trim_end())?;
    }
    Ok(())
}

/// The headings of a table.
fn heading<const N: usize>(words: [&str; N]) -> Vec<String> {
    words.map(str::to_owned).to_vec()
}
