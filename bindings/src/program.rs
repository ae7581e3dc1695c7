//! The `smaclite-pool` program, run from Python.

use pyo3::prelude::*;
use std::ffi::OsString;

/// Run the `smaclite-pool` program in this process and return its exit status.
///
/// `args[0]` is the name or path of the program. The program handles Ctrl-C itself, so SIGINT must have its
/// default action (`signal.SIG_DFL`), as in `python -m smaclite_pool`.
#[pyfunction]
pub fn run_program(py: Python<'_>, args: Vec<OsString>) -> i32 {
    let host = [("Python", Python::version_str().to_owned()), ("NumPy", numpy(py))];
    py.detach(|| smaclite_cli::run(args, &host))
}

fn numpy(py: Python<'_>) -> String {
    let version = py.import("numpy").and_then(|numpy| numpy.getattr("__version__")?.extract());
    version.unwrap_or_else(|error| error.to_string())
}
