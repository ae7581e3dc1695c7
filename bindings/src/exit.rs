//! Pools that are still open when the interpreter ends are closed, because objects may outlive it unfreed.

use crate::envs::Shared;
use pyo3::prelude::*;
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Locked only while attached to the interpreter, so that a fork never copies it locked.
static LIVE: Mutex<Vec<Weak<Shared>>> = Mutex::new(Vec::new());

/// Has `shared` closed at exit, if it lives then.
pub fn remember(shared: &Arc<Shared>) {
    let mut live = LIVE.lock().unwrap_or_else(PoisonError::into_inner);
    live.retain(|other| other.strong_count() > 0);
    live.push(Arc::downgrade(shared));
}

/// Registers with `atexit`.
pub fn close_at_exit(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let close_all = wrap_pyfunction!(close_all, module)?;
    module.py().import("atexit")?.call_method1("register", (close_all,))?;
    Ok(())
}

/// Threads whose work was given up, which may be about to take back what they made.
static ABANDONED: Mutex<Vec<JoinHandle<()>>> = Mutex::new(Vec::new());

/// How long the interpreter waits for them in the end.
const LAST_MOMENTS: Duration = Duration::from_secs(3);

/// Has the interpreter's end wait a little for `thread`.
pub fn abandon(thread: JoinHandle<()>) {
    let mut abandoned = ABANDONED.lock().unwrap_or_else(PoisonError::into_inner);
    abandoned.retain(|other| !other.is_finished());
    abandoned.push(thread);
}

fn wait_for_abandoned(threads: &[JoinHandle<()>]) {
    let begin = Instant::now();
    while begin.elapsed() < LAST_MOMENTS && threads.iter().any(|thread| !thread.is_finished()) {
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[pyfunction]
fn close_all(py: Python<'_>) {
    let abandoned = std::mem::take(&mut *ABANDONED.lock().unwrap_or_else(PoisonError::into_inner));
    py.detach(|| wait_for_abandoned(&abandoned));
    let live = std::mem::take(&mut *LIVE.lock().unwrap_or_else(PoisonError::into_inner));
    py.detach(|| {
        for shared in live.iter().filter_map(Weak::upgrade) {
            shared.close_if_idle();
        }
    });
}
