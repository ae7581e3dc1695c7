//! Waiting without the interpreter: other Python threads run meanwhile, and Ctrl-C or the interpreter's end
//! ends the wait.

use crate::{errors, exit};
use pyo3::prelude::*;
use smaclite_ipc::{ClientError, WaitOptions};
use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// How often signal handlers run while work is waited for.
const CHECK_INTERVAL: Duration = Duration::from_millis(50);

/// What tells work that it was given up.
pub type GivenUp<'a> = &'a mut dyn FnMut() -> bool;

/// Does work that cannot be interrupted itself (reading files, creating and opening shared memory) in a
/// thread of its own, so that a signal handler's exception ends the wait for it at once. Work that is given
/// up is told so when it asks, and what it still yields is dropped.
pub fn apart<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(GivenUp<'_>) -> T + Send + 'static,
) -> PyResult<T> {
    let (sender, mut receiver) = channel();
    let given_up = Arc::new(AtomicBool::new(false));
    let asked = Arc::clone(&given_up);
    let thread = std::thread::Builder::new().name("smaclite-wait".to_owned()).spawn(move || {
        // The flag publishes nothing but itself.
        let _ = sender.send(work(&mut || asked.load(Ordering::Relaxed)));
    })?;
    loop {
        let outcome;
        (outcome, receiver) = py.detach(move || (receiver.recv_timeout(CHECK_INTERVAL), receiver));
        match outcome {
            Ok(outcome) => return Ok(outcome),
            Err(RecvTimeoutError::Timeout) => {
                if let Err(error) = look(py) {
                    given_up.store(true, Ordering::Relaxed);
                    exit::abandon(thread);
                    return Err(error);
                }
            }
            Err(RecvTimeoutError::Disconnected) => match thread.join() {
                Err(panic) => resume_unwind(panic),
                Ok(()) => unreachable!("a thread that does not panic sends its outcome"),
            },
        }
    }
}

/// Why a wait must end, if it must.
fn look(py: Python<'_>) -> PyResult<()> {
    if exit::is_exiting() { Err(exit::cut_short()) } else { py.check_signals() }
}

/// Runs a wait of a client detached from the interpreter; a signal handler's exception ends it.
pub fn waiting<T: Send>(
    py: Python<'_>,
    timeout: Option<Duration>,
    wait: impl FnOnce(WaitOptions<'_>) -> Result<T, ClientError> + Send,
) -> PyResult<T> {
    let mut raised = None;
    let outcome = py.detach(|| {
        let mut interrupted = || {
            raised = Python::attach(look).err();
            raised.is_some()
        };
        wait(WaitOptions { timeout, interrupted: &mut interrupted })
    });
    match raised {
        Some(error) => Err(error),
        None => outcome.map_err(errors::of_client),
    }
}
