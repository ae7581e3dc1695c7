//! Arguments that are environments, or a scenario: names, paths, `Envs` and Python's wrappers of them.

use super::Envs;
use crate::convert::{translated, type_name};
use crate::errors::class;
use pyo3::exceptions::PyTypeError;
use pyo3::intern;
use pyo3::prelude::*;
use smaclite_engine::Rules;
use smaclite_scenarios::Scenario;
use std::path::{Path, PathBuf};

/// Environments, or those below a `Wrapper`, which has them as `unwrapped`.
pub struct EnvsArg<'py>(pub Bound<'py, Envs>);

impl<'py> EnvsArg<'py> {
    fn of(arg: &Bound<'py, PyAny>) -> PyResult<Option<EnvsArg<'py>>> {
        if let Ok(envs) = arg.cast::<Envs>() {
            return Ok(Some(EnvsArg(envs.clone())));
        }
        let unwrapped = arg.getattr_opt(intern!(arg.py(), "unwrapped"))?;
        Ok(unwrapped.and_then(|envs| envs.cast_into::<Envs>().ok()).map(EnvsArg))
    }
}

impl<'py> FromPyObject<'_, 'py> for EnvsArg<'py> {
    type Error = PyErr;

    fn extract(arg: Borrowed<'_, 'py, PyAny>) -> PyResult<EnvsArg<'py>> {
        EnvsArg::of(&arg)?.ok_or_else(|| {
            let got = type_name(&arg);
            PyTypeError::new_err(format!("expected Envs or a Wrapper of them, got {got}"))
        })
    }
}

/// A scenario by name or path, or that of environments.
pub enum ScenarioArg<'py> {
    Envs(EnvsArg<'py>),
    Scenario(PathBuf),
}

impl<'py> FromPyObject<'_, 'py> for ScenarioArg<'py> {
    type Error = PyErr;

    fn extract(arg: Borrowed<'_, 'py, PyAny>) -> PyResult<ScenarioArg<'py>> {
        if let Some(envs) = EnvsArg::of(&arg)? {
            return Ok(ScenarioArg::Envs(envs));
        }
        let path = arg.extract::<PathBuf>().map_err(|error| {
            translated(arg.py(), error, |_| {
                let got = type_name(&arg);
                PyTypeError::new_err(format!("expected the name of a scenario, a path or Envs, got {got}"))
            })
        });
        path.map(ScenarioArg::Scenario)
    }
}

impl ScenarioArg<'_> {
    /// The rules of environments, or the default.
    pub fn rules(&self) -> PyResult<Rules> {
        match self {
            ScenarioArg::Envs(envs) => envs.0.get().rules(),
            ScenarioArg::Scenario(_) => Ok(Rules::default()),
        }
    }

    /// The scenario; other Python threads run while it is read.
    pub fn resolve(self, py: Python<'_>) -> PyResult<Scenario> {
        match self {
            ScenarioArg::Envs(envs) => envs.0.get().scenario_of_lane(py),
            ScenarioArg::Scenario(path) => resolve(py, &path),
        }
    }
}

/// A standard scenario, or the one in a file; other Python threads run while it is read.
fn resolve(py: Python<'_>, name_or_path: &Path) -> PyResult<Scenario> {
    py.detach(|| Scenario::resolve(&name_or_path.to_string_lossy()))
        .map_err(|error| class::ScenarioError::new_err(error.to_string()))
}
