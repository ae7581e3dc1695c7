//! NumPy arrays over the shared memory of a frame: not copied, read-only, and each keeps the frame alive.

use numpy::ndarray::{ArrayView, IxDyn};
use numpy::{Element, PyArray, PyArrayDyn, PyArrayMethods};
use pyo3::prelude::*;
use smaclite_pool::fields::{Dtype, Field};
use std::sync::Arc;

/// The shared memory of one batch, which is not reused while this object exists. It is the base of the arrays
/// of a `Batch`.
#[pyclass(frozen, module = "smaclite_pool")]
pub struct Frame(pub Arc<smaclite_ipc::Batch>);

#[pymethods]
impl Frame {
    /// Number of this batch among all that the lane has sent, from 1.
    #[getter]
    fn sequence(&self) -> u64 {
        self.0.sequence()
    }

    fn __repr__(&self) -> String {
        format!("<smaclite_pool.Frame {} of {} bytes>", self.sequence(), self.0.bytes().len())
    }
}

/// A field of a frame as an array whose base object is the frame; `None` if the lane does not include the
/// field.
pub fn array<'py>(frame: &Bound<'py, Frame>, field: Field) -> PyResult<Option<Bound<'py, PyAny>>> {
    let array = match field.spec().dtype {
        Dtype::F32 => typed_array::<f32>(frame, field)?.map(Bound::into_any),
        Dtype::I32 => typed_array::<i32>(frame, field)?.map(Bound::into_any),
        Dtype::U8 => typed_array::<u8>(frame, field)?.map(Bound::into_any),
        Dtype::Bool => typed_array::<bool>(frame, field)?.map(Bound::into_any),
        Dtype::U32 | Dtype::U64 | Dtype::F64 => unreachable!("no field has such elements"),
    };
    Ok(array)
}

/// Loads NumPy's C API. The crate `numpy` would otherwise load it at its first use, and panic if Ctrl-C
/// interrupted that.
pub fn load_numpy(py: Python<'_>) -> PyResult<()> {
    py.import("numpy")?;
    PyArray::<i32, _>::zeros(py, [0], false).try_readonly()?;
    Ok(())
}

/// `T` must be the field's element type.
fn typed_array<'py, T: Element>(
    frame: &Bound<'py, Frame>,
    field: Field,
) -> PyResult<Option<Bound<'py, PyArrayDyn<T>>>> {
    let batch = &frame.get().0;
    let Some(start) = batch.layout().offset(field) else { return Ok(None) };
    let shape = batch.layout().shape(field);
    let bytes = shape.iter().product::<usize>() * size_of::<T>();
    let first = batch.bytes()[start..start + bytes].as_ptr().cast::<T>();
    debug_assert!(first.is_aligned());
    // SAFETY: the slice expression above checks that the bytes of `shape` elements of `T` exist at `first`.
    // `first` is aligned, because every field starts on a cache line. No Rust reference to an element is
    // created: ndarray and numpy only store the pointer, shape and strides. A hostile supervisor may
    // therefore write bytes other than 0 and 1 to a boolean field; only NumPy reads them.
    let view = unsafe { ArrayView::from_shape_ptr(IxDyn(&shape), first) };
    // SAFETY: the array's base object is the frame, which owns the sample. Until the frame is freed, the
    // memory stays mapped and is not returned to the supervisor, which would overwrite it. Nothing writes
    // through this array: it is made read-only before any other code can access it, and NumPy refuses to make
    // it writeable again, because its base object is not a writeable buffer.
    let array = unsafe { PyArray::borrow_from_array(&view, frame.clone().into_any()) };
    let array = array.try_readwrite()?.make_nonwriteable();
    Ok(Some((*array).clone()))
}
