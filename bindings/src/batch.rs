//! `Batch`, a received batch in Python, with one property per field, generated from the table of fields.

use crate::views::{self, Frame};
use pyo3::exceptions::{PyAttributeError, PyKeyError, PyTypeError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyCFunction, PyDict, PyTuple};
use smaclite_pool::fields::{Axis, FIELD_COUNT, FIELDS, Field, FieldSet, FieldSpec};
use std::ffi::CString;
use std::sync::Arc;

/// The results of M environments, one per slot, as returned by `recv`, `step` and `reset`.
///
/// In synchronous mode slot i is environment i; otherwise `env_id` says which environment a slot is.
///
/// Every field is a read-only NumPy array over shared memory; nothing is copied. The memory stays valid and
/// unchanged as long as the batch, or any array or slice of it, exists, even after the pool has ended. A
/// learner may hold `max_held_batches` batches at the same time; use `copy()` to keep data for longer.
///
/// In a forked child the memory stays unchanged only while the parent holds the batch; use `copy()` there.
///
/// torch has no read-only tensors, and a write to this memory would crash the process: `torch()` returns
/// tensors that raise an error instead.
//
// The base of the arrays is the frame and not the batch. The batch caches its arrays, so with the batch as
// base there would be a reference cycle, and the memory would be released only by the garbage collector.
#[pyclass(frozen, weakref, module = "smaclite_pool")]
pub struct Batch {
    received: Arc<smaclite_ipc::Batch>,
    /// Made for the first array: a step allocates nothing but the batch.
    frame: PyOnceLock<Py<Frame>>,
    views: [PyOnceLock<Py<PyAny>>; FIELD_COUNT],
}

impl Batch {
    pub fn new(received: Arc<smaclite_ipc::Batch>) -> Batch {
        Batch { received, frame: PyOnceLock::new(), views: [const { PyOnceLock::new() }; FIELD_COUNT] }
    }

    /// A field as an array; AttributeError if the lane does not include it.
    pub fn view<'py>(&self, py: Python<'py>, field: Field) -> PyResult<Bound<'py, PyAny>> {
        let view = self.views[field as usize].get_or_try_init(py, || {
            let frame = self.frame.get_or_try_init(py, || Py::new(py, Frame(Arc::clone(&self.received))))?;
            let array = views::array(frame.bind(py), field)?;
            array.map(Bound::unbind).ok_or_else(|| missing_field_error(field))
        });
        view.map(|array| array.bind(py).clone())
    }

    /// The received frame.
    pub fn received(&self) -> &Arc<smaclite_ipc::Batch> {
        &self.received
    }

    fn specs(&self) -> impl Iterator<Item = &'static FieldSpec> + use<> {
        self.received.layout().fields().iter().map(Field::spec)
    }
}

/// For a field that a lane does not include.
pub fn missing_field_error(field: Field) -> PyErr {
    let name = field.spec().name;
    PyAttributeError::new_err(if field.is_final() {
        format!("batches of this lane do not include `{name}`; it exists only with autoreset=\"same_step\"")
    } else if FieldSet::DEFAULT.contains(field) {
        format!("batches of this lane do not include `{name}`; add it to `fields`, or omit `fields` for all")
    } else {
        format!("batches of this lane do not include `{name}`; add it to `fields`")
    })
}

#[pymethods]
impl Batch {
    /// Number of this batch among all that the lane has sent, from 1.
    #[getter]
    fn sequence(&self) -> u64 {
        self.received.sequence()
    }

    /// Names of the fields in this batch.
    fn keys(&self) -> Vec<&'static str> {
        self.specs().map(|spec| spec.name).collect()
    }

    /// Return this batch with other arrays in some fields, for wrappers; nothing is copied.
    ///
    /// Args:
    ///     fields: the new arrays, by the names of the fields; new names are allowed.
    #[pyo3(signature = (**fields))]
    fn replace<'py>(
        slf: &Bound<'py, Self>,
        fields: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let fields = fields.map_or_else(|| PyDict::new(slf.py()), Bound::clone);
        slf.py().import("smaclite_pool._wrapper")?.call_method1("ChangedBatch", (slf, fields))
    }

    /// Return a dict from field names to writeable copies of the arrays, which do not keep the batch's
    /// memory.
    fn copy<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let copies = PyDict::new(py);
        for spec in self.specs() {
            copies.set_item(spec.name, self.view(py, spec.field)?.call_method0("copy")?)?;
        }
        Ok(copies)
    }

    /// Return a dict from field names to torch tensors over the same memory. A write to one raises an error.
    fn torch<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("smaclite_pool.integrations.torch")?.call_method1("tensors", (slf,))
    }

    /// Called where there is no attribute of that name, and where its getter raised AttributeError.
    fn __getattr__(&self, name: &str) -> PyResult<Py<PyAny>> {
        let absent = FIELDS.iter().find(|spec| spec.name == name).map(|spec| spec.field);
        Err(match absent {
            Some(field) => missing_field_error(field),
            None => PyAttributeError::new_err(format!(
                "a batch has no `{name}`; its fields are {}",
                self.keys().join(", ")
            )),
        })
    }

    /// A field by its name, as the attribute.
    fn __getitem__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        match Field::from_name(name).filter(|field| self.received.layout().fields().contains(*field)) {
            Some(field) => self.view(py, field),
            None => Err(PyKeyError::new_err(format!(
                "a batch has no field '{name}'; its fields are {}",
                self.keys().join(", ")
            ))),
        }
    }

    /// Whoever comes from Gymnasium unpacks a tuple first.
    fn __iter__(&self) -> PyResult<()> {
        Err(PyTypeError::new_err(
            "a batch is no tuple: use batch.obs, batch.reward, batch.terminated and its other fields; \
             environments of smaclite_pool.integrations.gymnasium return Gymnasium's tuples",
        ))
    }

    fn __contains__(&self, name: &str) -> bool {
        self.keys().contains(&name)
    }

    fn __len__(&self) -> usize {
        self.received.layout().slots()
    }

    fn __repr__(&self) -> String {
        format!(
            "<smaclite_pool.Batch of {} environments, number {} of its lane: {}>",
            self.__len__(),
            self.sequence(),
            self.keys().join(", ")
        )
    }
}

/// Adds a property to `Batch` for every field of the table.
pub fn add_field_properties(py: Python<'_>) -> PyResult<()> {
    let class = py.get_type::<Batch>();
    let property = py.import("builtins")?.getattr("property")?;
    for spec in &FIELDS {
        let getter = new_getter(py, spec)?;
        class.setattr(spec.name, property.call1((getter, py.None(), py.None(), docstring(spec)))?)?;
    }
    Ok(())
}

fn new_getter<'py>(py: Python<'py>, spec: &FieldSpec) -> PyResult<Bound<'py, PyCFunction>> {
    let field = spec.field;
    let name = CString::new(spec.name)?;
    let get = move |args: &Bound<'_, PyTuple>, _: Option<&Bound<'_, PyDict>>| -> PyResult<Py<PyAny>> {
        let batch = args.get_item(0)?.cast_into::<Batch>()?;
        batch.get().view(args.py(), field).map(Bound::unbind)
    };
    // The function refers to its name, and both exist until the process ends.
    PyCFunction::new_closure(py, Some(Box::leak(name.into_boxed_c_str())), None, get)
}

fn docstring(spec: &FieldSpec) -> String {
    let axis = |axis: &Axis| match axis {
        Axis::Agent => ", n_agents",
        Axis::Obs => ", obs_size",
        Axis::State => ", state_size",
        Axis::Action => ", n_actions",
        Axis::Snapshot => ", snapshot_size",
        Axis::Unit => ", n_units",
        Axis::LevelColumn => ", 5",
        Axis::Enemy => ", n_enemies",
        Axis::EnemyObs => ", enemy_obs_size",
        Axis::EnemyState => ", enemy_state_size",
        Axis::EnemyAction => ", n_enemy_actions",
    };
    let axes: String = spec.axes.iter().map(axis).collect();
    format!("{} [M{axes}]: {}. Read-only, in place.", spec.dtype.name(), spec.meaning)
}
