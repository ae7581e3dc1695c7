//! Questions that need no learner: which scenarios there are, which pools run, how they do.

use crate::convert::{Seconds, dict_of, seconds};
use crate::errors;
use crate::wait::apart;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use smaclite_ipc::{Patience, Place, running_pools, status_within};
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
/// `timeout`: seconds that the pool has to answer; None for no limit. Raises NoSuchPool if no pool of that
/// name runs, and ConnectError if it does not answer in time.
#[pyfunction]
#[pyo3(signature = (pool, *, timeout=Some(Seconds(10.0))), text_signature = "(pool, *, timeout=10.0)")]
pub fn status(py: Python<'_>, pool: String, timeout: Option<Seconds>) -> PyResult<Bound<'_, PyDict>> {
    let (place, timeout) = (place()?, seconds(timeout)?);
    let status =
        apart(py, move |interrupted| status_within(&place, &pool, Patience { timeout, interrupted }))?;
    dict_of(py, &status.map_err(errors::of_connect)?)
}

/// Names of this user's running pools, sorted; embedded ones too, and those that are stopped and do not
/// answer.
#[pyfunction]
pub fn pools() -> PyResult<Vec<String>> {
    Ok(running_pools(&place()?))
}
