//! Closes open pools when the interpreter exits.
//!
//! CPython may exit without freeing every object, so destructors alone are not enough. A daemon thread may
//! also be using or making environments at that time, and the exiting interpreter freezes it in the middle of
//! that call.

use crate::errors::class;
use pyo3::prelude::*;
use pyo3::types::IntoPyDict;
use smaclite_ipc::FolderUse;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError, Weak};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Set when the interpreter exits: waits end, and new calls fail.
static EXITING: AtomicBool = AtomicBool::new(false);

/// Number of running `make` and `connect` calls, whose environments are not in [`OPEN_CLIENTS`] yet.
static PENDING_CALLS: AtomicUsize = AtomicUsize::new(0);

/// Threads with cancelled work, which may still have to release what they created.
static CANCELLED_THREADS: Mutex<Vec<JoinHandle<()>>> = Mutex::new(Vec::new());

/// How long the exit waits for other threads. Blocked calls check [`is_exiting`] every 100 ms.
const EXIT_TIMEOUT: Duration = Duration::from_secs(5);

/// Clients to close at exit. Locked only while attached to the interpreter, so that a fork never copies a
/// locked mutex.
static OPEN_CLIENTS: Mutex<Vec<Weak<dyn CloseAtExit>>> = Mutex::new(Vec::new());

/// Uses to end at exit, because batches may be left: in the frame of a daemon thread, in a cycle that is
/// never freed. Locked as [`OPEN_CLIENTS`] is.
static FOLDER_USES: Mutex<Vec<FolderUse>> = Mutex::new(Vec::new());

/// What is closed when the interpreter exits.
pub trait CloseAtExit: Send + Sync {
    /// Closes, unless another thread's call is using it: then it returns `false`.
    fn close_if_idle(&self) -> bool;
}

/// Closes `client` at exit, unless it is dropped before.
pub fn close_at_exit(client: Weak<dyn CloseAtExit>) {
    let mut clients = OPEN_CLIENTS.lock().unwrap_or_else(PoisonError::into_inner);
    clients.retain(|other| other.strong_count() > 0);
    clients.push(client);
}

/// Ends `folder_use` at exit, after all clients are closed.
pub fn end_at_exit(folder_use: FolderUse) {
    let mut uses = FOLDER_USES.lock().unwrap_or_else(PoisonError::into_inner);
    uses.retain(|other| !other.has_ended());
    uses.push(folder_use);
}

/// Registers [`close_all`] with `atexit`, and [`forget_all`] for forked children.
pub fn register_atexit(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    py.import("atexit")?.call_method1("register", (wrap_pyfunction!(close_all, module)?,))?;
    // Windows does not fork.
    if let Some(register) = py.import("os")?.getattr_opt("register_at_fork")? {
        let in_child = [("after_in_child", wrap_pyfunction!(forget_all, module)?)].into_py_dict(py)?;
        register.call((), Some(&in_child))?;
    }
    Ok(())
}

/// In a forked child: the clients, the calls and the threads are its parent's. Those that another thread was
/// using at the fork would be busy for ever, so the exit would wait for them in vain.
#[pyfunction]
fn forget_all() {
    PENDING_CALLS.store(0, Ordering::SeqCst);
    CANCELLED_THREADS.lock().unwrap_or_else(PoisonError::into_inner).clear();
    OPEN_CLIENTS.lock().unwrap_or_else(PoisonError::into_inner).clear();
    FOLDER_USES.lock().unwrap_or_else(PoisonError::into_inner).clear();
}

/// Whether the interpreter is exiting.
pub fn is_exiting() -> bool {
    EXITING.load(Ordering::SeqCst)
}

/// The error of a call that fails because the interpreter is exiting.
pub fn exiting_error() -> PyErr {
    class::Closed::new_err("the Python interpreter is exiting; these environments are closed")
}

/// Makes the exit wait for `thread`, for at most [`EXIT_TIMEOUT`].
pub fn join_at_exit(thread: JoinHandle<()>) {
    let mut threads = CANCELLED_THREADS.lock().unwrap_or_else(PoisonError::into_inner);
    threads.retain(|other| !other.is_finished());
    threads.push(thread);
}

/// Held by `make` and `connect` until their client is registered with [`close_at_exit`].
pub struct PendingCall(());

impl PendingCall {
    pub fn new() -> PyResult<PendingCall> {
        // SeqCst: either the exit sees this call, or this call sees that the interpreter is exiting.
        PENDING_CALLS.fetch_add(1, Ordering::SeqCst);
        let call = PendingCall(());
        if is_exiting() { Err(exiting_error()) } else { Ok(call) }
    }
}

impl Drop for PendingCall {
    fn drop(&mut self) {
        PENDING_CALLS.fetch_sub(1, Ordering::SeqCst);
    }
}

#[pyfunction]
fn close_all(py: Python<'_>) {
    EXITING.store(true, Ordering::SeqCst);
    let deadline = Instant::now() + EXIT_TIMEOUT;
    let wait_until = |is_done: &dyn Fn() -> bool| {
        while !is_done() && Instant::now() < deadline {
            std::thread::sleep(Duration::from_millis(1));
        }
    };
    py.detach(|| wait_until(&|| PENDING_CALLS.load(Ordering::SeqCst) == 0));
    let threads = std::mem::take(&mut *CANCELLED_THREADS.lock().unwrap_or_else(PoisonError::into_inner));
    py.detach(|| wait_until(&|| threads.iter().all(JoinHandle::is_finished)));
    let clients = std::mem::take(&mut *OPEN_CLIENTS.lock().unwrap_or_else(PoisonError::into_inner));
    py.detach(|| {
        for client in clients.iter().filter_map(Weak::upgrade) {
            wait_until(&|| client.close_if_idle());
        }
    });
    let uses = std::mem::take(&mut *FOLDER_USES.lock().unwrap_or_else(PoisonError::into_inner));
    uses.iter().for_each(FolderUse::end);
}
