//! Conversion of Python arguments that are no arrays: integers, timeouts and names. Every error names the
//! argument, what was expected and what was passed.

use crate::errors::invalid_request;
use pyo3::exceptions::{PyOverflowError, PyTypeError, PyValueError};
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyString};
use smaclite_engine::Faction;
use std::fmt::Display;
use std::str::FromStr;
use std::time::Duration;

/// What the conversion of an argument raised, as an error that names the argument, with the former as its
/// cause, where it is about the argument's type or value. Everything else is not the argument's fault: Ctrl-C
/// in the conversion of a tensor, a lack of memory, an error of a device. It passes as it is.
pub fn translated(py: Python<'_>, raised: PyErr, translation: impl FnOnce(&PyErr) -> PyErr) -> PyErr {
    if !is_about_argument(&raised, py) {
        return raised;
    }
    let error = translation(&raised);
    error.set_cause(py, Some(raised));
    error
}

/// Whether the type or the value of an argument is what an exception is about.
pub fn is_about_argument(raised: &PyErr, py: Python<'_>) -> bool {
    raised.is_instance_of::<PyTypeError>(py) || raised.is_instance_of::<PyValueError>(py)
}

/// An integer argument. [`to_unsigned`] reports what is not one, because it knows the argument's name.
pub enum IntArg {
    Small(i128),
    /// Does not fit into an `i128`, so it is out of range for every argument.
    Huge {
        negative: bool,
    },
    Other(NotAnInteger),
}

/// What was passed instead of an integer.
pub struct NotAnInteger {
    type_name: String,
    /// What its own `__index__` raised.
    cause: Option<PyErr>,
}

impl NotAnInteger {
    /// The error of an argument that must be `expected`.
    pub fn error(self, expected: &str) -> PyErr {
        let error = PyTypeError::new_err(format!("{expected}, got {}", self.type_name));
        if let Some(cause) = self.cause {
            Python::attach(|py| error.set_cause(py, Some(cause)));
        }
        error
    }
}

impl FromPyObject<'_, '_> for IntArg {
    type Error = PyErr;

    fn extract(arg: Borrowed<'_, '_, PyAny>) -> PyResult<IntArg> {
        // To Python `True` is 1. Here it is a mistake: `obs_last_actions=True` beside `obs_agent_id=True`.
        if arg.is_instance_of::<PyBool>() {
            return Ok(IntArg::Other(NotAnInteger { type_name: type_name(&arg), cause: None }));
        }
        match arg.extract::<i128>() {
            Ok(value) => Ok(IntArg::Small(value)),
            Err(error) if error.is_instance_of::<PyOverflowError>(arg.py()) => {
                Ok(IntArg::Huge { negative: arg.lt(0)? })
            }
            Err(error) if is_about_argument(&error, arg.py()) => {
                // A plain value of another type says all with its type.
                let cause = arg.hasattr(intern!(arg.py(), "__index__"))?.then_some(error);
                Ok(IntArg::Other(NotAnInteger { type_name: type_name(&arg), cause }))
            }
            Err(error) => Err(error),
        }
    }
}

/// The name of a value's type, for errors.
pub fn type_name(value: &Bound<'_, PyAny>) -> String {
    value.get_type().name().map_or_else(|_| "an unnamed type".to_owned(), |name| name.to_string())
}

/// Converts to an unsigned type `T`, if the value is in range.
pub fn to_unsigned<T: TryFrom<i128>>(name: &str, arg: IntArg) -> PyResult<T> {
    let max = u128::MAX >> (128 - 8 * size_of::<T>());
    let (negative, got) = match arg {
        IntArg::Small(value) => match T::try_from(value) {
            Ok(in_range) => return Ok(in_range),
            Err(_) => (value < 0, value.to_string()),
        },
        IntArg::Huge { negative } => (negative, "an integer of more than 127 bits".to_owned()),
        IntArg::Other(other) => return Err(other.error(&format!("{name} must be an integer"))),
    };
    Err(invalid_request(if negative {
        format!("{name} must not be negative, got {got}")
    } else {
        format!("{name} must be at most {max}, got {got}")
    }))
}

/// A list of strings, such as `example`.
pub fn string_list(name: &str, example: &str, arg: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
    let refused = |got: String| {
        PyTypeError::new_err(format!("{name} must be a list of strings, such as {example}, got {got}"))
    };
    if arg.is_instance_of::<PyString>() {
        return Err(refused(type_name(arg)));
    }
    let items = arg.try_iter().map_err(|error| translated(arg.py(), error, |_| refused(type_name(arg))))?;
    let string = |item: PyResult<Bound<'_, PyAny>>| {
        let item = item?;
        item.extract().map_err(|_: PyErr| refused(format!("{} in it", type_name(&item))))
    };
    items.map(string).collect()
}

/// Parses an option that has a fixed set of values, such as `wait`.
pub fn parse_option<T: FromStr>(value: &str) -> PyResult<T>
where
    T::Err: Display,
{
    value.parse::<T>().map_err(invalid_request)
}

/// Extracts a timeout in seconds. Integers beyond the range of a float become infinite.
///
/// For `from_py_with`: the arguments have the type `Option<f64>`, so that their defaults are literals, which
/// PyO3 shows in the signature.
pub fn timeout_seconds(arg: &Bound<'_, PyAny>) -> PyResult<Option<f64>> {
    match arg.extract::<Option<f64>>() {
        Ok(seconds) => Ok(seconds),
        Err(error) if error.is_instance_of::<PyOverflowError>(arg.py()) => {
            Ok(Some(if arg.lt(0)? { f64::NEG_INFINITY } else { f64::INFINITY }))
        }
        Err(error) => Err(translated(arg.py(), error, |_| {
            let got = type_name(arg);
            PyTypeError::new_err(format!("timeout must be a number of seconds or None, got {got}"))
        })),
    }
}

/// The name of a side.
pub const fn side_name(side: Faction) -> &'static str {
    match side {
        Faction::Ally => "allies",
        Faction::Enemy => "enemies",
    }
}

/// The side of this name.
pub fn to_side(name: &str) -> PyResult<Faction> {
    match name {
        "allies" => Ok(Faction::Ally),
        "enemies" => Ok(Faction::Enemy),
        _ => Err(invalid_request(format!("side must be `allies` or `enemies`, got `{name}`"))),
    }
}

/// A timeout as a duration. `None` and values beyond the range of `Duration`, such as infinity, mean no
/// timeout.
pub fn to_duration(timeout: Option<f64>) -> PyResult<Option<Duration>> {
    match timeout {
        None => Ok(None),
        Some(seconds) if seconds >= Duration::MAX.as_secs_f64() => Ok(None),
        Some(seconds) => Duration::try_from_secs_f64(seconds).map(Some).map_err(|_| {
            invalid_request(format!("timeout must be at least 0 seconds, or None, got {seconds:?}"))
        }),
    }
}

/// Converts a description or status to a dict.
pub fn to_dict<'py>(py: Python<'py>, value: &impl serde::Serialize) -> PyResult<Bound<'py, PyDict>> {
    let text = serde_json::to_string(value).map_err(invalid_request)?;
    Ok(py.import("json")?.call_method1("loads", (text,))?.cast_into::<PyDict>()?)
}
