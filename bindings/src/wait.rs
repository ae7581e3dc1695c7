//! Waiting detached from the interpreter, so that other Python threads run meanwhile. Ctrl-C and the exit of
//! the interpreter end every wait.

use crate::{errors, exit};
use pyo3::prelude::*;
use smaclite_ipc::{ClientError, WaitOptions};
use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// How often signal handlers run while [`run_on_thread`] waits.
const CHECK_INTERVAL: Duration = Duration::from_millis(50);

/// How long cancelled work may take to end before [`run_on_thread`] returns: until then a pool may still
/// grant what it was asked for, and the next call would find it taken.
const CANCEL_TIME: Duration = Duration::from_millis(100);

/// Returns `true` once the result of the work is no longer needed.
pub type IsCancelled<'a> = &'a mut dyn FnMut() -> bool;

/// Runs `work` on a new thread and waits for its result.
///
/// For work that cannot be interrupted: reading files, creating and opening shared memory. An exception from
/// a signal handler ends the wait nearly at once. The work can query whether it was cancelled; a result that
/// it still returns is dropped.
pub fn run_on_thread<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(IsCancelled<'_>) -> T + Send + 'static,
) -> PyResult<T> {
    let (sender, mut receiver) = channel();
    let cancelled = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&cancelled);
    let thread = std::thread::Builder::new().name("smaclite-wait".to_owned()).spawn(move || {
        // Relaxed: the flag publishes nothing but itself.
        let _ = sender.send(work(&mut || flag.load(Ordering::Relaxed)));
    })?;
    loop {
        let received;
        (received, receiver) = py.detach(move || (receiver.recv_timeout(CHECK_INTERVAL), receiver));
        match received {
            Ok(result) => return Ok(result),
            Err(RecvTimeoutError::Timeout) => {
                if let Err(error) = check_interrupts(py) {
                    cancelled.store(true, Ordering::Relaxed);
                    let _ = py.detach(move || receiver.recv_timeout(CANCEL_TIME));
                    exit::join_at_exit(thread);
                    return Err(error);
                }
            }
            Err(RecvTimeoutError::Disconnected) => match thread.join() {
                Err(panic) => resume_unwind(panic),
                Ok(()) => unreachable!("a thread that does not panic sends its result"),
            },
        }
    }
}

/// An error if the interpreter is exiting or a signal handler raised an exception.
pub fn check_interrupts(py: Python<'_>) -> PyResult<()> {
    if exit::is_exiting() { Err(exit::exiting_error()) } else { py.check_signals() }
}

/// Runs a wait of a client detached from the interpreter. An exception from a signal handler ends it.
pub fn wait_detached<T: Send>(
    py: Python<'_>,
    timeout: Option<Duration>,
    wait: impl FnOnce(WaitOptions<'_>) -> Result<T, ClientError> + Send,
) -> PyResult<T> {
    interruptible(py, |interrupted| wait(WaitOptions { timeout, interrupted }).map_err(errors::client_error))
}

/// Runs work detached from the interpreter that often calls its argument, and ends when that returns `true`:
/// a signal handler raised an exception, which is returned.
pub fn interruptible<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(IsCancelled<'_>) -> PyResult<T> + Send,
) -> PyResult<T> {
    let mut raised = None;
    let result = py.detach(|| {
        work(&mut || {
            raised = Python::attach(check_interrupts).err();
            raised.is_some()
        })
    });
    raised.map_or(result, Err)
}
