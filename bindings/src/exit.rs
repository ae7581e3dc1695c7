//! Pools that are still open when the interpreter ends are closed, because objects may outlive it unfreed:
//! also those that a daemon thread is using or making, which is frozen in the middle of that when the
//! interpreter is gone.

use crate::envs::Shared;
use crate::errors::class;
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Set when the interpreter ends: waits end, and no call begins.
static EXITING: AtomicBool = AtomicBool::new(false);

/// Calls of `make` and `connect` that may come to have something to close.
static BEGINNING: AtomicUsize = AtomicUsize::new(0);

/// Threads whose work was given up, which may be about to take back what they made.
static ABANDONED: Mutex<Vec<JoinHandle<()>>> = Mutex::new(Vec::new());

/// How long the end of the interpreter waits for other threads; their calls look for it every 100 ms.
const PATIENCE: Duration = Duration::from_secs(5);

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

/// Is the interpreter at its end?
pub fn is_exiting() -> bool {
    EXITING.load(Ordering::SeqCst)
}

/// The error of a call that the interpreter's end cut short.
pub fn cut_short() -> PyErr {
    class::Closed::new_err("the interpreter is at its end; these environments are closed")
}

/// Has the interpreter's end wait a little for `thread`.
pub fn abandon(thread: JoinHandle<()>) {
    let mut abandoned = ABANDONED.lock().unwrap_or_else(PoisonError::into_inner);
    abandoned.retain(|other| !other.is_finished());
    abandoned.push(thread);
}

/// Held by a call that makes something to close, until [`remember`] knows of it.
pub struct Beginning(());

impl Beginning {
    pub fn new() -> PyResult<Beginning> {
        // SeqCst: either the interpreter's end sees this call, or this call sees the end.
        BEGINNING.fetch_add(1, Ordering::SeqCst);
        let beginning = Beginning(());
        if is_exiting() { Err(cut_short()) } else { Ok(beginning) }
    }
}

impl Drop for Beginning {
    fn drop(&mut self) {
        BEGINNING.fetch_sub(1, Ordering::SeqCst);
    }
}

#[pyfunction]
fn close_all(py: Python<'_>) {
    EXITING.store(true, Ordering::SeqCst);
    let end = Instant::now() + PATIENCE;
    let until = |is_done: &dyn Fn() -> bool| {
        while !is_done() && Instant::now() < end {
            std::thread::sleep(Duration::from_millis(1));
        }
    };
    py.detach(|| until(&|| BEGINNING.load(Ordering::SeqCst) == 0));
    let abandoned = std::mem::take(&mut *ABANDONED.lock().unwrap_or_else(PoisonError::into_inner));
    py.detach(|| until(&|| abandoned.iter().all(JoinHandle::is_finished)));
    let live = std::mem::take(&mut *LIVE.lock().unwrap_or_else(PoisonError::into_inner));
    py.detach(|| {
        for shared in live.iter().filter_map(Weak::upgrade) {
            until(&|| shared.close_if_idle());
        }
    });
}
