//! numpy arrays over a frame's shared memory: in place, read-only, and keeping the frame alive.

use crate::batch::Frame;
use numpy::ndarray::{ArrayView, IxDyn};
use numpy::{Element, PyArray, PyArrayDyn, PyArrayMethods};
use pyo3::prelude::*;
use smaclite_pool::fields::{Dtype, Field};

/// A field of a frame as an array whose base is the frame; `None` if the lane leaves the field out.
pub fn array<'py>(frame: &Bound<'py, Frame>, field: Field) -> PyResult<Option<Bound<'py, PyAny>>> {
    let array = match field.spec().dtype {
        Dtype::F32 => typed::<f32>(frame, field)?.map(Bound::into_any),
        Dtype::I32 => typed::<i32>(frame, field)?.map(Bound::into_any),
        Dtype::Bool => typed::<bool>(frame, field)?.map(Bound::into_any),
    };
    Ok(array)
}

/// Has numpy loaded now: `numpy` would load it at its first use and panic if Ctrl-C came in between.
pub fn ready_numpy(py: Python<'_>) -> PyResult<()> {
    py.import("numpy")?;
    PyArray::<i32, _>::zeros(py, [0], false).try_readonly()?;
    Ok(())
}

/// `T` must be the field's element type.
fn typed<'py, T: Element>(
    frame: &Bound<'py, Frame>,
    field: Field,
) -> PyResult<Option<Bound<'py, PyArrayDyn<T>>>> {
    let batch = &frame.get().0;
    let layout = batch.layout();
    let Some(start) = layout.offset(field) else { return Ok(None) };
    let shape = layout.shape(field);
    let bytes = shape.iter().product::<usize>() * size_of::<T>();
    let first = batch.bytes()[start..start + bytes].as_ptr().cast::<T>();
    debug_assert!(first.is_aligned());
    // SAFETY: the slice above shows that `shape` elements of `T` lie at `first`, which is aligned: blocks are on cache
    // lines. No Rust reference to the elements is made: ndarray and numpy only note the pointer, shape and strides, so
    // a byte that is not 0 or 1 in a boolean field, which only a hostile supervisor writes, is numpy's to interpret.
    let view = unsafe { ArrayView::from_shape_ptr(IxDyn(&shape), first) };
    // SAFETY: the base object is the frame, which owns the sample: its memory stays mapped, and is not given back to be
    // written again, until the frame is freed. Nothing writes through this array: it is made read-only before anyone
    // else sees it, and numpy lets nobody undo that, since its base is not a writeable buffer.
    let array = unsafe { PyArray::borrow_from_array(&view, frame.clone().into_any()) };
    let array = array.try_readwrite()?.make_nonwriteable();
    Ok(Some((*array).clone()))
}
