//! `ScriptedPolicy`: the scripted policies of the engine, played with the fields of batches.

use crate::batch::{Batch, missing_field_error};
use crate::convert::{self, IntArg, to_unsigned};
use crate::envs::Envs;
use crate::errors::invalid_request;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use smaclite_engine::policy::Scripted;
use smaclite_engine::{Arena, Rules, Sizes};
use smaclite_pool::fields::Field;
use std::sync::{Mutex, PoisonError};

/// What a policy sees.
const FIELDS: [Field; 2] = [Field::State, Field::AvailActions];

/// A scripted policy, which chooses the actions of all environments of a batch.
///
///     policy = smaclite_pool.ScriptedPolicy("focus_fire", envs)
///     batch = envs.step(policy(batch))
///
/// It depends on nothing but the batch, and chooses available actions only. `random` draws for one slot of
/// the batch after the other.
///
/// Args:
///     name: "random", "nearest", "focus_fire", "kite" or "hold"; the page "Scripted policies" of the
///         documentation describes them.
///     envs: the environments to play in, with the fields `state` and `avail_actions`.
///     seed: of `random`, from 0 to `2**64 - 1`.
///
/// Raises:
///     InvalidRequest: the name is unknown, the lane omits a field, or the seed is out of range.
///     TypeError: the seed is not an integer.
///     NoSuchPool: the pool that `envs` attached to has ended.
#[pyclass(frozen, module = "smaclite_pool")]
pub struct ScriptedPolicy {
    name: String,
    arena: Arena,
    scripted: Mutex<Scripted>,
}

#[pymethods]
impl ScriptedPolicy {
    #[new]
    #[pyo3(signature = (name, envs, *, seed=IntArg::Small(0)))]
    #[pyo3(text_signature = "(name, envs, *, seed=0)")]
    fn new(py: Python<'_>, name: String, envs: &Bound<'_, Envs>, seed: IntArg) -> PyResult<ScriptedPolicy> {
        let scripted = Scripted::from_name(&name, to_unsigned("seed", seed)?).map_err(invalid_request)?;
        let envs = envs.get();
        if let Some(field) = FIELDS.into_iter().find(|field| envs.layout().offset(*field).is_none()) {
            let field = field.spec().name;
            return Err(invalid_request(format!(
                "scripted policies need the fields `state` and `avail_actions`, but this lane omits `{field}`"
            )));
        }
        let rules = envs.lane_description().rules.parse::<Rules>().map_err(invalid_request)?;
        let arena = Arena::new(&envs.scenario_of_lane(py)?, rules);
        Ok(ScriptedPolicy { name, arena, scripted: Mutex::new(scripted) })
    }

    /// Choose the actions of all environments of a batch. Other Python threads run meanwhile.
    ///
    /// Args:
    ///     batch: a batch of the lane.
    ///     out: a writeable C-contiguous int32 array [M, n_agents] to write to; None allocates one.
    ///
    /// Returns:
    ///     int32 [M, n_agents]: the actions of slot i in row i; `out`, if it was passed.
    ///
    /// Raises:
    ///     InvalidRequest: the batch is of a lane with other sizes, or `out` has another shape.
    ///     TypeError: `out` is not a two-dimensional int32 array.
    #[pyo3(signature = (batch, out=None))]
    fn __call__<'py>(
        &self,
        py: Python<'py>,
        batch: &Bound<'py, Batch>,
        out: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<i32>>> {
        self.act(py, batch.get().received(), out)
    }

    /// The policy's name.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    fn __repr__(&self) -> String {
        format!("<smaclite_pool.ScriptedPolicy {}>", self.name)
    }
}

impl ScriptedPolicy {
    fn act<'py>(
        &self,
        py: Python<'py>,
        batch: &smaclite_ipc::Batch,
        out: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<i32>>> {
        let sizes = batch.layout().sizes();
        // Policies read no observations, which may have what a lane appends.
        let expected = Sizes { obs_size: sizes.obs_size, ..self.arena.sizes() };
        if sizes != expected {
            return Err(invalid_request(format!(
                "this policy is for {} against {} units and states of {} features, \
                 got a batch with {} against {} units and states of {} features",
                expected.n_agents,
                expected.n_enemies,
                expected.state_size,
                sizes.n_agents,
                sizes.n_enemies,
                sizes.state_size
            )));
        }
        let states = batch.field::<f32>(Field::State).ok_or_else(|| missing_field_error(Field::State))?;
        let masks = batch.field::<u8>(Field::AvailActions);
        let masks = masks.ok_or_else(|| missing_field_error(Field::AvailActions))?;
        let shape = [batch.layout().slots(), sizes.n_agents];
        let out = out.map(|out| convert::output_array(out, shape)).transpose()?;
        // Not written to `out` directly: other threads may use that array meanwhile.
        let actions = py.detach(|| {
            let mut actions = vec![0; shape[0] * shape[1]];
            let mut scripted = self.scripted.lock().unwrap_or_else(PoisonError::into_inner);
            scripted.act_batch(&self.arena, states, masks, &mut actions);
            actions
        });
        match out {
            Some(out) => {
                out.try_readwrite()?.as_slice_mut()?.copy_from_slice(&actions);
                Ok(out)
            }
            None => PyArray1::from_vec(py, actions).reshape(shape),
        }
    }
}
