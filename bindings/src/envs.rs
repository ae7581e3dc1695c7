//! `Envs`, the environments of a lane in Python: the methods of a client, with their documentation. They stay
//! in one file, as PyO3 reads the methods of a class from one block. What they need is inside: the client
//! that one thread uses at a time (`shared`), requests (`requests`), pictures (`render`), and arguments that
//! are environments or their scenario (`arg`).

pub(crate) mod arg;
pub(crate) mod render;
mod requests;
mod shared;

use self::render::{Renderer, SheetStyle, render_batch};
use self::requests::begin_step;
use self::shared::{ClientGuard, SharedClient};
use crate::arrays::{self, Int32Array};
use crate::batch::Batch;
use crate::convert::{IntArg, timeout_seconds, to_duration, to_unsigned};
use crate::errors::{class, client_error, connect_error, invalid_request};
use crate::exit::{self, CloseAtExit};
use crate::habits::{Place, cannot_be_copied, no_attribute, refuse_keywords};
use crate::lane_spec::lane_spec;
use crate::query::runtime_dir;
use crate::wait::{run_on_thread, wait_detached};
use numpy::{PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use smaclite_engine::Rules;
use smaclite_ipc::{
    Client, ClientError, ConnectError, ControlSocketError, LaneDescription, Order, Supervisor, WaitOptions,
    lane_scenario,
};
use smaclite_pool::layout::Layout;
use smaclite_scenarios::Scenario;
use std::sync::Arc;

/// A pool within this process, which ends with the last of its `Envs`, and the scenario of its lanes.
#[derive(Clone)]
pub struct Embedded {
    pub supervisor: Arc<Supervisor>,
    pub scenario: Scenario,
}

/// The environments of a lane, as returned by `make` and `connect`.
///
/// This process is the lane's only learner until `close` or the end of a `with` block. In the documentation
/// of the methods, N is `spec.num_envs`, M is `spec.batch_size` and K is the number of environments in a
/// request.
///
/// `timeout` is a number of seconds, at least 0; None means no limit. Ctrl-C interrupts every wait. After
/// Timeout or KeyboardInterrupt the batch is still being computed, or there: call `recv` to get it, or
/// `reset` to discard it; where Ctrl-C came with the batch, the next request of a synchronous lane discards
/// it, too.
///
/// In an asynchronous lane, `step`, `reset` and `fork` raise InvalidRequest, and request nothing, if fewer
/// than M results would be outstanding with theirs.
///
/// Only one thread may call these environments at a time; a concurrent call raises Busy. After a fork, calls
/// in the child raise Forked; calls after `close` raise Closed.
#[pyclass(frozen, weakref, module = "smaclite_pool")]
pub struct Envs {
    shared: Arc<SharedClient>,
    description: LaneDescription,
    layout: Layout,
    /// Made at once: when Python ends, it can import nothing any more.
    spec: Py<PyAny>,
    /// Of an embedded pool.
    scenario: Option<Scenario>,
}

impl Envs {
    pub fn new(py: Python<'_>, client: Client, embedded: Option<Embedded>) -> PyResult<Envs> {
        let (description, layout) = (client.description().clone(), client.layout().clone());
        let spec = lane_spec(py, &description, &layout)?.unbind();
        exit::end_at_exit(client.folder_use());
        let (supervisor, scenario) = embedded.map(|pool| (pool.supervisor, pool.scenario)).unzip();
        let shared = Arc::new(SharedClient::new(client, supervisor));
        let weak = Arc::downgrade(&shared);
        exit::close_at_exit(weak);
        Ok(Envs { shared, description, layout, spec, scenario })
    }

    pub fn lane_description(&self) -> &LaneDescription {
        &self.description
    }

    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The rules of its battles.
    pub fn rules(&self) -> PyResult<Rules> {
        self.description.rules.parse().map_err(invalid_request)
    }

    /// The scenario of the lane, for which an attached client asks the pool.
    pub fn scenario_of_lane(&self, py: Python<'_>) -> PyResult<Scenario> {
        if let Some(scenario) = &self.scenario {
            return Ok(scenario.clone());
        }
        let runtime_dir = runtime_dir()?;
        let (pool, lane) = (self.description.pool.clone(), self.description.lane.clone());
        let received = run_on_thread(py, move |cancelled| {
            lane_scenario(&runtime_dir, &pool, Some(&lane), WaitOptions::interrupted_by(cancelled))
        })?;
        let (lane, setup) = received.map_err(|error| match error {
            ConnectError::Control(ControlSocketError::NoSuchPool { pool, .. }) => {
                client_error(ClientError::PoolDied { pool })
            }
            other => connect_error(other),
        })?;
        if lane.instance != self.description.instance {
            // Another pool has the name by now.
            return Err(client_error(ClientError::PoolDied { pool: lane.pool }));
        }
        let scenario = setup.files.scenario();
        scenario.map_err(|problems| class::ScenarioError::new_err(problems.to_string()))
    }

    /// Sends a request to copy environments, and stays in its call; with `receives`, only if a batch arrives.
    fn send_fork(
        &self,
        py: Python<'_>,
        env_id_from: &Bound<'_, PyAny>,
        env_id_to: &Bound<'_, PyAny>,
        seed: Option<&Bound<'_, PyAny>>,
        receives: bool,
    ) -> PyResult<ClientGuard<'_>> {
        let num_envs = self.description.settings.num_envs;
        let from = arrays::env_ids("env_id_from", env_id_from, num_envs)?;
        let to = arrays::env_ids("env_id_to", env_id_to, num_envs)?;
        let (from, to) = (from.as_slice()?.to_vec(), to.as_slice()?.to_vec());
        let seeds = self.seeds(seed, Some(&to))?;
        let mut guard = self.shared.try_lock()?;
        if receives {
            guard.check_is_answered(Some(&to))?;
        }
        let client = guard.client();
        let fork = Order::Fork { from: &from, seeds: seeds.as_deref() };
        wait_detached(py, None, |wait| client.send(fork, Some(&to), wait))?;
        Ok(guard)
    }

    /// The batch to draw if none was passed.
    fn newest_batch(&self) -> PyResult<Batch> {
        self.shared
            .try_lock()?
            .client()
            .newest()
            .cloned()
            .map(Batch::new)
            .ok_or_else(|| invalid_request("there is no batch to draw: none was received yet; pass a batch"))
    }
}

#[pymethods]
impl Envs {
    /// Start new episodes and return the batch with their first observations.
    ///
    /// A reset of all environments discards results that were not received. A synchronous lane always returns
    /// all environments; those that were not selected are unchanged, but for the first reset after `make` or
    /// `connect`, which begins new episodes in them. In an asynchronous lane the first must be of all.
    ///
    /// Args:
    ///     seed: from 0 to `2**64 - 1`; environment i is seeded with seed + i. Or a list of one seed per
    ///         environment that is reset, as Gymnasium's vector environments take it. None, also in the list,
    ///         continues an environment's random generator; the first reset after `make` or `connect` then
    ///         uses the seed of `make` or `smaclite-pool serve`.
    ///     env_id: the environments to reset: their ids, integers [K], or a mask, bool [N], which selects K
    ///         of them. None, the default, resets all.
    ///     levels: float32 [K, n_units, 5], how the episodes of these environments begin: for each agent and
    ///         then for each enemy its type (an index into `scenario()["unit_types"]`), x and y in squares,
    ///         health as a share of the full health, and 1 if it is in the battle, else 0. None: the
    ///         scenario's units. The lane needs the field `level`, which has rows of this form. Only
    ///         generated scenarios take other types than their own units have.
    ///     snapshots: uint8 [K, snapshot_size], where these environments continue: rows of the field
    ///         `snapshot` of this or another lane of the same scenario, rule set and `obs_last_actions`. The
    ///         lane needs the field (`make(..., fields=[..., "snapshot"])`). No step is made: rewards are 0,
    ///         and `was_reset` is true of all environments in the batch. Either all selected environments
    ///         change, or none. Those with a seed go on with the execution orders that a reset with it would
    ///         draw, others with those that would have been drawn.
    ///     timeout: seconds to wait for the batch; None for no limit.
    ///
    /// Raises:
    ///     InvalidRequest: an argument is invalid, a selected environment is still working on an earlier
    ///         request, or a snapshot is damaged, of another scenario, rule set or version, or has an
    ///         impossible value; the text names environment, column and unit.
    ///     TypeError: a seed is not an integer, `env_id` neither integers nor bool, or the snapshots are not
    ///         uint8.
    ///     Timeout: the batch did not arrive in time.
    ///     TooManyBatchesHeld: `max_held_batches` batches are in use.
    ///     PoolDied: the pool has ended.
    ///     LaneFailed: the lane failed.
    #[pyo3(signature = (
        seed=None, env_id=None, timeout=None, *, levels=None, snapshots=None, **unknown
    ))]
    #[pyo3(text_signature = "($self, seed=None, env_id=None, timeout=None, *, levels=None, snapshots=None)")]
    #[allow(clippy::too_many_arguments)] // keyword arguments in Python
    fn reset(
        &self,
        py: Python<'_>,
        seed: Option<&Bound<'_, PyAny>>,
        env_id: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = timeout_seconds)] timeout: Option<f64>,
        levels: Option<&Bound<'_, PyAny>>,
        snapshots: Option<&Bound<'_, PyAny>>,
        unknown: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Batch> {
        let known = ["seed", "env_id", "timeout", "levels", "snapshots"];
        refuse_keywords(Place::Reset, "reset", unknown, &known)?;
        let timeout = to_duration(timeout)?;
        let arguments = self.reset_arguments(seed, env_id, levels, snapshots)?;
        let (order, ids) = (arguments.order(), arguments.ids());
        let mut guard = self.shared.try_lock()?;
        let client = guard.sent();
        let batch = wait_detached(py, timeout, |wait| client.request(order, ids, wait)).map(Batch::new)?;
        guard.hand_over(py, batch)
    }

    /// Send actions and return the next batch: `send`, then `recv`.
    ///
    /// Args:
    ///     actions: integers [K, n_actors], as for `send`.
    ///     env_id: integers [K] or bool [N], as for `send`.
    ///     timeout: seconds to wait for the batch; None for no limit.
    ///
    /// Ctrl-C: the step is made nevertheless, and `recv` returns its batch.
    ///
    /// Raises:
    ///     IllegalAction: an action is not available; no environment was stepped.
    ///     InvalidRequest: an argument is invalid; no environment was stepped.
    ///     TypeError: actions or environment ids are not integers; no environment was stepped.
    ///     Timeout: the batch did not arrive in time.
    ///     TooManyBatchesHeld: `max_held_batches` batches are in use.
    ///     PoolDied: the pool has ended.
    ///     LaneFailed: the lane failed.
    #[pyo3(signature = (actions=None, env_id=None, timeout=None, **unknown))]
    #[pyo3(text_signature = "($self, actions, env_id=None, timeout=None)")]
    fn step(
        &self,
        py: Python<'_>,
        actions: Option<&Bound<'_, PyAny>>,
        env_id: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = timeout_seconds)] timeout: Option<f64>,
        unknown: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Batch> {
        refuse_keywords(Place::Step, "step", unknown, &["actions", "env_id", "timeout"])?;
        let timeout = to_duration(timeout)?;
        let (actions, ids) = self.step_arguments(py, actions, env_id)?;
        let ids = ids.as_ref().map(Int32Array::as_slice).transpose()?;
        let mut guard = self.shared.try_lock()?;
        guard.check_is_answered(ids)?;
        begin_step(py, guard.client(), actions, ids)?;
        guard.sent();
        guard.receive(py, timeout)
    }

    /// Send actions without waiting for the result.
    ///
    /// Args:
    ///     actions: integers [K, n_actors], one action per agent, each 0 to n_actions - 1 and available
    ///         according to `avail_actions`; if actions play both sides, then one per enemy, available
    ///         according to `enemy_avail_actions`. A C-contiguous int32 array is copied straight to
    ///         where the pool reads it; other integer arrays and nested lists are converted first.
    ///     env_id: the ids of the environments, integers [K], each at most once, or a mask of them, bool
    ///         [N]. None, the default, means all in order. In synchronous mode every request must include all
    ///         environments.
    ///
    /// If an action is not available, no environment is stepped, and the next `recv` raises IllegalAction.
    ///
    /// Raises:
    ///     InvalidRequest: an argument is invalid, or an environment is still working on an earlier request;
    ///         no environment was stepped.
    ///     TypeError: actions or environment ids are not integers; no environment was stepped.
    ///     PoolError: the pool did not read the request within 5 seconds; nothing was sent.
    ///     PoolDied: the pool has ended.
    ///     LaneFailed: the lane failed.
    #[pyo3(signature = (actions=None, env_id=None, **unknown))]
    #[pyo3(text_signature = "($self, actions, env_id=None)")]
    fn send(
        &self,
        py: Python<'_>,
        actions: Option<&Bound<'_, PyAny>>,
        env_id: Option<&Bound<'_, PyAny>>,
        unknown: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<()> {
        refuse_keywords(Place::Step, "send", unknown, &["actions", "env_id"])?;
        let (actions, ids) = self.step_arguments(py, actions, env_id)?;
        let ids = ids.as_ref().map(Int32Array::as_slice).transpose()?;
        let mut guard = self.shared.try_lock()?;
        begin_step(py, guard.client(), actions, ids)?;
        guard.sent().leave();
        Ok(())
    }

    /// Wait for the next batch: the first M environments that finish.
    ///
    /// Args:
    ///     timeout: seconds to wait for the batch; None for no limit.
    ///
    /// Raises:
    ///     IllegalAction: an action that was sent is not available; no environment was stepped.
    ///     InvalidRequest: fewer than M results are outstanding, so no batch would arrive.
    ///     Timeout: the batch did not arrive in time.
    ///     TooManyBatchesHeld: `max_held_batches` batches are in use.
    ///     PoolError: batches were lost because this process did not receive them in time; reset all
    ///         environments.
    ///     PoolDied: the pool has ended.
    ///     LaneFailed: the lane failed.
    #[pyo3(signature = (timeout=None))]
    fn recv(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = timeout_seconds)] timeout: Option<f64>,
    ) -> PyResult<Batch> {
        let timeout = to_duration(timeout)?;
        self.shared.try_lock()?.receive(py, timeout)
    }

    /// Request new episodes without waiting; `recv` returns the first observations.
    ///
    /// Args:
    ///     seed, env_id, levels, snapshots: as for `reset`.
    ///
    /// If a snapshot is refused, no environment changes, and the next `recv` raises InvalidRequest.
    ///
    /// Raises:
    ///     InvalidRequest: an argument is invalid, or a selected environment is still working on an earlier
    ///         request.
    ///     TypeError: a seed is not an integer, `env_id` neither integers nor bool, or the snapshots are not
    ///         uint8.
    ///     PoolError: the pool did not read the request within 5 seconds; nothing was sent.
    ///     PoolDied: the pool has ended.
    ///     LaneFailed: the lane failed.
    #[pyo3(signature = (seed=None, env_id=None, *, levels=None, snapshots=None))]
    fn async_reset(
        &self,
        py: Python<'_>,
        seed: Option<&Bound<'_, PyAny>>,
        env_id: Option<&Bound<'_, PyAny>>,
        levels: Option<&Bound<'_, PyAny>>,
        snapshots: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let arguments = self.reset_arguments(seed, env_id, levels, snapshots)?;
        let (order, ids) = (arguments.order(), arguments.ids());
        let mut guard = self.shared.try_lock()?;
        let client = guard.client();
        wait_detached(py, None, |wait| client.send(order, ids, wait))?;
        guard.sent();
        Ok(())
    }

    /// Copy the states of environments to others, inside the pool, and return the batch with the
    /// observations.
    ///
    /// Environment `env_id_to[k]` takes the state that `env_id_from[k]` had before the call; an environment
    /// may be copied several times. All else is as for `reset` with snapshots. The lane needs no field
    /// `snapshot`.
    ///
    /// Args:
    ///     env_id_from: integers [K], or bool [N], the environments to copy.
    ///     env_id_to: integers [K], or bool [N], the environments that change, each once.
    ///     seed: as for `reset` with snapshots. None: copies have the same future as what they are copies of,
    ///         if they get the same actions.
    ///     timeout: seconds to wait for the batch; None for no limit.
    ///
    /// Raises:
    ///     InvalidRequest: an argument is invalid, or an environment is still working on an earlier request.
    ///     TypeError: environment ids or the seed are not integers.
    ///     Timeout: the batch did not arrive in time.
    ///     TooManyBatchesHeld: `max_held_batches` batches are in use.
    ///     PoolDied: the pool has ended.
    ///     LaneFailed: the lane failed.
    #[pyo3(signature = (env_id_from, env_id_to, *, seed=None, timeout=None))]
    fn fork(
        &self,
        py: Python<'_>,
        env_id_from: &Bound<'_, PyAny>,
        env_id_to: &Bound<'_, PyAny>,
        seed: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = timeout_seconds)] timeout: Option<f64>,
    ) -> PyResult<Batch> {
        let timeout = to_duration(timeout)?;
        let mut guard = self.send_fork(py, env_id_from, env_id_to, seed, true)?;
        guard.sent();
        guard.receive(py, timeout)
    }

    /// Request what `fork` does, without waiting; `recv` returns the observations.
    ///
    /// Args:
    ///     env_id_from, env_id_to, seed: as for `fork`.
    ///
    /// Raises:
    ///     InvalidRequest: an argument is invalid, or an environment is still working on an earlier request.
    ///     TypeError: environment ids or the seed are not integers.
    ///     PoolError: the pool did not read the request within 5 seconds; nothing was sent.
    ///     PoolDied: the pool has ended.
    ///     LaneFailed: the lane failed.
    #[pyo3(signature = (env_id_from, env_id_to, *, seed=None))]
    fn async_fork(
        &self,
        py: Python<'_>,
        env_id_from: &Bound<'_, PyAny>,
        env_id_to: &Bound<'_, PyAny>,
        seed: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        self.send_fork(py, env_id_from, env_id_to, seed, false)?.sent();
        Ok(())
    }

    /// Draw uniformly random available actions, according to `avail_actions` of the newest batch.
    ///
    /// Args:
    ///     env_id: integers [K], the ids of environments in the newest batch, or bool [N]; None, the default,
    ///         means all environments of the lane.
    ///     out: a writeable C-contiguous int32 array [K, n_actors] to write to; None allocates one.
    ///
    /// Returns:
    ///     int32 [K, n_actors]: the actions; `out`, if it was passed.
    ///
    /// Raises:
    ///     InvalidRequest: an argument is invalid, there was no reset yet, an environment is not in the
    ///         newest batch, or the lane omits the field `avail_actions`.
    ///     TypeError: `out` is not a two-dimensional int32 array, or environment ids are not integers.
    #[pyo3(signature = (env_id=None, out=None))]
    fn sample_actions<'py>(
        &self,
        py: Python<'py>,
        env_id: Option<&Bound<'py, PyAny>>,
        out: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<i32>>> {
        let ids = self.env_ids(env_id)?;
        let shape = [self.request_size(ids.as_ref()), self.description.sizes.n_actors()];
        let out = match out {
            Some(out) => arrays::output_array(out, shape)?,
            None => PyArray2::zeros(py, shape, false),
        };
        let ids = ids.as_ref().map(Int32Array::as_slice).transpose()?;
        let mut guard = self.shared.try_lock()?;
        let mut actions = out.try_readwrite()?;
        guard.client().sample_actions(ids, actions.as_slice_mut()?).map_err(client_error)?;
        drop(actions);
        Ok(out)
    }

    /// Seed the random generator of `sample_actions`, which begins with the seed of the lane.
    ///
    /// Args:
    ///     seed: from 0 to `2**64 - 1`.
    ///
    /// Raises:
    ///     InvalidRequest: the seed is out of range.
    fn seed_sampler(&self, seed: IntArg) -> PyResult<()> {
        let seed = to_unsigned("seed", seed)?;
        self.shared.try_lock()?.client().seed_sampler(seed);
        Ok(())
    }

    /// Draw environments of a batch from above, with north at the top.
    ///
    /// Pictures of other sizes and looks need a `Renderer`; use one also for many pictures, as without it
    /// each call draws the map again.
    ///
    /// Args:
    ///     batch: a batch of this lane, with the field `state`. None: the newest batch.
    ///     env_id: the id of one environment; or integers [K] or bool [N], whose pictures are put into one
    ///         sheet, each with its caption above it. None: a sheet of all environments of the batch.
    ///     renderer: how to draw. None: 512 x 512 pixels, or 256 x 256 per environment in a sheet.
    ///     columns: pictures per row of a sheet; None for about as many as there are rows.
    ///     captions: a string per picture of a sheet; None for the ids of the environments.
    ///
    /// Returns:
    ///     uint8 [height, width, 3].
    ///
    /// Raises:
    ///     AttributeError: the lane omits the field `state`.
    ///     InvalidRequest: an environment is not in the batch, there is no batch yet, the renderer is of a
    ///         scenario with another `state_size`, the number of captions is wrong, the sheet would be wider
    ///         or higher than 16384 pixels, or states have no units (`obs_instead_of_state` of `smacv2`).
    ///     TypeError: `env_id` or `columns` are not integers, or `captions` are not strings.
    #[pyo3(signature = (batch=None, env_id=None, renderer=None, columns=None, captions=None))]
    fn render<'py>(
        &self,
        py: Python<'py>,
        batch: Option<&Bound<'py, Batch>>,
        env_id: Option<&Bound<'py, PyAny>>,
        renderer: Option<&Bound<'py, Renderer>>,
        columns: Option<IntArg>,
        captions: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray3<u8>>> {
        let newest; // lives as long as `batch`
        let batch = match batch {
            Some(batch) => batch.get(),
            None => {
                newest = self.newest_batch()?;
                &newest
            }
        };
        let style = SheetStyle::new(columns, captions)?;
        render_batch(py, self, batch, env_id, renderer, style)
    }

    /// Detach from the lane and stop an embedded pool. Batches and their arrays stay valid. Closing twice has
    /// no effect.
    ///
    /// Raises:
    ///     Busy: another thread is using these environments.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        let busy = "another thread is using these environments; close them after its call has returned";
        py.detach(|| self.shared.close_if_idle()).then_some(()).ok_or_else(|| class::Busy::new_err(busy))
    }

    fn __enter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    #[pyo3(signature = (*_exception))]
    fn __exit__(&self, py: Python<'_>, _exception: &Bound<'_, PyTuple>) -> PyResult<()> {
        self.close(py)
    }

    /// Called where there is no attribute of that name, and where its getter raised AttributeError.
    fn __getattr__(slf: &Bound<'_, Self>, name: &str) -> PyResult<Py<PyAny>> {
        Err(no_attribute(&slf.get_type(), Place::Envs, name))
    }

    fn __len__(&self) -> usize {
        self.description.settings.num_envs
    }

    /// For `copy` and `pickle`.
    #[pyo3(signature = (_protocol=None))]
    fn __reduce_ex__(&self, _protocol: Option<i32>) -> PyResult<()> {
        Err(cannot_be_copied())
    }

    fn __repr__(&self) -> String {
        let d = &self.description;
        let kind = if self.scenario.is_some() { "embedded" } else { "attached" };
        format!(
            "<smaclite_pool.Envs {} x {}, {kind}, pool '{}', lane '{}'>",
            d.settings.num_envs, d.scenario, d.pool, d.lane
        )
    }

    /// What never changes about the environments: sizes, fields, names and settings.
    #[getter]
    fn spec<'py>(&self, py: Python<'py>) -> &Bound<'py, PyAny> {
        self.spec.bind(py)
    }
}
