//! A received batch in Python: one property a field, derived from the table of fields.

use crate::views;
use pyo3::exceptions::PyAttributeError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyCFunction, PyDict, PyTuple};
use smaclite_pool::fields::{Axis, FIELD_COUNT, FIELDS, Field, FieldSpec};
use std::ffi::CString;

/// The shared memory of one frame, held for as long as this object lives. It is the base of the arrays of a `Batch`.
#[pyclass(frozen, module = "smaclite_pool")]
pub struct Frame(pub smaclite_ipc::Batch);

#[pymethods]
impl Frame {
    /// Counts the frames of the lane, from 1.
    #[getter]
    fn sequence(&self) -> u64 {
        self.0.sequence()
    }

    fn __repr__(&self) -> String {
        format!("<smaclite_pool.Frame {} of {} bytes>", self.sequence(), self.0.bytes().len())
    }
}

/// What `recv`, `step` and `reset` return: M slots, one environment each, in synchronous mode in the order of the
/// environments.
///
/// Every field is a read-only numpy array over shared memory: nothing is copied, and the memory stays valid
/// and unchanged for as long as the batch, or any array or slice of it, is held, also after the pool is gone.
/// A lane lets a learner hold `max_held_batches` batches at once; `copy()` what must stay longer. In a forked
/// child they stay unchanged only while the parent holds them: `copy()` what the child keeps.
///
/// torch does not know read-only memory, where a write would end the process: `torch()` gives tensors that know.
//
// The arrays' base is the frame, not the batch: with the batch they would form a cycle, and only the garbage collector
// would give the frame back.
#[pyclass(frozen, weakref, module = "smaclite_pool")]
pub struct Batch {
    frame: Py<Frame>,
    views: [PyOnceLock<Py<PyAny>>; FIELD_COUNT],
}

impl Batch {
    pub fn new(py: Python<'_>, batch: smaclite_ipc::Batch) -> PyResult<Batch> {
        Ok(Batch { frame: Py::new(py, Frame(batch))?, views: [const { PyOnceLock::new() }; FIELD_COUNT] })
    }

    fn view<'py>(&self, py: Python<'py>, field: Field) -> PyResult<Bound<'py, PyAny>> {
        let view = self.views[field as usize].get_or_try_init(py, || {
            let array = views::array(self.frame.bind(py), field)?;
            array.map(Bound::unbind).ok_or_else(|| left_out(field))
        });
        view.map(|array| array.bind(py).clone())
    }

    fn present(&self) -> impl Iterator<Item = &'static FieldSpec> {
        self.frame.get().0.layout().fields().iter().map(Field::spec)
    }
}

fn left_out(field: Field) -> PyErr {
    let name = field.spec().name;
    PyAttributeError::new_err(if field.is_final() {
        format!("batches of this lane have no `{name}`: it exists with autoreset=\"same_step\"")
    } else {
        format!("batches of this lane have no `{name}`: name it in `fields`, or leave `fields` away for all")
    })
}

#[pymethods]
impl Batch {
    /// Counts the frames of the lane, from 1.
    #[getter]
    fn sequence(&self) -> u64 {
        self.frame.get().sequence()
    }

    /// Names of the fields that the lane's batches have.
    fn keys(&self) -> Vec<&'static str> {
        self.present().map(|spec| spec.name).collect()
    }

    /// All fields as ordinary arrays of one's own, by name; they hold no frame.
    fn copy<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let copies = PyDict::new(py);
        for spec in self.present() {
            copies.set_item(spec.name, self.view(py, spec.field)?.call_method0("copy")?)?;
        }
        Ok(copies)
    }

    /// All fields as torch tensors over the same memory, by name; a write to one raises. See `smaclite_pool.torch`.
    fn torch<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("smaclite_pool.integrations.torch")?.call_method1("tensors", (slf,))
    }

    fn __len__(&self) -> usize {
        self.frame.get().0.layout().slots()
    }

    fn __repr__(&self) -> String {
        format!(
            "<smaclite_pool.Batch {} of {} environments: {}>",
            self.sequence(),
            self.__len__(),
            self.keys().join(", ")
        )
    }
}

/// Gives `Batch` a property for every field of the table.
pub fn add_fields(py: Python<'_>) -> PyResult<()> {
    let class = py.get_type::<Batch>();
    let property = py.import("builtins")?.getattr("property")?;
    for spec in &FIELDS {
        let getter = getter(py, spec)?;
        class.setattr(spec.name, property.call1((getter, py.None(), py.None(), documentation(spec)))?)?;
    }
    Ok(())
}

fn getter<'py>(py: Python<'py>, spec: &FieldSpec) -> PyResult<Bound<'py, PyCFunction>> {
    let field = spec.field;
    let name = CString::new(spec.name)?;
    let get = move |args: &Bound<'_, PyTuple>, _: Option<&Bound<'_, PyDict>>| -> PyResult<Py<PyAny>> {
        let batch = args.get_item(0)?.cast_into::<Batch>()?;
        batch.get().view(args.py(), field).map(Bound::unbind)
    };
    // The interpreter keeps the name for as long as the function, which is as long as the process.
    PyCFunction::new_closure(py, Some(Box::leak(name.into_boxed_c_str())), None, get)
}

fn documentation(spec: &FieldSpec) -> String {
    let axis = |axis: &Axis| match axis {
        Axis::Agent => ", n_agents",
        Axis::Obs => ", obs_size",
        Axis::State => ", state_size",
        Axis::Action => ", n_actions",
    };
    let axes: String = spec.axes.iter().map(axis).collect();
    format!("{} [M{axes}]: {}. Read-only, in place.", spec.dtype.name(), spec.meaning)
}
