//! The `smaclite-pool` program, run from Python.

use pyo3::prelude::*;
use std::ffi::OsString;

/// Run the `smaclite-pool` program in this process and return its exit status.
///
/// `args[0]` is the program's name. The program handles SIGINT (Ctrl-C) itself: restore the signal's default
/// action before the call, as `python -m smaclite_pool` does.
#[pyfunction]
pub fn run_program(py: Python<'_>, args: Vec<OsString>) -> i32 {
    py.detach(|| smaclite_cli::run(args))
}
