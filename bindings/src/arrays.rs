//! Arrays of Python arguments. Those of the right type are not copied before they are used, but for those
//! that are sent while other Python code runs. Every error names the argument, what was expected and what was
//! passed.

use crate::convert::{translated, type_name};
use crate::errors::invalid_request;
use numpy::{
    Element, PyArray1, PyArray2, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn,
    PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use std::fmt::Display;

/// An int32 array whose elements Rust can read as a slice: the one that was passed if it is one, otherwise a
/// converted copy.
pub struct Int32Array<'py>(PyReadonlyArrayDyn<'py, i32>);

impl Int32Array<'_> {
    /// All elements, in row-major order.
    pub fn as_slice(&self) -> PyResult<&[i32]> {
        Ok(self.0.as_slice()?)
    }

    /// The length of the first axis.
    pub fn len(&self) -> usize {
        self.0.shape()[0]
    }
}

/// A float32 array, as [`Int32Array`].
pub struct Float32Array<'py>(PyReadonlyArrayDyn<'py, f32>);

impl Float32Array<'_> {
    /// A copy of all elements, in row-major order, which no other thread changes.
    pub fn to_vec(&self) -> PyResult<Vec<f32>> {
        Ok(self.0.as_slice()?.to_vec())
    }

    /// The length of the first axis.
    pub fn len(&self) -> usize {
        self.0.shape()[0]
    }
}

/// Converts an array-like of floats. `None` in `shape` accepts any length up to [`MAX_ROWS`].
pub fn float32_array<'py>(
    name: &str,
    arg: &Bound<'py, PyAny>,
    shape: &[Option<usize>],
) -> PyResult<Float32Array<'py>> {
    let array = to_array(name, arg)?;
    check_shape(name, "a float32", arg, &array, shape)?;
    if array.dtype().kind() != b'f' {
        return Err(PyTypeError::new_err(format!("{name} must be a float32 array, got {}", array.dtype())));
    }
    Ok(Float32Array(readable::<f32>(&array, "float32")?.try_readonly()?))
}

/// A bool array of this shape as bytes, 0 for false.
pub fn bool_array<'py>(
    name: &str,
    arg: &Bound<'py, PyAny>,
    shape: &[Option<usize>],
) -> PyResult<PyReadonlyArrayDyn<'py, u8>> {
    let array = to_array(name, arg)?;
    check_shape(name, "a bool", arg, &array, shape)?;
    if array.dtype().kind() != b'b' {
        return Err(PyTypeError::new_err(format!("{name} must be a bool array, got {}", array.dtype())));
    }
    // Read as bytes: memory of the caller can have other values than 0 and 1, which Rust's `bool` must not.
    let bytes = array.call_method1("view", ("uint8",))?.cast_into::<PyUntypedArray>()?;
    Ok(readable::<u8>(&bytes, "uint8")?.try_readonly()?)
}

/// The array itself if Rust can read its elements as a slice, else a copy. NumPy's contiguous arrays need not
/// be aligned: the field of a packed record, and a message with a byte before its numbers, are not.
fn readable<'py, T: Element>(
    array: &Bound<'py, PyUntypedArray>,
    dtype: &str,
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    if let Ok(typed) = array.cast::<PyArrayDyn<T>>()
        && array.is_c_contiguous()
        && array.is_aligned()
    {
        return Ok(typed.clone());
    }
    // With copy=True, to memory of its own, which is aligned.
    let copy = array.call_method1("astype", (dtype, "C", "same_kind", false, true))?;
    Ok(copy.cast_into::<PyArrayDyn<T>>()?)
}

/// Actions for `num_envs` environments: an integer array-like of shape `[num_envs, n_actors]`.
pub fn actions<'py>(arg: &Bound<'py, PyAny>, num_envs: usize, n_actors: usize) -> PyResult<Actions<'py>> {
    contiguous_int32("actions", arg, &[Some(num_envs), Some(n_actors)]).map(Actions)
}

/// Actions as an int32 array that [`readable`] returned.
pub struct Actions<'py>(Bound<'py, PyArrayDyn<i32>>);

impl Actions<'_> {
    /// Reads them, in row-major order. A read-only borrow would allocate memory in each step.
    #[allow(unsafe_code)]
    pub fn read<R>(&self, read: impl FnOnce(&[i32]) -> R) -> R {
        // SAFETY: a request reads each number once, and what was read is what is checked and played. Whether
        // another thread writes to the array meanwhile is the responsibility of its Python code, as with any
        // NumPy operation.
        let actions = unsafe { self.0.as_slice() };
        // Only a finalizer that ran since the check can have changed the array so. No request has so many.
        read(actions.unwrap_or_default())
    }
}

/// Converts the argument `levels` of `reset`: floats of this shape. They are copied, because other Python
/// code may run before they are sent.
pub fn levels(arg: &Bound<'_, PyAny>, shape: &[Option<usize>]) -> PyResult<Vec<f32>> {
    float32_array("levels", arg, shape)?.to_vec()
}

/// Rows of bytes, as `reset` takes them.
pub type Snapshots<'py> = PyReadonlyArrayDyn<'py, u8>;

/// Converts an argument such as `snapshots` of `reset`: uint8 `[k, size]`, or `[size]` for one.
pub fn snapshots<'py>(name: &str, arg: &Bound<'py, PyAny>) -> PyResult<Snapshots<'py>> {
    let array = to_array(name, arg)?;
    if array.cast::<PyArrayDyn<u8>>().is_err() {
        return Err(PyTypeError::new_err(format!(
            "{name} must be a uint8 array, such as rows of `batch.snapshot`, got {}",
            array.dtype()
        )));
    }
    if array.len() > MAX_SNAPSHOT_BYTES {
        return Err(invalid_request(format!(
            "{name} must be rows of `batch.snapshot`, got {} bytes",
            array.len()
        )));
    }
    Ok(readable::<u8>(&array, "uint8")?.try_readonly()?)
}

/// More bytes than one request can have. A broadcast array of any length takes no memory before it is copied.
const MAX_SNAPSHOT_BYTES: usize = 1 << 32;

/// As [`snapshots`], those of `num_envs` environments whose own have `size` bytes; copied as
/// [`levels`] are. The error of another number of bytes is the client's, which knows how battles differ.
pub fn snapshot_rows(arg: &Bound<'_, PyAny>, num_envs: usize, size: usize) -> PyResult<Vec<u8>> {
    let name = "snapshots";
    let array = to_array(name, arg)?;
    let is_bytes = array.cast::<PyArrayDyn<u8>>().is_ok();
    let is_of_size = array.len() == num_envs * size;
    if is_bytes && is_of_size && (array.shape() != [size] || num_envs != 1) {
        check_shape(name, "a uint8", arg, &array, &[Some(num_envs), Some(size)])?;
    }
    Ok(snapshots(name, &array)?.as_slice()?.to_vec())
}

/// Ids of environments of a lane: an integer array-like with one axis, or a mask of all of them.
pub fn env_ids<'py>(name: &str, arg: &Bound<'py, PyAny>, num_envs: usize) -> PyResult<Int32Array<'py>> {
    let array = to_array(name, arg)?;
    if array.dtype().kind() != b'b' {
        return int32_array(name, arg, &[None]);
    }
    let mask = bool_array(name, &array, &[Some(num_envs)])?;
    let ids = mask.as_slice()?.iter().zip(0..).filter(|(selected, _)| **selected != 0);
    let ids = PyArray1::from_iter(arg.py(), ids.map(|(_, env)| env));
    Ok(Int32Array(ids.to_dyn().try_readonly()?))
}

/// Refuses an empty selection of environments.
pub fn require_envs<C: AsRef<[i32]>>(env_ids: C) -> PyResult<C> {
    if env_ids.as_ref().is_empty() {
        return Err(invalid_request("env_id must select at least one environment, got none"));
    }
    Ok(env_ids)
}

/// The array that sampled actions are written to.
pub fn output_array<'py>(out: Bound<'py, PyAny>, shape: [usize; 2]) -> PyResult<Bound<'py, PyArray2<i32>>> {
    let expected = format!(
        "out must be a C-contiguous, aligned, writeable int32 array of shape {}",
        format_shape(&shape)
    );
    let array = match out.cast_into::<PyArray2<i32>>() {
        Ok(array) => array,
        Err(error) => {
            let got = describe(&error.into_inner());
            return Err(PyTypeError::new_err(format!("{expected}, got {got}")));
        }
    };
    let got = if array.shape() != shape {
        describe(&array)
    } else if !array.is_c_contiguous() {
        "one that is not C-contiguous".to_owned()
    } else if !array.is_aligned() {
        "one that is not aligned".to_owned()
    } else if array.try_readwrite().is_err() {
        "one that is not writeable".to_owned()
    } else {
        return Ok(array);
    };
    Err(invalid_request(format!("{expected}, got {got}")))
}

/// An array's element type and shape, or the type of any other object.
fn describe(value: &Bound<'_, PyAny>) -> String {
    match value.cast::<PyUntypedArray>() {
        Ok(array) => format!("{} of shape {}", array.dtype(), format_shape(array.shape())),
        Err(_) => type_name(value),
    }
}

/// Converts an array-like of integers. `None` in `shape` accepts any length up to [`MAX_ROWS`].
pub fn int32_array<'py>(
    name: &str,
    arg: &Bound<'py, PyAny>,
    shape: &[Option<usize>],
) -> PyResult<Int32Array<'py>> {
    Ok(Int32Array(contiguous_int32(name, arg, shape)?.try_readonly()?))
}

fn contiguous_int32<'py>(
    name: &str,
    arg: &Bound<'py, PyAny>,
    shape: &[Option<usize>],
) -> PyResult<Bound<'py, PyArrayDyn<i32>>> {
    let array = to_array(name, arg)?;
    check_shape(name, "an integer", arg, &array, shape)?;
    if array.cast::<PyArrayDyn<i32>>().is_ok() {
        return readable::<i32>(&array, "int32");
    }
    let empty = array.len() == 0; // NumPy converts an empty list to a float array
    match array.dtype().kind() {
        b'i' => narrow::<i64>(name, &array.call_method1("astype", ("int64",))?),
        b'u' => narrow::<u64>(name, &array.call_method1("astype", ("uint64",))?),
        _ if empty => Ok(numpy::PyArray::zeros(array.py(), array.shape(), false)),
        _ => {
            let dtype = array.dtype();
            let text = format!("{name} must be an integer array, got {dtype} (int32 avoids a copy)");
            Err(PyTypeError::new_err(text))
        }
    }
}

/// More rows than any argument has: environments of a lane (1,000,000) or pictures of a sheet.
const MAX_ROWS: usize = 1 << 20;

/// Checks the shape before anything is copied: a broadcast array of any length takes no memory before.
fn check_shape(
    name: &str,
    elements: &str,
    arg: &Bound<'_, PyAny>,
    array: &Bound<'_, PyUntypedArray>,
    shape: &[Option<usize>],
) -> PyResult<()> {
    let has_shape = array.ndim() == shape.len()
        && array.shape().iter().zip(shape).all(|(n, expected)| match expected {
            Some(expected) => n == expected,
            None => *n <= MAX_ROWS,
        });
    if has_shape {
        return Ok(());
    }
    let got = match array.dtype().kind() {
        b'O' => type_name(arg), // not array-like: None, a dict, ...
        _ => format_shape(array.shape()),
    };
    let expected = format_expected_shape(shape);
    Err(invalid_request(format!("{name} must be {elements} array of shape {expected}, got {got}")))
}

/// Any array-like as an array; arrays are not copied.
pub fn to_array<'py>(name: &str, arg: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyUntypedArray>> {
    if let Ok(array) = arg.cast::<PyUntypedArray>() {
        return Ok(array.clone());
    }
    let array = arg.py().import("numpy")?.call_method1("asarray", (arg,));
    let array = array.map_err(|error| {
        translated(arg.py(), error, |error| {
            invalid_request(format!("{name} must be an array or nested lists: {}", error.value(arg.py())))
        })
    })?;
    Ok(array.cast_into::<PyUntypedArray>()?)
}

/// Converts to int32, if every element is in range.
fn narrow<'py, T: Element + Copy + Display + TryInto<i32>>(
    name: &str,
    wide: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArrayDyn<i32>>> {
    let wide = wide.cast::<PyArrayDyn<T>>()?.try_readonly()?;
    let mut narrowed = Vec::with_capacity(wide.len());
    for (index, element) in wide.as_array().indexed_iter() {
        let value = (*element).try_into().map_err(|_| {
            invalid_request(format!(
                "{name} must fit into int32, got {element} at index {:?}",
                numpy::ndarray::Dimension::slice(&index)
            ))
        })?;
        narrowed.push(value);
    }
    PyArray1::from_vec(wide.py(), narrowed).reshape(wide.shape())
}

/// A shape in Python's notation.
pub fn format_shape(shape: &[usize]) -> String {
    format_expected_shape(&shape.iter().copied().map(Some).collect::<Vec<_>>())
}

/// The same for an expected shape, with `K` for any length.
fn format_expected_shape(shape: &[Option<usize>]) -> String {
    let lengths: Vec<_> = shape.iter().map(|n| n.map_or("K".to_owned(), |n| n.to_string())).collect();
    match lengths.as_slice() {
        [one] => format!("({one},)"),
        _ => format!("({})", lengths.join(", ")),
    }
}
