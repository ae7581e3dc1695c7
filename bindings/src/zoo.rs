//! The trained teams that are part of the package; `smaclite_pool.load_team` reads their files.

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::path::PathBuf;

/// The bytes of a file of a team of the zoo, by a path as `zoo:3m/run.json`; None for other paths.
#[pyfunction]
#[pyo3(signature = (path))]
pub fn zoo_file<'py>(py: Python<'py>, path: PathBuf) -> Option<Bound<'py, PyBytes>> {
    smaclite_learn::zoo_file(&path).map(|bytes| PyBytes::new(py, bytes))
}
