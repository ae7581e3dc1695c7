//! `LaneSpec`, what never changes about a lane: a class of `_spec.py`.

use crate::convert::to_dict;
use numpy::PyArrayDescr;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use smaclite_ipc::LaneDescription;
use smaclite_pool::layout::Layout;

fn class(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    py.import("smaclite_pool._spec")?.getattr("LaneSpec")
}

/// The object of a lane.
pub fn lane_spec<'py>(
    py: Python<'py>,
    description: &LaneDescription,
    layout: &Layout,
) -> PyResult<Bound<'py, PyAny>> {
    let fields = PyDict::new(py);
    for field in layout.fields().iter() {
        let dtype = PyArrayDescr::new(py, field.spec().dtype.name())?;
        fields.set_item(field.spec().name, (dtype, PyTuple::new(py, layout.shape(field))?))?;
    }
    class(py)?.call_method1("_of", (to_dict(py, description)?, fields, layout.snapshot_size()))
}

/// The names of its attributes.
pub fn attributes(py: Python<'_>) -> PyResult<Vec<String>> {
    let fields = class(py)?.getattr("__dataclass_fields__")?;
    let names = fields.try_iter()?.map(|name| name?.extract::<String>());
    names.chain([Ok("n_actors".to_owned())]).collect()
}
