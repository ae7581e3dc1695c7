//! Waiting without the interpreter: other Python threads run meanwhile, and Ctrl-C or the interpreter's end
//! ends the wait.

use crate::errors;
use crate::exit::{cut_short, is_exiting};
use pyo3::prelude::*;
use smaclite_ipc::{ClientError, Patience};
use std::time::Duration;

/// Runs a wait of a client detached from the interpreter; a signal handler's exception ends it.
pub fn waiting<T: Send>(
    py: Python<'_>,
    timeout: Option<Duration>,
    wait: impl FnOnce(Patience<'_>) -> Result<T, ClientError> + Send,
) -> PyResult<T> {
    let mut raised = None;
    let outcome = py.detach(|| {
        let mut interrupted = || {
            let signals = || Python::attach(|py| py.check_signals()).err();
            raised = if is_exiting() { Some(cut_short()) } else { signals() };
            raised.is_some()
        };
        wait(Patience { timeout, interrupted: &mut interrupted })
    });
    match raised {
        Some(error) => Err(error),
        None => outcome.map_err(errors::of_client),
    }
}
