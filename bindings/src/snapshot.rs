//! Snapshots in Python: their columns as arrays, and back.

use crate::arrays::snapshots;
use crate::envs::arg::ScenarioArg;
use crate::errors::invalid_request;
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1};
use pyo3::exceptions::{PyKeyError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use smaclite_engine::{
    Arena, COLUMNS, Column, ColumnAxis, ColumnSpec, Opponent, RecordLayout, RecordSizes, Sides, Snapshot,
    SnapshotError,
};
use smaclite_scenarios::Scenario;
use smaclite_units::file::{did_you_mean, shortened};

/// Name, type, shape and meaning of every column.
pub fn table() -> Vec<(&'static str, &'static str, String, &'static str)> {
    let axis = |axis: &ColumnAxis| match axis {
        ColumnAxis::Unit => "n_units",
        ColumnAxis::Past => "n_past",
        ColumnAxis::Perception => "n_perception",
        ColumnAxis::Phase => "n_phases",
        ColumnAxis::Xy => "2",
    };
    let row = |spec: &ColumnSpec| {
        let shape: Vec<&str> = spec.axes.iter().map(axis).collect();
        (spec.name, spec.dtype.name(), shape.join(", "), spec.meaning)
    };
    COLUMNS.iter().map(row).collect()
}

fn snapshot_error(error: SnapshotError) -> PyErr {
    invalid_request(error)
}

/// Return the columns of a snapshot as a dict of arrays.
///
/// The arrays are copies: edit them, and let `pack_snapshot` make a snapshot of them again.
///
/// Args:
///     snapshot: uint8 [snapshot_size], a row of the field `snapshot` of a batch.
///
/// Returns:
///     A dict from the names of the columns to arrays; `docs/reference/snapshots.md` lists them with their
///     types, shapes and meanings. Single numbers are arrays without axes.
///
/// Raises:
///     InvalidRequest: these bytes are no snapshot, are damaged, or are of another version.
///     TypeError: the snapshot is not a uint8 array.
#[pyfunction]
pub fn snapshot_columns<'py>(snapshot: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
    let py = snapshot.py();
    let bytes = snapshots("snapshot", snapshot)?;
    let layout = RecordLayout::of(bytes.as_slice()?).map_err(snapshot_error)?;
    let columns = PyDict::new(py);
    for spec in &COLUMNS {
        let bytes = PyArray1::from_slice(py, layout.column(bytes.as_slice()?, spec.column));
        let array = bytes.call_method1("view", (spec.dtype.name(),))?;
        columns.set_item(spec.name, array.call_method1("reshape", (layout.shape(spec.column),))?)?;
    }
    Ok(columns)
}

/// Make a snapshot of columns, which may have been edited, and check it.
///
/// Where units were killed or revived (`alive`), or got a type of another plane, the order of equally near
/// neighbours begins anew. By the rules `starcraft`, units that are not alive lose what `hp` they have.
/// Column `checksum` is computed.
///
/// Args:
///     columns: a dict as `snapshot_columns` returns it.
///     scenario: the scenario of the snapshot: name of a standard scenario, path of a scenario file, or
///         `Envs`.
///
/// Returns:
///     uint8 [snapshot_size].
///
/// Raises:
///     InvalidRequest: a column has another shape or a value that the unit cannot have, there is a column
///         that snapshots do not have, or the snapshot is of another scenario.
///     KeyError: a column is missing.
///     TypeError: a column has a type that cannot be converted without loss.
///     ScenarioError: the scenario is unknown, or its file or a unit file is invalid.
#[pyfunction]
pub fn pack_snapshot<'py>(
    columns: &Bound<'py, PyDict>,
    scenario: ScenarioArg<'py>,
) -> PyResult<Bound<'py, PyArray1<u8>>> {
    let py = columns.py();
    let scenario = scenario.resolve(py)?;
    let layout = layout_of(columns, &scenario)?;
    check_names(columns)?;
    let bytes_of =
        |spec: &ColumnSpec| column_bytes(columns, spec.name, spec.dtype.name(), &layout.shape(spec.column));
    // All are there before memory is taken for the counts that some of them say.
    let bytes = COLUMNS.iter().map(bytes_of).collect::<PyResult<Vec<_>>>()?;
    let mut record = vec![0; layout.size()];
    for (spec, bytes) in COLUMNS.iter().zip(&bytes) {
        layout.column_mut(&mut record, spec.column).copy_from_slice(bytes.as_slice()?);
    }
    layout.seal(&mut record);
    let packed = py.detach(|| checked(&scenario, &layout, record)).map_err(snapshot_error)?;
    Ok(PyArray1::from_vec(py, packed))
}

/// The layout by the columns that say the sizes, which must be those of the scenario.
fn layout_of(columns: &Bound<'_, PyDict>, scenario: &Scenario) -> PyResult<RecordLayout> {
    let size = |column: Column| -> PyResult<usize> {
        let name = column.spec().name;
        let value = required(columns, name)?;
        let number = value.call_method0("__int__").and_then(|number| number.extract::<u32>());
        let number = number.map_err(|_| invalid_request(format!("column `{name}` must be a count")))?;
        Ok(number as usize)
    };
    let sizes = RecordSizes {
        n_agents: size(Column::NAgents)?,
        n_enemies: size(Column::NEnemies)?,
        n_past: size(Column::NPast)?,
        n_perception: size(Column::NPerception)?,
        n_phases: size(Column::NPhases)?,
    };
    let (expected, given) = ((scenario.n_agents(), scenario.n_enemies()), (sizes.n_agents, sizes.n_enemies));
    if given != expected || sizes.n_past > smaclite_engine::MAX_LAST_ACTIONS {
        return Err(invalid_request(format!(
            "columns `n_agents`, `n_enemies` and `n_past` must be {}, {} and at most {}, got {}, {} and {}",
            expected.0,
            expected.1,
            smaclite_engine::MAX_LAST_ACTIONS,
            given.0,
            given.1,
            sizes.n_past
        )));
    }
    Ok(RecordLayout::new(sizes))
}

/// The record again, as a battle writes it.
fn checked(
    scenario: &Scenario,
    layout: &RecordLayout,
    mut record: Vec<u8>,
) -> Result<Vec<u8>, SnapshotError> {
    let (n_past, learner) = (layout.sizes().n_past, Opponent::Learner.index() as u32);
    // Where a learner or a team plays the enemies, they have actions.
    let is_of_learner = layout.column(&record, Column::Opponent) == learner.to_le_bytes();
    let sides = if is_of_learner && scenario.smacv2.is_none() { Sides::Mirrored } else { Sides::Allies };
    let arena = Arena::new(scenario, layout.rules(&record)?).with_sides(sides);
    let (snapshot, past_actions) = Snapshot::of_edited_record(&arena, n_past, &record)?;
    snapshot.write_record(&arena, layout, &past_actions, &mut record);
    Ok(record)
}

/// Every column must be one that snapshots have: a mistyped one would change nothing.
fn check_names(columns: &Bound<'_, PyDict>) -> PyResult<()> {
    let names = || COLUMNS.iter().map(|spec| spec.name);
    for key in columns.keys() {
        let name = key.str()?.to_string();
        if !names().any(|known| known == name) {
            let hint = match &*name {
                "health" => "did you mean `hp`?".to_owned(),
                "position" => "did you mean `pos`?".to_owned(),
                "velocity" => "did you mean `vel`?".to_owned(),
                _ => did_you_mean(&name, names()),
            };
            return Err(invalid_request(format!("snapshots have no column `{}`; {hint}", shortened(&name))));
        }
    }
    Ok(())
}

fn required<'py>(columns: &Bound<'py, PyDict>, name: &str) -> PyResult<Bound<'py, PyAny>> {
    let missing = || PyKeyError::new_err(format!("there is no column `{name}`"));
    columns.get_item(name)?.ok_or_else(missing)
}

/// The bytes of a column of this type and shape.
fn column_bytes<'py>(
    columns: &Bound<'py, PyDict>,
    name: &str,
    dtype: &str,
    shape: &[usize],
) -> PyResult<PyReadonlyArray1<'py, u8>> {
    let numpy = columns.py().import("numpy")?;
    let value = numpy.call_method1("asarray", (required(columns, name)?,))?;
    if !numpy.call_method1("can_cast", (value.getattr("dtype")?, dtype, "same_kind"))?.extract::<bool>()? {
        let got = value.getattr("dtype")?;
        return Err(PyTypeError::new_err(format!("column `{name}` must be of type {dtype}, got {got}")));
    }
    let given: Vec<usize> = value.getattr("shape")?.extract()?;
    if given != shape {
        return Err(invalid_request(format!("column `{name}` must have shape {shape:?}, got {given:?}")));
    }
    let array = numpy.call_method1("ascontiguousarray", (&value, dtype))?;
    // Integers that do not fit become others; floats only lose digits, or are infinite, which is refused.
    let is_float = array.getattr("dtype")?.getattr("kind")?.extract::<String>()? == "f";
    let is_equal = |array: Bound<'py, PyAny>| -> PyResult<bool> {
        numpy.call_method1("array_equal", (array, &value))?.extract()
    };
    if !is_float && !is_equal(array.call_method1("reshape", (shape,))?)? {
        let message = format!("column `{name}` must fit into {dtype}, got {}", shortened(&value.to_string()));
        return Err(invalid_request(message));
    }
    let bytes = array.call_method1("reshape", (-1,))?.call_method1("view", ("uint8",))?;
    Ok(bytes.cast_into::<PyArray1<u8>>().map_err(PyErr::from)?.try_readonly()?)
}
