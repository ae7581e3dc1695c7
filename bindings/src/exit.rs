//! Pools that are still open when the interpreter ends are closed, because objects may outlive it unfreed.

use crate::envs::Shared;
use pyo3::prelude::*;
use std::sync::{Arc, Mutex, PoisonError, Weak};

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

#[pyfunction]
fn close_all(py: Python<'_>) {
    let live = std::mem::take(&mut *LIVE.lock().unwrap_or_else(PoisonError::into_inner));
    py.detach(|| {
        for shared in live.iter().filter_map(Weak::upgrade) {
            shared.close_if_idle();
        }
    });
}
