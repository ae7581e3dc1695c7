//! Tests that check nothing on this machine, because the user or the kernel does not permit what they need.
//! Rust's test harness counts them as passed, so they say it themselves.

use std::io::Write;

/// A folder where every process of a test run notes which of its tests were skipped; `.ci/skipped.py` reads
/// it.
const LOG_VARIABLE: &str = "SMACLITE_TEST_LOG";

/// Prints that the running test is skipped, also where the harness shows only the output of failed tests, and
/// notes it for the end of the run. The test returns then.
///
/// # Panics
/// If the note cannot be written.
pub fn skip(reason: &str) {
    let thread = std::thread::current();
    let name = thread.name().unwrap_or("a test");
    let mut stderr = std::io::stderr(); // not `eprintln`, which the harness keeps
    let _ = writeln!(stderr, "skipped {name}: {reason}");
    let Some(folder) = std::env::var_os(LOG_VARIABLE) else { return };
    let path = std::path::Path::new(&folder).join(format!("{}.tsv", std::process::id()));
    let file = std::fs::File::options().create(true).append(true).open(path);
    file.and_then(|mut file| writeln!(file, "skipped\trust::{name}\t{reason}"))
        .expect("a note of a skipped test");
}
