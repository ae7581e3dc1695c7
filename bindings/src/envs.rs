//! A lane's environments in Python: the methods of a client, and what the lane is.

use crate::batch::Batch;
use crate::convert::{self, Int, Ints, Seconds, dict_of, env_ids, masked, seconds, some, whole};
use crate::errors::{class, invalid, of_client};
use crate::exit;
use crate::wait::waiting;
use numpy::{PyArray2, PyArrayDescr, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use smaclite_ipc::{Client, LaneDescription, Supervisor};
use smaclite_pool::layout::Layout;
use std::sync::{Arc, Mutex, MutexGuard, TryLockError};

/// What is attached, until it is closed.
pub struct Shared(Mutex<Option<Attached>>);

/// Dropped in this order: the learner says good-bye to its pool before that ends.
struct Attached {
    client: Client,
    _embedded: Option<Supervisor>,
}

impl Shared {
    /// Closes, unless a call of another thread is under way.
    pub fn close_if_idle(&self) -> bool {
        match self.0.try_lock() {
            Ok(mut attached) => drop(attached.take()),
            Err(TryLockError::Poisoned(attached)) => drop(attached.into_inner().take()),
            Err(TryLockError::WouldBlock) => return false,
        }
        true
    }

    /// The client, for one call. Never waits: a thread that waited for another's `recv` with a signal handler in
    /// between could wait for itself.
    fn turn(&self) -> PyResult<Turn<'_>> {
        if exit::is_exiting() {
            return Err(exit::cut_short());
        }
        match self.0.try_lock() {
            Ok(attached) if attached.is_some() => Ok(Turn(attached)),
            Ok(_) => Err(class::Closed::new_err("these environments are closed")),
            Err(TryLockError::WouldBlock) => Err(class::Busy::new_err(
                "another thread is in a call of these environments; a lane has one learner, so take turns",
            )),
            Err(TryLockError::Poisoned(_)) => {
                Err(class::PoolError::new_err("an earlier call failed inside; close these environments"))
            }
        }
    }
}

struct Turn<'a>(MutexGuard<'a, Option<Attached>>);

impl Turn<'_> {
    fn client(&mut self) -> &mut Client {
        &mut self.0.as_mut().expect("a turn is given only while attached").client
    }
}

/// The environments of a lane, attached to by `make` or `connect`: this process is their learner until `close`, or the
/// end of a `with` block.
///
/// Every call that waits can be ended with Ctrl-C and takes a `timeout` in seconds (None: for ever). After a Timeout or
/// KeyboardInterrupt the batch is still under way: `recv` it, or `reset`. One thread at a time; a second one's call
/// raises Busy. After a fork the child's calls raise Forked.
#[pyclass(frozen, weakref, module = "smaclite_pool")]
pub struct Envs {
    shared: Arc<Shared>,
    description: LaneDescription,
    layout: Layout,
    embedded: bool,
}

impl Envs {
    pub fn new(client: Client, supervisor: Option<Supervisor>) -> Envs {
        let (description, layout) = (client.description().clone(), client.layout().clone());
        let embedded = supervisor.is_some();
        let shared = Arc::new(Shared(Mutex::new(Some(Attached { client, _embedded: supervisor }))));
        exit::remember(&shared);
        Envs { shared, description, layout, embedded }
    }

    /// How many environments a request is about.
    fn count(&self, ids: Option<&Ints<'_>>) -> usize {
        ids.map_or(self.description.settings.num_envs, Ints::len)
    }

    fn joint<'py>(
        &self,
        actions: &Bound<'py, PyAny>,
        env_id: Given<'_, 'py>,
    ) -> PyResult<(Ints<'py>, Option<Ints<'py>>)> {
        let ids = env_ids(env_id)?;
        if let Some(ids) = &ids {
            some("env_id", ids.as_slice()?)?;
        }
        let actions = convert::actions(actions, self.count(ids.as_ref()), self.description.sizes.n_agents)?;
        Ok((actions, ids))
    }
}

type Given<'a, 'py> = Option<&'a Bound<'py, PyAny>>;

#[pymethods]
impl Envs {
    /// Begin a new episode and return the batch of first observations.
    ///
    /// With a seed, environment i is seeded with seed + i; without one its generator goes on (the first reset uses the
    /// seed of `make` or `serve`). `mask`, bool [num_envs], or `env_id`, integers [K], choose environments; the others
    /// of a synchronous lane come along unchanged. A whole reset drops results that were not received.
    #[pyo3(signature = (seed=None, mask=None, env_id=None, timeout=None))]
    fn reset(
        &self,
        py: Python<'_>,
        seed: Option<Int>,
        mask: Given<'_, '_>,
        env_id: Given<'_, '_>,
        timeout: Option<Seconds>,
    ) -> PyResult<Batch> {
        let (seed, timeout) = (seed.map(|s| whole("seed", s)).transpose()?, seconds(timeout)?);
        let chosen = match (mask, env_id) {
            (Some(_), Some(_)) => return Err(invalid("mask and env_id both choose environments; give one")),
            (Some(mask), None) => Some(masked(mask, self.description.settings.num_envs)?),
            (None, ids) => match env_ids(ids)? {
                Some(ids) => Some(some("env_id", ids.as_slice()?.to_vec())?),
                None => None,
            },
        };
        let mut turn = self.shared.turn()?;
        let client = turn.client();
        let batch = waiting(py, timeout, |wait| client.reset(seed, chosen.as_deref(), wait))?;
        Batch::new(py, batch)
    }

    /// `send` and `recv`.
    #[pyo3(signature = (actions, env_id=None, timeout=None))]
    fn step(
        &self,
        py: Python<'_>,
        actions: &Bound<'_, PyAny>,
        env_id: Given<'_, '_>,
        timeout: Option<Seconds>,
    ) -> PyResult<Batch> {
        let timeout = seconds(timeout)?;
        let (actions, ids) = self.joint(actions, env_id)?;
        let (actions, ids) = (actions.as_slice()?, ids.as_ref().map(Ints::as_slice).transpose()?);
        let mut turn = self.shared.turn()?;
        let client = turn.client();
        let batch = waiting(py, timeout, |wait| client.step(actions, ids, wait))?;
        Batch::new(py, batch)
    }

    /// Send actions, integers [K, n_agents], to environments `env_id`, integers [K], or to all in order. Returns at once,
    /// but for a supervisor that has stopped reading: that is a PoolError after 5 seconds, and nothing was sent.
    ///
    /// C-contiguous int32 is read in place; other integers and lists are converted. Raises IllegalAction, naming
    /// environment, agent, action and what was available, and InvalidRequest; then nothing was stepped.
    #[pyo3(signature = (actions, env_id=None))]
    fn send(&self, py: Python<'_>, actions: &Bound<'_, PyAny>, env_id: Given<'_, '_>) -> PyResult<()> {
        let (actions, ids) = self.joint(actions, env_id)?;
        let (actions, ids) = (actions.as_slice()?, ids.as_ref().map(Ints::as_slice).transpose()?);
        let mut turn = self.shared.turn()?;
        let client = turn.client();
        waiting(py, None, |wait| client.send(actions, ids, wait))
    }

    /// WaitStrategy for the next batch: the M environments that are done first.
    ///
    /// Raises Timeout, PoolDied, TooManyBatchesHeld, and InvalidRequest if nothing is to come.
    #[pyo3(signature = (timeout=None))]
    fn recv(&self, py: Python<'_>, timeout: Option<Seconds>) -> PyResult<Batch> {
        let timeout = seconds(timeout)?;
        let mut turn = self.shared.turn()?;
        let client = turn.client();
        let batch = waiting(py, timeout, |wait| client.recv(wait))?;
        Batch::new(py, batch)
    }

    /// ControlRequest for a new episode in every environment and return at once; `recv` the first observations.
    #[pyo3(signature = (seed=None))]
    fn async_reset(&self, py: Python<'_>, seed: Option<Int>) -> PyResult<()> {
        let seed = seed.map(|s| whole("seed", s)).transpose()?;
        let mut turn = self.shared.turn()?;
        let client = turn.client();
        waiting(py, None, |wait| client.send_reset(seed, None, wait))
    }

    /// Draw uniformly random legal actions, int32 [K, n_agents], for environments `env_id`, or all, by what was last
    /// received of each. `out`, a C-contiguous int32 array of that shape, is written and returned.
    #[pyo3(signature = (env_id=None, out=None))]
    fn sample_actions<'py>(
        &self,
        py: Python<'py>,
        env_id: Given<'_, 'py>,
        out: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<i32>>> {
        let ids = env_ids(env_id)?;
        let shape = [self.count(ids.as_ref()), self.description.sizes.n_agents];
        let out = match out {
            Some(out) => convert::actions_out(out, shape)?,
            None => PyArray2::zeros(py, shape, false),
        };
        let ids = ids.as_ref().map(Ints::as_slice).transpose()?;
        let mut turn = self.shared.turn()?;
        let mut drawn = out.try_readwrite()?;
        turn.client().sample_actions(ids, drawn.as_slice_mut()?).map_err(of_client)?;
        drop(drawn);
        Ok(out)
    }

    /// Seed the generator of `sample_actions`.
    fn seed_sampler(&self, seed: Int) -> PyResult<()> {
        let seed = whole("seed", seed)?;
        self.shared.turn()?.client().seed_sampler(seed);
        Ok(())
    }

    /// Give the lane back; an embedded pool ends. Batches and arrays stay readable. A second time does nothing.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        match py.detach(|| self.shared.close_if_idle()) {
            true => Ok(()),
            false => Err(class::Busy::new_err(
                "another thread is in a call of these environments; close them after it",
            )),
        }
    }

    fn __enter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    #[pyo3(signature = (*_exception))]
    fn __exit__(&self, py: Python<'_>, _exception: &Bound<'_, PyTuple>) -> PyResult<()> {
        self.close(py)
    }

    fn __repr__(&self) -> String {
        let d = &self.description;
        let kind = if self.embedded { "embedded" } else { "attached" };
        format!(
            "<smaclite_pool.Envs {} x {}, {kind}, pool '{}', lane '{}'>",
            d.settings.num_envs, d.scenario, d.pool, d.lane
        )
    }

    /// Environments (N).
    #[getter]
    fn num_envs(&self) -> usize {
        self.description.settings.num_envs
    }

    /// Environments in a batch (M); equal to `num_envs` for synchronous stepping.
    #[getter]
    fn batch_size(&self) -> usize {
        self.description.settings.batch_size
    }

    /// Agents of an environment.
    #[getter]
    fn n_agents(&self) -> usize {
        self.description.sizes.n_agents
    }

    /// Enemies of an environment.
    #[getter]
    fn n_enemies(&self) -> usize {
        self.description.sizes.n_enemies
    }

    /// Actions of an agent: no-op (only for the dead), stop, move north, south, east, west, then one a target.
    #[getter]
    fn n_actions(&self) -> usize {
        self.description.sizes.n_actions
    }

    /// Features of an agent's observation.
    #[getter]
    fn obs_size(&self) -> usize {
        self.description.sizes.obs_size
    }

    /// Features of the state.
    #[getter]
    fn state_size(&self) -> usize {
        self.description.sizes.state_size
    }

    /// Steps after which an episode is truncated; None for no limit.
    #[getter]
    fn episode_limit(&self) -> Option<u32> {
        self.description.episode_limit
    }

    /// The scenario's name.
    #[getter]
    fn scenario(&self) -> &str {
        &self.description.scenario
    }

    /// What happens at an episode's end: "next_step", "same_step" or "disabled".
    #[getter]
    fn autoreset(&self) -> &'static str {
        self.description.settings.autoreset.name()
    }

    /// Environment i begins with seed + i.
    #[getter]
    fn seed(&self) -> u64 {
        self.description.settings.seed
    }

    /// The pool's name.
    #[getter]
    fn name(&self) -> &str {
        &self.description.pool
    }

    /// The lane's name.
    #[getter]
    fn lane(&self) -> &str {
        &self.description.lane
    }

    /// The process of the pool's supervisor; this one, if embedded.
    #[getter]
    fn pid(&self) -> u32 {
        self.description.pid
    }

    /// The rules that are played: "smaclite" or "paper".
    #[getter]
    fn rules(&self) -> &str {
        &self.description.rules
    }

    /// Data type and shape of every field of a batch, by name.
    #[getter]
    fn fields<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let fields = PyDict::new(py);
        for field in self.layout.fields().iter() {
            let dtype = PyArrayDescr::new(py, field.spec().dtype.name())?;
            fields.set_item(field.spec().name, (dtype, PyTuple::new(py, self.layout.shape(field))?))?;
        }
        Ok(fields)
    }

    /// Everything about the lane as a dict, as `smaclite-pool status --json` shows it.
    #[getter]
    fn description<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        dict_of(py, &self.description)
    }
}
