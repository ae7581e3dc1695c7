//! `Spectator` in Python: the newest batch of a lane, without being its learner.

use crate::batch::Batch;
use crate::errors::{class, client_error, connect_error, invalid_request};
use crate::exit::end_at_exit;
use crate::lane_spec::lane_spec;
use crate::query::runtime_dir;
use crate::wait::run_on_thread;
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use pyo3::types::PyTuple;
use smaclite_ipc::WaitOptions;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Reads the batches of a lane without being its learner, who does not notice.
///
/// A spectator receives the newest batch at the time of each call, and misses the others: `Batch.sequence`
/// counts them all. Its batches are views of the memory that the learner reads, and stay valid as those of
/// the learner do, but at most two of them may exist at the same time. If its process is killed, the pool and
/// the learner continue, and its place becomes free.
///
///     spectator = smaclite_pool.Spectator("train")
///     while True:
///         batch = spectator.latest()
///         if batch is not None:
///             print(batch.sequence, batch.episode_return.mean())
///         time.sleep(1)
///
/// Args:
///     pool: the pool's name: that of `smaclite-pool serve --name`, or `Envs.spec.pool`.
///     lane: the lane's name; it may be omitted if the pool has only one lane.
///
/// Raises:
///     NoSuchPool: no pool of that name is running.
///     ConnectError: the pool has no such lane, or its lane has all its spectators (`--spectators` of
///         `serve`, `spectators` of `make`).
#[pyclass(frozen, module = "smaclite_pool")]
pub struct Spectator(Mutex<Option<Watching>>);

struct Watching {
    spectator: smaclite_ipc::Spectator,
    latest: Option<Py<Batch>>,
}

impl Spectator {
    /// Detached from the interpreter while it waits: who has it makes a Python object, which may have to wait
    /// for all attached threads to pause.
    fn lock(&self, py: Python<'_>) -> MutexGuard<'_, Option<Watching>> {
        self.0.lock_py_attached(py).unwrap_or_else(PoisonError::into_inner)
    }
}

fn closed() -> PyErr {
    class::Closed::new_err("this spectator is closed; make another one")
}

#[pymethods]
impl Spectator {
    #[new]
    #[pyo3(signature = (pool, lane=None))]
    fn new(py: Python<'_>, pool: String, lane: Option<String>) -> PyResult<Spectator> {
        let runtime_dir = runtime_dir()?;
        let spectator = run_on_thread(py, move |cancelled| {
            let wait = WaitOptions::interrupted_by(cancelled);
            smaclite_ipc::Spectator::connect(&runtime_dir, &pool, lane.as_deref(), wait)
        })?;
        let spectator = spectator.map_err(connect_error)?;
        end_at_exit(spectator.folder_use());
        Ok(Spectator(Mutex::new(Some(Watching { spectator, latest: None }))))
    }

    /// The newest batch that the lane sent since this spectator attached, or None before the first. It never
    /// waits.
    ///
    /// Without a newer one it is the batch of the last call again, the same object.
    ///
    /// Raises:
    ///     TooManyBatchesHeld: there is a newer one, and two batches are in use; release one and all arrays
    ///         over it.
    ///     PoolDied: the pool has ended.
    ///     Forked: this process is a forked child of the one that made the spectator.
    ///     Closed: the spectator is closed.
    fn latest(&self, py: Python<'_>) -> PyResult<Option<Py<Batch>>> {
        let mut guard = self.lock(py);
        let watching = guard.as_mut().ok_or_else(closed)?;
        let mut older = None;
        if let Some(newer) = watching.spectator.newer().map_err(client_error)? {
            older = watching.latest.replace(Py::new(py, Batch::new(Arc::new(newer)))?);
        }
        let latest = watching.latest.as_ref().map(|batch| batch.clone_ref(py));
        drop(guard);
        drop(older); // the callbacks of weak references to it may use this spectator
        Ok(latest)
    }

    /// What never changes about the lane, as `Envs.spec`.
    ///
    /// Raises:
    ///     Closed: the spectator is closed.
    #[getter]
    fn spec<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let description = self.lock(py).as_ref().ok_or_else(closed)?.spectator.description().clone();
        lane_spec(py, &description, &description.layout().map_err(invalid_request)?)
    }

    /// Leave the lane. Batches and their arrays stay valid. Closing twice has no effect.
    fn close(&self, py: Python<'_>) {
        let watching = self.lock(py).take();
        drop(watching);
    }

    fn __enter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    #[pyo3(signature = (*_exception))]
    fn __exit__(&self, py: Python<'_>, _exception: &Bound<'_, PyTuple>) {
        self.close(py);
    }
}
