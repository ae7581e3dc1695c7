//! The argument `scenario` of functions that take a scenario or the environments of one.

use crate::envs::Envs;
use crate::scenario::resolve;
use pyo3::prelude::*;
use smaclite_scenarios::Scenario;
use std::path::PathBuf;

/// A scenario by name or path, or that of environments.
#[derive(FromPyObject)]
pub enum ScenarioArg<'py> {
    Envs(Bound<'py, Envs>),
    #[pyo3(annotation = "str, path or Envs")]
    Scenario(PathBuf),
}

impl ScenarioArg<'_> {
    /// The scenario; other Python threads run while it is read.
    pub fn resolve(self, py: Python<'_>) -> PyResult<Scenario> {
        match self {
            ScenarioArg::Envs(envs) => envs.get().scenario_of_lane(py),
            ScenarioArg::Scenario(path) => resolve(py, &path),
        }
    }
}
