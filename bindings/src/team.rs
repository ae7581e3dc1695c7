//! Trained teams: `smaclite_pool.load_team` reads their files through the code of the program.

use crate::convert::to_dict;
use crate::errors::{invalid_request, shown};
use crate::wait::run_on_thread;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use smaclite_engine::{BattleSetup, EpisodeLimit, Opponents, Rules, TargetLayout, UnitLayout};
use smaclite_learn::{RunDescription, TeamTensor, TrainedTeam, Weights, resolve_scenario, with_an_end};
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
    units: Option<Layouts<'a>>,
}

/// What a network over units needs besides its tensors.
#[derive(serde::Serialize)]
struct Layouts<'a> {
    obs: &'a UnitLayout,
    targets: &'a TargetLayout,
}

/// The run in a folder, or a team of the zoo as `zoo:3m`: a dict of `config`, `name` (of the scenario),
/// `scenario` (the same if it is a standard one, else None), `rules`, `episode_limit`, `opponent`,
/// `obs_shape` (n_agents and obs_size), `units` (for a network over units, where observations and actions
/// have which unit; else None), and `tensors`, float32 arrays by name. `weights` are "best" or "last"; None
/// for those that the program takes. `map` is the name or file of the scenario that it is to play instead of
/// its own, for networks that fit every scenario. With `enemies` it is to play those.
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
        units: team.layouts().map(|(obs, targets)| Layouts { obs, targets }),
    };
    let described = to_dict(py, &described)?;
    described.set_item("config", to_dict(py, &run.config)?)?;
    let tensors = PyDict::new(py);
    for TeamTensor { name, shape, values } in team.tensors() {
        tensors.set_item(name, PyArray1::from_vec(py, values).call_method1("reshape", (shape,))?)?;
    }
    described.set_item("tensors", tensors)?;
    Ok(described)
}

fn open_on(folder: &Path, weights: Option<Weights>, map: &str) -> Result<TrainedTeam, String> {
    let run = RunDescription::read(folder).map_err(|error| shown(&error))?;
    let setup = resolve_scenario(map, run.setup.rules).map_err(|error| shown(&error))?;
    TrainedTeam::open_on(folder, weights, setup).map_err(|error| shown(&error))
}
