//! `ScriptedPolicy`: the scripted policies of the engine, played with the fields of batches.

use crate::arrays;
use crate::batch::{Batch, missing_field_error};
use crate::convert::{IntArg, side_name, to_side, to_unsigned};
use crate::envs::arg::EnvsArg;
use crate::envs::render::require_units_in_states;
use crate::errors::{class, invalid_request};
use crate::wait::check_interrupts;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use smaclite_engine::policy::Scripted;
use smaclite_engine::{Arena, Faction, Sizes};
use smaclite_pool::fields::Field;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// How long a thread waits before it asks again for a policy that another one is using.
const WAIT: Duration = Duration::from_micros(20);

/// What a policy sees of a side.
fn fields(side: Faction) -> [Field; 2] {
    match side {
        Faction::Ally => [Field::State, Field::AvailActions],
        Faction::Enemy => [Field::EnemyState, Field::EnemyAvailActions],
    }
}

/// A scripted policy, which chooses the actions of all environments of a batch.
///
///     policy = smaclite_pool.ScriptedPolicy("focus_fire", envs)
///     batch = envs.step(policy(batch))
///
/// It depends on nothing but the batch, and chooses available actions only. `random` draws for one slot of
/// the batch after the other.
///
/// Args:
///     name: one of the policies that `docs/reference/policies.md` describes.
///     envs: the environments to play in, or a wrapper of them, with the fields `state` and
///         `avail_actions`.
///     seed: of `random`, from 0 to `2**64 - 1`; None for one of the seed of `envs` and the
///         side.
///     side: "allies", or "enemies" to choose the actions of the enemies, where actions play both sides; it
///         needs the fields `enemy_state` and `enemy_avail_actions` then.
///
/// Raises:
///     InvalidRequest: the name or the side is unknown, the lane omits a field, the seed is out of range, or
///         states do not say what the units are (`obs_instead_of_state` of `smacv2`; drawn types without
///         numbers), which all policies but `random` read.
///     TypeError: the seed is not an integer.
///     PoolDied: the pool that `envs` attached to has ended.
#[pyclass(frozen, module = "smaclite_pool")]
pub struct ScriptedPolicy {
    name: String,
    side: Faction,
    fields: [Field; 2],
    arena: Arena,
    scripted: Mutex<State>,
}

/// What a policy draws by.
enum State {
    Here(Scripted),
    /// A thread of this process has it.
    TakenBy(u32),
}

#[pymethods]
impl ScriptedPolicy {
    #[new]
    #[pyo3(signature = (name, envs, *, seed=None, side="allies"))]
    #[pyo3(text_signature = "(name, envs, *, seed=None, side='allies')")]
    fn new(
        py: Python<'_>,
        name: String,
        envs: EnvsArg<'_>,
        seed: Option<IntArg>,
        side: &str,
    ) -> PyResult<ScriptedPolicy> {
        let envs = envs.0.get();
        let side = to_side(side)?;
        let seed = match seed {
            Some(seed) => to_unsigned("seed", seed)?,
            // Another one per side, and another one than that of `sample_actions`.
            None => envs.lane_description().settings.seed.rotate_left(32) ^ (1 + side as u64),
        };
        let scripted = Scripted::from_name(&name, seed).map_err(invalid_request)?;
        let fields = fields(side);
        if let Some(missing) = fields.into_iter().find(|field| envs.layout().offset(*field).is_none()) {
            if side == Faction::Enemy && envs.layout().sizes().enemies.is_none() {
                return Err(invalid_request(
                    "side must be `allies` in environments whose actions play the agents alone; \
                     make(..., sides=\"both\") or `serve --sides both` have actions for the enemies, too",
                ));
            }
            let [state, masks, missing] = [fields[0], fields[1], missing].map(|field| field.spec().name);
            return Err(invalid_request(format!(
                "scripted policies need the fields `{state}` and `{masks}`, but this lane omits `{missing}`"
            )));
        }
        let scenario = envs.scenario_of_lane(py)?;
        if side == Faction::Ally && name != "random" {
            require_units_in_states(&format!("the policy {name} reads"), &scenario)?;
        }
        if name != "random" && scenario.draws_teams() && !scenario.tells_types_apart() {
            return Err(invalid_request(format!(
                "the policy {name} reads the types of units in states, but these do not tell apart the types \
                 that each episode draws: give each a number (`num_unit_types` and `unit_type_ids`)"
            )));
        }
        let arena = Arena::new(&scenario, envs.rules()?);
        Ok(ScriptedPolicy { name, side, fields, arena, scripted: Mutex::new(State::Here(scripted)) })
    }

    /// Choose the actions of all environments of a batch. Other Python threads run meanwhile.
    ///
    /// Args:
    ///     batch: a batch of the lane.
    ///     out: a writeable C-contiguous int32 array [M, n_agents] to write to, or for the enemies
    ///         [M, n_enemies]; None allocates one.
    ///
    /// Returns:
    ///     int32, of that shape: the actions of slot i in row i; `out`, if it was passed.
    ///
    /// Raises:
    ///     Forked: this process was forked while another thread used the policy.
    ///     InvalidRequest: the batch is of a lane with other sizes, or `out` has another shape.
    ///     TypeError: `out` is not a two-dimensional int32 array.
    #[pyo3(signature = (batch, out=None))]
    fn __call__<'py>(
        &self,
        py: Python<'py>,
        batch: &Bound<'py, Batch>,
        out: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<i32>>> {
        self.act(py, batch.get(), out)
    }

    /// The policy's name.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// The side whose actions it chooses, "allies" or "enemies".
    #[getter]
    fn side(&self) -> &'static str {
        side_name(self.side)
    }

    fn __repr__(&self) -> String {
        format!("<smaclite_pool.ScriptedPolicy {}>", self.name)
    }
}

impl ScriptedPolicy {
    fn state(&self) -> MutexGuard<'_, State> {
        self.scripted.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes the state, for which other threads wait. The lock is not kept meanwhile: a process that one of
    /// them forks would wait for a thread that only its parent has.
    fn take(&self, py: Python<'_>) -> PyResult<Scripted> {
        let process = std::process::id();
        loop {
            let state = std::mem::replace(&mut *self.state(), State::TakenBy(process));
            match state {
                State::Here(scripted) => return Ok(scripted),
                State::TakenBy(other) if other != process => {
                    *self.state() = State::TakenBy(other);
                    return Err(class::Forked::new_err(
                        "a thread was using this policy when this process was forked; make another one",
                    ));
                }
                State::TakenBy(_) => {}
            }
            check_interrupts(py)?;
            py.detach(|| std::thread::sleep(WAIT));
        }
    }

    fn act<'py>(
        &self,
        py: Python<'py>,
        batch: &Batch,
        out: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<i32>>> {
        let [state, masks] = self.fields;
        let own = if state == Field::State { Faction::Ally } else { Faction::Enemy };
        let sizes = batch.layout().sizes().of(own).ok_or_else(|| missing_field_error(state))?;
        // Policies read no observations, which may have what a lane appends.
        let Sizes { obs_size, enemies, .. } = sizes;
        let expected = Sizes { obs_size, enemies, ..self.arena.sizes_of(self.side) };
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
        let (states, masks) = (batch.floats(py, state)?, batch.flags(py, masks)?);
        let shape = [batch.layout().slots(), sizes.n_agents];
        let out = out.map(|out| arrays::output_array(out, shape)).transpose()?;
        // Not written to `out` directly: other threads may use that array meanwhile.
        let mut policy = self.take(py)?;
        let actions = py.detach(|| {
            let mut actions = vec![0; shape[0] * shape[1]];
            policy.act_batch_of(self.side, &self.arena, &states, &masks, &mut actions);
            actions
        });
        *self.state() = State::Here(policy);
        match out {
            Some(out) => {
                out.try_readwrite()?.as_slice_mut()?.copy_from_slice(&actions);
                Ok(out)
            }
            None => PyArray1::from_vec(py, actions).reshape(shape),
        }
    }
}
