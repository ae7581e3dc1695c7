//! What Python passes as what Rust takes, or an error that says what was passed. Arrays that fit are read in place.

use crate::errors::invalid;
use numpy::{
    Element, PyArray1, PyArray2, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn,
    PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyOverflowError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::fmt::Display;
use std::str::FromStr;
use std::time::Duration;

/// What was passed for an integer. Extracting it never fails, so that [`whole`] can say what is wrong and
/// with which argument.
pub enum Int {
    Small(i128),
    /// Beyond what any setting can be.
    Huge {
        negative: bool,
    },
    /// The name of another type.
    Other(String),
}

impl FromPyObject<'_, '_> for Int {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, '_, PyAny>) -> PyResult<Int> {
        match given.extract::<i128>() {
            Ok(value) => Ok(Int::Small(value)),
            Err(error) if error.is_instance_of::<PyOverflowError>(given.py()) => {
                Ok(Int::Huge { negative: given.lt(0)? })
            }
            Err(_) => Ok(Int::Other(type_name(&given))),
        }
    }
}

fn type_name(given: &Bound<'_, PyAny>) -> String {
    given.get_type().name().map_or_else(|_| "something else".to_owned(), |name| name.to_string())
}

/// A Python integer as an unsigned type.
pub fn whole<T: TryFrom<i128>>(name: &str, given: Int) -> PyResult<T> {
    let most = u128::MAX >> (128 - 8 * size_of::<T>());
    let (negative, got) = match given {
        Int::Small(value) => match T::try_from(value) {
            Ok(fits) => return Ok(fits),
            Err(_) => (value < 0, value.to_string()),
        },
        Int::Huge { negative } => (negative, "an integer of more than 127 bits".to_owned()),
        Int::Other(kind) => {
            return Err(PyTypeError::new_err(format!("{name} must be an integer, got {kind}")));
        }
    };
    Err(invalid(match negative {
        true => format!("{name} must not be negative, got {got}"),
        false => format!("{name} must be at most {most}, got {got}"),
    }))
}

/// A list of names.
pub fn names(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
    given.extract().map_err(|_| {
        let kind = type_name(given);
        PyTypeError::new_err(format!("{name} must be a list of strings, such as [\"obs\"], got {kind}"))
    })
}

/// One of a few words.
pub fn word<T: FromStr>(word: &str) -> PyResult<T>
where
    T::Err: Display,
{
    word.parse::<T>().map_err(invalid)
}

/// What was passed for a number of seconds; integers beyond a float's range are infinite.
pub struct Seconds(pub f64);

impl FromPyObject<'_, '_> for Seconds {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, '_, PyAny>) -> PyResult<Seconds> {
        match given.extract::<f64>() {
            Ok(seconds) => Ok(Seconds(seconds)),
            Err(error) if error.is_instance_of::<PyOverflowError>(given.py()) => {
                Ok(Seconds(if given.lt(0)? { f64::NEG_INFINITY } else { f64::INFINITY }))
            }
            Err(_) => {
                let kind = type_name(&given);
                Err(PyTypeError::new_err(format!("timeout must be a number of seconds or None, got {kind}")))
            }
        }
    }
}

/// A timeout in seconds; `None` and what a `Duration` cannot hold, such as infinity, are no timeout.
pub fn seconds(timeout: Option<Seconds>) -> PyResult<Option<Duration>> {
    match timeout {
        None => Ok(None),
        Some(Seconds(seconds)) if seconds >= Duration::MAX.as_secs_f64() => Ok(None),
        Some(Seconds(seconds)) => Duration::try_from_secs_f64(seconds).map(Some).map_err(|_| {
            invalid(format!("timeout must be a number of seconds from 0, or None, got {seconds:?}"))
        }),
    }
}

/// A description or status as a dict.
pub fn dict_of<'py>(py: Python<'py>, value: &impl serde::Serialize) -> PyResult<Bound<'py, PyDict>> {
    let text = serde_json::to_string(value).map_err(invalid)?;
    Ok(py.import("json")?.call_method1("loads", (text,))?.cast_into::<PyDict>()?)
}

/// A C-contiguous array of i32: the one that was passed, if it is one, else a converted copy.
pub struct Ints<'py>(PyReadonlyArrayDyn<'py, i32>);

impl Ints<'_> {
    /// All elements, row-major.
    pub fn as_slice(&self) -> PyResult<&[i32]> {
        Ok(self.0.as_slice()?)
    }

    /// The length of the first axis.
    pub fn len(&self) -> usize {
        self.0.shape()[0]
    }
}

/// Actions for `count` environments: any integer array-like of shape `[count, n_agents]`.
pub fn actions<'py>(given: &Bound<'py, PyAny>, count: usize, n_agents: usize) -> PyResult<Ints<'py>> {
    ints("actions", given, &[Some(count), Some(n_agents)])
}

/// Environment ids: any integer array-like of one axis.
pub fn env_ids<'py>(given: Option<&Bound<'py, PyAny>>) -> PyResult<Option<Ints<'py>>> {
    given.map(|given| ints("env_id", given, &[None])).transpose()
}

/// A request that names environments must name at least one.
pub fn some<C: AsRef<[i32]>>(name: &str, chosen: C) -> PyResult<C> {
    match chosen.as_ref() {
        [] => Err(invalid(format!("{name} chooses no environment; at least one is needed"))),
        _ => Ok(chosen),
    }
}

/// The array that actions are written to, if it is fit for that.
pub fn actions_out<'py>(out: Bound<'py, PyAny>, shape: [usize; 2]) -> PyResult<Bound<'py, PyArray2<i32>>> {
    let wanted = format!("out must be a C-contiguous, writeable int32 array of shape {}", tuple(&shape));
    let Ok(array) = out.cast_into::<PyArray2<i32>>() else { return Err(PyTypeError::new_err(wanted)) };
    let fits = array.shape() == shape && array.is_c_contiguous() && array.try_readwrite().is_ok();
    if fits { Ok(array) } else { Err(invalid(wanted)) }
}

/// `None` in `shape` is any length.
fn ints<'py>(name: &str, given: &Bound<'py, PyAny>, shape: &[Option<usize>]) -> PyResult<Ints<'py>> {
    let array = as_array(name, given)?;
    let fits = array.ndim() == shape.len()
        && array.shape().iter().zip(shape).all(|(n, e)| e.is_none_or(|e| *n == e));
    if !fits {
        let got = match array.dtype().kind() {
            b'O' => type_name(given), // None, a dict, or what else is no array
            _ => tuple(array.shape()),
        };
        let wanted = wanted(shape);
        return Err(invalid(format!("{name} must be an integer array of shape {wanted}, got {got}")));
    }
    if let Ok(array) = array.cast::<PyArrayDyn<i32>>()
        && array.is_c_contiguous()
    {
        return Ok(Ints(array.try_readonly()?));
    }
    let py = array.py();
    let empty = array.len() == 0; // an empty list becomes an array of floats
    match array.dtype().kind() {
        b'i' => narrow::<i64>(name, &array.call_method1("astype", ("int64",))?),
        b'u' => narrow::<u64>(name, &array.call_method1("astype", ("uint64",))?),
        _ if empty => Ok(Ints(numpy::PyArray::zeros(py, array.shape(), false).try_readonly()?)),
        _ => {
            let dtype = array.dtype();
            let text = format!("{name} must be an integer array, got {dtype} (int32 avoids a copy)");
            Err(PyTypeError::new_err(text))
        }
    }
}

fn as_array<'py>(name: &str, given: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyUntypedArray>> {
    if let Ok(array) = given.cast::<PyUntypedArray>() {
        return Ok(array.clone());
    }
    let array = given.py().import("numpy")?.call_method1("asarray", (given,));
    let array = array
        .map_err(|error| invalid(format!("{name} cannot be made an array: {}", error.value(given.py()))))?;
    Ok(array.cast_into::<PyUntypedArray>()?)
}

/// As i32, if every element fits.
fn narrow<'py, T: Element + Copy + Display + TryInto<i32>>(
    name: &str,
    wide: &Bound<'py, PyAny>,
) -> PyResult<Ints<'py>> {
    let wide = wide.cast::<PyArrayDyn<T>>()?.try_readonly()?;
    let mut narrowed = Vec::with_capacity(wide.len());
    for (index, element) in wide.as_array().indexed_iter() {
        let value = (*element).try_into().map_err(|_| {
            invalid(format!(
                "{name} must fit into int32, got {element} at index {:?}",
                numpy::ndarray::Dimension::slice(&index)
            ))
        })?;
        narrowed.push(value);
    }
    let array = PyArray1::from_vec(wide.py(), narrowed).reshape(wide.shape())?;
    Ok(Ints(array.try_readonly()?))
}

/// The environments that a mask, `bool[num_envs]`, selects.
pub fn masked(mask: &Bound<'_, PyAny>, num_envs: usize) -> PyResult<Vec<i32>> {
    let array = as_array("mask", mask)?;
    if array.shape() != [num_envs] {
        let wanted = tuple(&[num_envs]);
        let got = tuple(array.shape());
        return Err(invalid(format!("mask must be a bool array of shape {wanted}, got shape {got}")));
    }
    let Ok(array) = array.cast::<PyArrayDyn<bool>>() else {
        return Err(PyTypeError::new_err(format!("mask must be a bool array, got {}", array.dtype())));
    };
    let array = array.try_readonly()?;
    let chosen =
        array.as_array().iter().zip(0..).filter(|(chosen, _)| **chosen).map(|(_, env)| env).collect();
    some("mask", chosen)
}

/// A shape as Python writes it.
fn tuple(shape: &[usize]) -> String {
    wanted(&shape.iter().copied().map(Some).collect::<Vec<_>>())
}

fn wanted(shape: &[Option<usize>]) -> String {
    let extents: Vec<_> = shape.iter().map(|n| n.map_or("K".to_owned(), |n| n.to_string())).collect();
    match extents.as_slice() {
        [one] => format!("({one},)"),
        _ => format!("({})", extents.join(", ")),
    }
}
