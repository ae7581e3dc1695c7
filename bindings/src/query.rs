//! Queries that need no learner: the scenarios, the running pools and the status of a pool.

use crate::convert::{timeout_seconds, to_dict, to_duration};
use crate::errors;
use crate::wait::run_on_thread;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use smaclite_ipc::{RuntimeDir, WaitOptions, running_pools};
use smaclite_scenarios::Scenario;

/// The runtime directory of the current user's pools.
pub fn runtime_dir() -> PyResult<RuntimeDir> {
    RuntimeDir::for_current_user().map_err(|error| errors::connect_error(error.into()))
}

/// Names of the scenarios that `make` knows: the 23 maps of SMAC, and 15 generated ones, whose teams and
/// start positions are drawn for each episode.
///
/// Args:
///     generated: False for the 23, True for the 15, None for all.
#[pyfunction]
#[pyo3(signature = (*, generated=None))]
pub fn scenarios(generated: Option<bool>) -> Vec<&'static str> {
    let standard = Scenario::standard_names().filter(|_| generated != Some(true));
    standard.chain(Scenario::generated_names().filter(|_| generated != Some(false))).collect()
}

/// Return the current state of a running pool.
///
/// Args:
///     pool: the pool's name. It must be a pool of the current user.
///     timeout: seconds to wait for an answer, at least 0; None for no limit.
///
/// Returns:
///     A dict with `pool` (name), `pid` (process id of the supervisor), `threads` (number of workers),
///         `uptime_s` (seconds), `shared_memory` (bytes reserved for batches) and `lanes`, a list of dicts,
///         each with `description` (what never changes about it), `learner_pid` (process id of the
///         attached learner or None), `spectators` (how many are attached), `stats` (`steps`, `episodes`,
///         `wins`, `returns` and `lengths` (sums over the episodes that ended), `frames`, `rejected`,
///         `accepted` and `waited_ns`, counted since the pool started), `steps_per_s` and `queue_wait_us`
///         (averages over the last second) and `failure` (error text of a failed lane or None).
///
/// Raises:
///     NoSuchPool: no pool of that name is running.
///     ConnectError: the pool did not answer in time.
///     InvalidRequest: an argument is invalid.
#[pyfunction]
#[pyo3(signature = (pool, *, timeout=10.0))]
pub fn status(
    py: Python<'_>,
    pool: String,
    #[pyo3(from_py_with = timeout_seconds)] timeout: Option<f64>,
) -> PyResult<Bound<'_, PyDict>> {
    let (runtime_dir, timeout) = (runtime_dir()?, to_duration(timeout)?);
    let status = run_on_thread(py, move |interrupted| {
        smaclite_ipc::status(&runtime_dir, &pool, WaitOptions { timeout, interrupted })
    })?;
    to_dict(py, &status.map_err(errors::connect_error)?)
}

/// Names of the current user's running pools, sorted.
///
/// Includes embedded pools, and pools whose process is stopped (SIGSTOP) and would not answer.
#[pyfunction]
pub fn pools() -> PyResult<Vec<String>> {
    Ok(running_pools(&runtime_dir()?))
}
