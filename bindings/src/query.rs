//! Questions that need no learner: which scenarios there are, which pools run, how they do.

use crate::convert::dict_of;
use crate::errors;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use smaclite_ipc::{ConnectError, ControlError, Place};
use smaclite_scenarios::Scenario;

/// The place of this user's pools.
pub fn place() -> PyResult<Place> {
    Place::of_this_user().map_err(|error| errors::of_connect(error.into()))
}

/// Names of the standard scenarios, the 23 maps of SMAC, which `make` takes.
#[pyfunction]
pub fn scenarios() -> Vec<&'static str> {
    Scenario::standard_names().collect()
}

/// What the pool `pool` of this user is doing.
///
/// Returns a dict with `pool`, `pid`, `threads`, `uptime_s`, `shared_memory` (bytes) and `lanes`: a list of dicts with
/// `description` (as `Envs.description`), `holder` (the learner's process or None), `figures` (counts since the start),
/// `steps_per_s` and `failure`.
///
/// Raises NoSuchPool if no pool of that name runs.
#[pyfunction]
pub fn status<'py>(py: Python<'py>, pool: &str) -> PyResult<Bound<'py, PyDict>> {
    let place = place()?;
    let status = py.detach(|| smaclite_ipc::status(&place, pool)).map_err(errors::of_connect)?;
    dict_of(py, &status)
}

/// Names of this user's running pools, sorted; embedded ones too.
#[pyfunction]
pub fn pools(py: Python<'_>) -> PyResult<Vec<String>> {
    let place = place()?;
    py.detach(|| {
        let mut running = Vec::new();
        for name in place.pool_names() {
            match smaclite_ipc::status(&place, &name) {
                Ok(_) => running.push(name),
                Err(ConnectError::Control(ControlError::NoSuchPool { .. })) => {} // left by a dead one
                Err(error) => return Err(error),
            }
        }
        Ok(running)
    })
    .map_err(errors::of_connect)
}
