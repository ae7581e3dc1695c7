//! What Python passes as what Rust takes, or an error that says what was passed. Arrays that fit are read in place.

use crate::errors::invalid;
use numpy::{
    Element, PyArray1, PyArray2, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn,
    PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::fmt::Display;
use std::str::FromStr;
use std::time::Duration;

/// A Python integer as a type with less room.
pub fn whole<T: TryFrom<i128>>(name: &str, value: i128) -> PyResult<T> {
    let range = if value < 0 { "cannot be negative" } else { "is too large" };
    T::try_from(value).map_err(|_| invalid(format!("{name}={value} {range}")))
}

/// One of a few words.
pub fn word<T: FromStr>(word: &str) -> PyResult<T>
where
    T::Err: Display,
{
    word.parse::<T>().map_err(invalid)
}

/// A timeout in seconds; `None` and what a `Duration` cannot hold, such as infinity, are no timeout.
pub fn seconds(timeout: Option<f64>) -> PyResult<Option<Duration>> {
    match timeout {
        None => Ok(None),
        Some(seconds) if seconds >= Duration::MAX.as_secs_f64() => Ok(None),
        Some(seconds) => Duration::try_from_secs_f64(seconds)
            .map(Some)
            .map_err(|_| invalid(format!("timeout={seconds}: a number of seconds from 0, or None"))),
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

/// The array that actions are written to, if it is fit for that.
pub fn actions_out<'py>(out: Bound<'py, PyAny>, shape: [usize; 2]) -> PyResult<Bound<'py, PyArray2<i32>>> {
    let wanted = format!("out: a C-contiguous, writeable int32 array of shape {} is taken", tuple(&shape));
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
        return Err(invalid(format!(
            "{name}: shape {} was given, {} is taken",
            tuple(array.shape()),
            wanted(shape)
        )));
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
            let text = format!(
                "{name}: dtype {} was given, integers are taken (int32 without conversion)",
                array.dtype()
            );
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
        .map_err(|error| invalid(format!("{name}: cannot be made an array: {}", error.value(given.py()))))?;
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
                "{name}: {element} at index {:?} is beyond int32",
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
        return Err(invalid(format!("mask: shape {} was given, {wanted} is taken", tuple(array.shape()))));
    }
    let Ok(array) = array.cast::<PyArrayDyn<bool>>() else {
        return Err(PyTypeError::new_err(format!("mask: dtype {} was given, bool is taken", array.dtype())));
    };
    let array = array.try_readonly()?;
    Ok(array.as_array().iter().zip(0..).filter(|(chosen, _)| **chosen).map(|(_, env)| env).collect())
}

/// A shape as Python writes it.
fn tuple(shape: &[usize]) -> String {
    wanted(&shape.iter().copied().map(Some).collect::<Vec<_>>())
}

fn wanted(shape: &[Option<usize>]) -> String {
    let extents: Vec<_> = shape.iter().map(|n| n.map_or("any".to_owned(), |n| n.to_string())).collect();
    match extents.as_slice() {
        [one] => format!("({one},)"),
        _ => format!("({})", extents.join(", ")),
    }
}
