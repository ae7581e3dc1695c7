//! Trained teams: `smaclite_pool.load_team` reads their files through the code of the program.

use crate::convert::to_dict;
use crate::errors::{invalid_request, shown};
use crate::wait::run_on_thread;
use numpy::{PyArray1, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyType};
use smaclite_engine::{BattleSetup, EpisodeLimit, Opponents, Rules};
use smaclite_learn::{RunDescription, TrainedTeam, Weights, resolve_scenario, with_an_end};
use std::path::{Path, PathBuf};

/// What Python needs of a run besides its configuration.
#[derive(serde::Serialize)]
struct Description<'a> {
    name: &'a str,
    scenario: Option<&'a str>,
    rules: Rules,
    episode_limit: EpisodeLimit,
    opponent: &'a Opponents,
    obs_shape: [usize; 2],
}

/// The policy of a team.
#[pyclass(frozen, module = "smaclite_pool._native")]
pub struct TeamNetwork(TrainedTeam);

#[pymethods]
impl TeamNetwork {
    /// From what `__reduce__` says.
    #[new]
    fn new(run: &[u8], params: PyReadonlyArray1<'_, f32>) -> PyResult<TeamNetwork> {
        let team = TrainedTeam::from_parts(run, params.as_array().to_vec());
        let team = team.ok_or_else(|| {
            invalid_request("the pickled team is damaged, or was pickled by another release".to_owned())
        });
        Ok(TeamNetwork(team?))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> (Bound<'py, PyType>, TeamParts<'py>) {
        let (run, params) = self.0.parts();
        (py.get_type::<TeamNetwork>(), (PyBytes::new(py, &run), PyArray1::from_slice(py, params)))
    }

    /// The outputs, float32 [M, n_agents, n_actions], for contiguous observations, float32
    /// [M, n_agents, obs_size].
    fn logits<'py>(
        &self,
        py: Python<'py>,
        obs: PyReadonlyArray3<'py, f32>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let sizes = self.0.run().sizes;
        let copied = obs.as_slice()?.to_vec(); // others may write there while this thread is detached
        let outputs = py.detach(|| self.0.logits(&copied));
        let shape = [obs.shape()[0], sizes.n_agents, sizes.n_actions];
        PyArray1::from_vec(py, outputs).reshape(shape)
    }
}

/// What a policy is pickled as.
type TeamParts<'py> = (Bound<'py, PyBytes>, Bound<'py, PyArray1<f32>>);

/// The run in a folder, or a team of the zoo as `zoo:3m`: a dict of `config`, `name` (of the scenario),
/// `scenario` (the same if it is a standard one, else None), `rules`, `episode_limit`, `opponent`,
/// `obs_shape` (n_agents and obs_size), and `network`. `weights` are "best" or "last"; None for those that
/// the program takes. `map` is the name or file of the scenario that it is to play instead of its own, for
/// networks that fit every scenario. With `enemies` it is to play those.
///
/// Raises:
///     InvalidRequest: there is no such team, its files are damaged, or it does not play that map or its
///         enemies.
#[pyfunction]
#[pyo3(signature = (folder, weights=None, map=None, enemies=false))]
pub fn read_team<'py>(
    py: Python<'py>,
    folder: PathBuf,
    weights: Option<&str>,
    map: Option<&str>,
    enemies: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let weights = weights.map(str::parse::<Weights>).transpose().map_err(invalid_request)?;
    let map = map.map(str::to_owned);
    let read = run_on_thread(py, move |_| {
        let team = match map {
            None => TrainedTeam::open_with(&folder, weights).map_err(|error| shown(&error)),
            Some(map) => open_on(&folder, weights, &map),
        }?;
        if !enemies {
            return Ok(team);
        }
        TrainedTeam::open_enemies(&folder, weights, &team.run().setup).map_err(|error| shown(&error))
    })?;
    let team = read.map_err(invalid_request)?;
    let run = team.run();
    let BattleSetup { rules, episode_limit, opponents, .. } = with_an_end(run.setup.clone());
    let described = Description {
        name: &run.name,
        scenario: run.setup.files.is_standard().then_some(&run.name),
        rules,
        episode_limit,
        opponent: &opponents,
        obs_shape: [run.sizes.n_agents, run.sizes.obs_size],
    };
    let described = to_dict(py, &described)?;
    described.set_item("config", to_dict(py, &run.config)?)?;
    described.set_item("network", TeamNetwork(team))?;
    Ok(described)
}

fn open_on(folder: &Path, weights: Option<Weights>, map: &str) -> Result<TrainedTeam, String> {
    let run = RunDescription::read(folder).map_err(|error| shown(&error))?;
    let setup = resolve_scenario(map, run.setup.rules).map_err(|error| shown(&error))?;
    TrainedTeam::open_on(folder, weights, setup).map_err(|error| shown(&error))
}
