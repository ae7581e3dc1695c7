//! `Batch`, a received batch in Python, with one property per field, generated from the table of fields.

use crate::arrays::{bool_array, float32_array, format_shape, int32_array, to_array};
use crate::convert::type_name;
use crate::errors::invalid_request;
use crate::habits::{self, Place};
use crate::views::{self, Frame};
use numpy::{PyArrayDescrMethods, PyUntypedArrayMethods};
use pyo3::exceptions::{PyAttributeError, PyKeyError, PyTypeError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyCFunction, PyDict, PyString, PyTuple, PyType};
use smaclite_pool::fields::{Axis, FIELD_COUNT, FIELDS, Field, FieldSet, FieldSpec};
use smaclite_pool::layout::{Element, Layout};
use std::borrow::Cow;
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
/// A batch is a mapping from the names of its fields to their arrays: `batch["obs"]`, `"obs" in batch`,
/// `keys()`, `values()`, `items()`, `get()`, `dict(batch)` and `f(**batch)`. `len(batch)` is M, the number of
/// its slots. It is not iterable, because code for Gymnasium would unpack it as a tuple of observations,
/// rewards and so on.
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
    replaced: Option<Replaced>,
}

/// What `replace` changed.
struct Replaced {
    /// The batch as it was received, which has the other arrays.
    original: Py<Batch>,
    /// The new arrays by their names.
    fields: Py<PyDict>,
}

impl Batch {
    pub fn new(received: Arc<smaclite_ipc::Batch>) -> Batch {
        let views = [const { PyOnceLock::new() }; FIELD_COUNT];
        Batch { received, frame: PyOnceLock::new(), views, replaced: None }
    }

    /// As it was received.
    pub fn received(&self) -> &smaclite_ipc::Batch {
        &self.received
    }

    /// A field as an array; AttributeError if the lane does not include it.
    pub fn view<'py>(&self, py: Python<'py>, field: Field) -> PyResult<Bound<'py, PyAny>> {
        if let Some(replaced) = &self.replaced {
            return match self.replacement(py, field.spec().name)? {
                Some(array) => Ok(array),
                None => replaced.original.get().view(py, field),
            };
        }
        let view = self.views[field as usize].get_or_try_init(py, || {
            let frame = self.frame.get_or_try_init(py, || Py::new(py, Frame(Arc::clone(&self.received))))?;
            let array = views::array(frame.bind(py), field)?;
            array.map(Bound::unbind).ok_or_else(|| missing_field_error(field))
        });
        view.map(|array| array.bind(py).clone())
    }

    /// The array that `replace` gave a field.
    fn replacement<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.replaced.as_ref().map_or(Ok(None), |replaced| replaced.fields.bind(py).get_item(name))
    }

    /// The sizes and fields of the lane that it is of.
    pub fn layout(&self) -> &Layout {
        self.received.layout()
    }

    /// The numbers of a float field: in place, or a copy of the array that replaced them.
    pub fn floats(&self, py: Python<'_>, field: Field) -> PyResult<Cow<'_, [f32]>> {
        self.elements(py, field, |name, array, shape| float32_array(name, array, shape)?.to_vec())
    }

    /// As [`floats`](Self::floats), the bytes of a bool field.
    pub fn flags(&self, py: Python<'_>, field: Field) -> PyResult<Cow<'_, [u8]>> {
        self.elements(py, field, |name, array, shape| {
            Ok(bool_array(name, array, shape)?.as_slice()?.to_vec())
        })
    }

    /// As [`floats`](Self::floats), the ids of the environments.
    pub fn env_id(&self, py: Python<'_>) -> PyResult<Cow<'_, [i32]>> {
        self.elements(py, Field::EnvId, |name, array, shape| {
            Ok(int32_array(name, array, shape)?.as_slice()?.to_vec())
        })
    }

    /// A field in place, or what `read` makes of the array that replaced it.
    fn elements<T: Element + Clone>(
        &self,
        py: Python<'_>,
        field: Field,
        read: impl FnOnce(&str, &Bound<'_, PyAny>, &[Option<usize>]) -> PyResult<Vec<T>>,
    ) -> PyResult<Cow<'_, [T]>> {
        let name = field.spec().name;
        match self.replacement(py, name)? {
            Some(array) => Ok(Cow::Owned(read(name, &array, &self.shape(field))?)),
            None => self.received.field(field).map(Cow::Borrowed).ok_or_else(|| missing_field_error(field)),
        }
    }

    fn shape(&self, field: Field) -> Vec<Option<usize>> {
        self.layout().shape(field).into_iter().map(Some).collect()
    }

    /// The names of all fields, those that `replace` added last.
    fn names(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        let fields = self.layout().fields();
        let mut names: Vec<String> = fields.iter().map(|field| field.spec().name.to_owned()).collect();
        if let Some(replaced) = &self.replaced {
            for name in replaced.fields.bind(py).keys() {
                let name: String = name.extract()?;
                if !names.contains(&name) {
                    names.push(name);
                }
            }
        }
        Ok(names)
    }

    /// A field by its name, also one that `replace` added; `None` if there is none.
    fn find<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        if let Some(array) = self.replacement(py, name)? {
            return Ok(Some(array));
        }
        let field = Field::from_name(name).filter(|field| self.layout().fields().contains(*field));
        field.map(|field| self.view(py, field)).transpose()
    }
}

/// An array for a field of this name, with a row per slot.
fn new_field<'py>(
    class: &Bound<'py, PyType>,
    name: &str,
    value: &Bound<'py, PyAny>,
    slots: usize,
) -> PyResult<Bound<'py, PyAny>> {
    if Field::from_name(name).is_none() && class.hasattr(name)? {
        return Err(invalid_request(format!(
            "`{name}` is an attribute of every batch, so no field can have this name; choose another one"
        )));
    }
    let array = to_array(name, value)?;
    if array.dtype().kind() == b'O' {
        let text = format!("{name} must be an array of numbers, got {}", type_name(value));
        return Err(PyTypeError::new_err(text));
    }
    if array.shape().first() != Some(&slots) {
        return Err(invalid_request(format!(
            "{name} must have one row per slot of the batch, {slots}, got shape {}",
            format_shape(array.shape())
        )));
    }
    Ok(array.into_any())
}

/// For a field that a lane does not include.
pub fn missing_field_error(field: Field) -> PyErr {
    let name = field.spec().name;
    let advice = if field.is_final() {
        "it exists only with autoreset_mode=\"SameStep\", if `fields` names it or is omitted"
    } else if FieldSet::DEFAULT.contains(field) {
        "add it to `fields`, or omit `fields` for all"
    } else {
        "add it to `fields`"
    };
    let where_it_exists = if field.is_of_enemies() { "with sides=\"both\", " } else { "" };
    PyAttributeError::new_err(format!(
        "batches of this lane do not include `{name}`; {where_it_exists}{advice}"
    ))
}

#[pymethods]
impl Batch {
    /// Number of this batch among all that the lane has sent, from 1.
    #[getter]
    fn sequence(&self) -> u64 {
        self.received.sequence()
    }

    /// Names of the fields in this batch.
    fn keys(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.names(py)
    }

    /// The arrays of the fields, in the order of `keys()`.
    fn values<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyAny>>> {
        Ok(self.items(py)?.into_iter().map(|(_, array)| array).collect())
    }

    /// Names and arrays of the fields.
    fn items<'py>(&self, py: Python<'py>) -> PyResult<Vec<(String, Bound<'py, PyAny>)>> {
        let names = self.names(py)?.into_iter();
        names.map(|name| self.__getitem__(py, &name).map(|array| (name, array))).collect()
    }

    /// A field by its name; `default` if the batch does not have it.
    #[pyo3(signature = (name, default=None, /))]
    fn get<'py>(
        &self,
        py: Python<'py>,
        name: &str,
        default: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Option<Bound<'py, PyAny>>> {
        Ok(self.find(py, name)?.or(default))
    }

    /// Return a batch with other arrays in some fields, for wrappers; nothing is copied, and all other fields
    /// are those of this batch.
    ///
    /// Args:
    ///     fields: the new arrays, with one row per slot, by the names of the fields; new names are allowed.
    ///         What is not an array, such as a list, is converted to one.
    ///
    /// Raises:
    ///     InvalidRequest: an array does not have M rows, or a name is that of a method.
    ///     TypeError: a value is not an array of numbers.
    #[pyo3(signature = (**fields))]
    fn replace<'py>(slf: &Bound<'py, Self>, fields: Option<&Bound<'py, PyDict>>) -> PyResult<Batch> {
        let (py, batch) = (slf.py(), slf.get());
        let (original, known) = match &batch.replaced {
            Some(replaced) => (replaced.original.clone_ref(py), replaced.fields.bind(py).copy()?),
            None => (slf.clone().unbind(), PyDict::new(py)),
        };
        for (name, value) in fields.into_iter().flatten() {
            let text: String = name.extract()?;
            known.set_item(name, new_field(&slf.get_type(), &text, &value, batch.__len__())?)?;
        }
        let mut replaced = Batch::new(Arc::clone(&batch.received));
        replaced.replaced = Some(Replaced { original, fields: known.unbind() });
        Ok(replaced)
    }

    /// Return a dict from field names to writeable copies of the arrays, which do not keep the batch's
    /// memory.
    fn copy<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let copies = PyDict::new(py);
        for (name, array) in self.items(py)? {
            copies.set_item(name, array.call_method0("copy")?)?;
        }
        Ok(copies)
    }

    /// Return a dict from field names to torch tensors over the same memory. A write to one raises an error.
    fn torch<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("smaclite_pool.integrations.torch")?.call_method1("tensors", (slf,))
    }

    /// Called where there is no attribute of that name, and where its getter raised AttributeError.
    fn __getattr__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        if let Some(added) = self.replacement(py, name)? {
            return Ok(added);
        }
        Err(match Field::from_name(name) {
            Some(field) => missing_field_error(field),
            None => PyAttributeError::new_err(format!(
                "a batch has no `{name}`; {}its fields are {}",
                habits::prefix(Place::Batch, name),
                self.names(py)?.join(", ")
            )),
        })
    }

    /// A field by its name, as the attribute.
    fn __getitem__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let names = || self.names(py).map(|names| names.join(", "));
        match self.find(py, name)? {
            Some(array) => Ok(array),
            None => Err(PyKeyError::new_err(format!(
                "a batch has no field '{name}'; {}its fields are {}",
                habits::prefix(Place::Batch, name),
                names()?
            ))),
        }
    }

    /// What comes from Gymnasium unpacks a tuple first.
    fn __iter__(&self) -> PyResult<()> {
        Err(PyTypeError::new_err(
            "a batch is no tuple: use batch.obs, batch.reward, batch.terminated and its other fields, or \
             batch.items() for all; environments of smaclite_pool.integrations.gymnasium return Gymnasium's \
             tuples",
        ))
    }

    fn __contains__(&self, py: Python<'_>, name: &Bound<'_, PyAny>) -> PyResult<bool> {
        // As in a dict, nothing but a string is the name of a field.
        let Ok(name) = name.cast::<PyString>() else { return Ok(false) };
        Ok(self.find(py, &name.to_string_lossy())?.is_some())
    }

    fn __len__(&self) -> usize {
        self.layout().slots()
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let changed = match &self.replaced {
            None => String::new(),
            Some(replaced) => {
                let names: Vec<String> = replaced.fields.bind(py).keys().extract()?;
                format!(" with other {}", names.join(", "))
            }
        };
        Ok(format!(
            "<smaclite_pool.Batch of {} environments, number {} of its lane{changed}: {}>",
            self.__len__(),
            self.sequence(),
            self.names(py)?.join(", ")
        ))
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
