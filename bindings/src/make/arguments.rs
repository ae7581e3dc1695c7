//! The arguments of `make` that are more than a number or a name.

use crate::convert::{IntArg, to_unsigned, translated, type_name};
use crate::errors::invalid_request;
use crate::habits::check_settings;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyCFunction, PyDict, PyMapping, PyString};
use serde_json::value::RawValue;
use smaclite_engine::{EpisodeLimit, OpponentsError, Sides};
use smaclite_learn::{LaneOpponents, LaneOpponentsError};
use smaclite_pool::{Autoreset, PoolOptions};

/// No machine has as many cores; a larger value is a mistake.
pub const MAX_THREADS: usize = 1024;

/// More lanes than this would only make batches smaller.
const MAX_LANES: usize = 64;

/// The further keywords of `make`: keys of scenario files and their values. None leaves the file's, as it is
/// the default of functions that hand such a keyword on.
pub(super) fn changed_keys(battle: &Bound<'_, PyDict>) -> PyResult<Vec<(String, Box<RawValue>)>> {
    check_settings("make", battle, Vec::new(), Vec::new())?;
    let changed = |(key, value): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
        let key: String = key.extract()?;
        let value = json_of(&key, &value)?;
        Ok((key, value))
    };
    battle.iter().filter(|(_, value)| !value.is_none()).map(changed).collect()
}

/// A value of a key of scenario files, as the text of JSON.
fn json_of(key: &str, value: &Bound<'_, PyAny>) -> PyResult<Box<RawValue>> {
    let py = value.py();
    // Of arrays and scalars of NumPy.
    let to_list = PyCFunction::new_closure(py, None, None, |arguments, _| -> PyResult<Py<PyAny>> {
        let value = arguments.get_item(0)?;
        let Some(to_list) = value.getattr_opt("tolist")? else {
            let got = type_name(&value);
            return Err(PyTypeError::new_err(format!(
                "expected dicts, lists, strings and numbers, got {got}"
            )));
        };
        Ok(to_list.call0()?.unbind())
    })?;
    let options = [("allow_nan", false)].into_py_dict(py)?;
    options.set_item("default", to_list)?;
    let dumps = py.import("json")?.getattr("dumps")?;
    let text_of = |value: &Bound<'_, PyAny>| dumps.call((value,), Some(&options))?.extract::<String>();
    let refused = |e: String| invalid_request(format!("{key} must be as in a scenario file (JSON): {e}"));
    let text = text_of(value).map_err(|error| {
        let is_wrong = |(_, item): &(Bound<'_, PyAny>, Bound<'_, PyAny>)| text_of(item).is_err();
        let wrong = value.cast::<PyDict>().ok().and_then(|items| items.iter().find(is_wrong));
        let at = wrong.map_or_else(String::new, |(name, _)| format!("`{name}`: "));
        translated(py, error, |e| refused(format!("{at}{e}")))
    })?;
    RawValue::from_string(text).map_err(|e| refused(e.to_string()))
}

/// A keyword of [`Autoreset`](smaclite_pool::Autoreset), or Gymnasium's `AutoresetMode` of that value.
pub struct ModeArg(pub(super) String);

impl Default for ModeArg {
    fn default() -> Self {
        ModeArg(Autoreset::default().to_string())
    }
}

impl FromPyObject<'_, '_> for ModeArg {
    type Error = PyErr;

    fn extract(arg: Borrowed<'_, '_, PyAny>) -> PyResult<ModeArg> {
        let value = arg.getattr_opt("value")?.unwrap_or_else(|| arg.to_owned());
        let mode = value.extract::<String>();
        mode.map(ModeArg).map_err(|_| {
            let got = arg.get_type().name().map_or_else(|_| String::new(), |name| format!(", got {name}"));
            PyTypeError::new_err(format!("autoreset_mode must be a string or an AutoresetMode{got}"))
        })
    }
}

pub(super) fn lane_count(lanes: IntArg, num_envs: usize) -> PyResult<usize> {
    let (lanes, most) = (to_unsigned("lanes", lanes)?, num_envs.clamp(1, MAX_LANES));
    if !(1..=most).contains(&lanes) {
        return Err(invalid_request(format!(
            "lanes must be between 1 and {most} for {num_envs} environments, got {lanes}"
        )));
    }
    Ok(lanes)
}

pub(super) fn thread_count(threads: Option<IntArg>) -> PyResult<usize> {
    let threads = threads.map_or(Ok(PoolOptions::default().threads), |n| to_unsigned("threads", n))?;
    if !(1..=MAX_THREADS).contains(&threads) {
        return Err(invalid_request(format!("threads must be between 1 and {MAX_THREADS}, got {threads}")));
    }
    Ok(threads)
}

/// A number of steps, or the name of the scenario's own limit.
pub enum LimitArg {
    Name(String),
    Steps(IntArg),
}

impl FromPyObject<'_, '_> for LimitArg {
    type Error = PyErr;

    fn extract(arg: Borrowed<'_, '_, PyAny>) -> PyResult<LimitArg> {
        match arg.cast::<PyString>() {
            Ok(name) => Ok(LimitArg::Name(name.to_string_lossy().into_owned())),
            Err(_) => arg.extract().map(LimitArg::Steps),
        }
    }
}

/// The name of an opponent, or names and weights. A folder is a name, too.
pub enum OpponentArg {
    Name(String),
    Weights(Vec<(String, f64)>),
}

impl FromPyObject<'_, '_> for OpponentArg {
    type Error = PyErr;

    fn extract(arg: Borrowed<'_, '_, PyAny>) -> PyResult<OpponentArg> {
        if let Some(name) = opponent_name(&arg)? {
            return Ok(OpponentArg::Name(name));
        }
        let Ok(weights) = arg.cast::<PyMapping>() else {
            let got = type_name(&arg);
            return Err(PyTypeError::new_err(format!(
                "opponent must be a name, such as \"kite\" or \"zoo:3m\", or a dict of names and weights, \
                 such as {{\"kite\": 1.0}}, got {got}"
            )));
        };
        weights.items()?.iter().map(|item| weight(&item)).collect::<PyResult<_>>().map(OpponentArg::Weights)
    }
}

/// The name of a script or of a team, or the folder of a team, which can be any path.
fn opponent_name(arg: &Bound<'_, PyAny>) -> PyResult<Option<String>> {
    if let Some(fspath) = arg.getattr_opt("__fspath__")? {
        return fspath.call0()?.extract().map(Some);
    }
    Ok(arg.cast::<PyString>().ok().map(|name| name.to_string_lossy().into_owned()))
}

/// A name and its weight.
fn weight(item: &Bound<'_, PyAny>) -> PyResult<(String, f64)> {
    let (name, weight): (Bound<'_, PyAny>, Bound<'_, PyAny>) = item.extract()?;
    let Some(text) = opponent_name(&name)? else {
        let got = type_name(&name);
        return Err(PyTypeError::new_err(format!("the keys of opponent must be names, got {got}")));
    };
    let weight = weight.extract::<f64>().map_err(|raised| {
        translated(item.py(), raised, |_| {
            let got = type_name(&weight);
            PyTypeError::new_err(format!("the weight of opponent `{text}` must be a number, got {got}"))
        })
    })?;
    Ok((text, weight))
}

impl OpponentArg {
    pub(super) fn opponents(self, sides: Sides) -> PyResult<LaneOpponents> {
        let opponents = match self {
            OpponentArg::Name(name) => LaneOpponents::new([(name, 1.0)]),
            OpponentArg::Weights(weights) => LaneOpponents::new(weights),
        };
        let opponents = opponents.map_err(invalid_request)?;
        match opponents.check(sides) {
            Ok(()) => Ok(opponents),
            Err(error @ LaneOpponentsError::Opponents(OpponentsError::NoLearner(_))) => {
                Err(invalid_request(format!(
                    "{error}; for the settings of a trained team: \
                 make(..., sides=\"mirrored\", **team.settings | {{\"opponent\": \"learner\"}})"
                )))
            }
            Err(error) => Err(invalid_request(error)),
        }
    }
}

/// `None` is no limit.
pub(super) fn to_episode_limit(limit: Option<LimitArg>) -> PyResult<EpisodeLimit> {
    const EXPECTED: &str = "episode_limit must be an integer of at least 1, None or \"default\"";
    match limit {
        None => Ok(EpisodeLimit::None),
        Some(LimitArg::Name(name)) if name == "default" => Ok(EpisodeLimit::Scenario),
        Some(LimitArg::Name(name)) => Err(invalid_request(format!("{EXPECTED}, got `{name}`"))),
        Some(LimitArg::Steps(IntArg::Other(other))) => Err(other.error(EXPECTED)),
        Some(LimitArg::Steps(IntArg::Small(0))) => Err(invalid_request(format!("{EXPECTED}, got 0"))),
        Some(LimitArg::Steps(steps)) => Ok(EpisodeLimit::Steps(to_unsigned("episode_limit", steps)?)),
    }
}
