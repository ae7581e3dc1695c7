//! What the methods of `Envs` send and receive: their arguments as requests, and batches.

use super::Envs;
use crate::arrays::{self, Actions, Int32Array, require_envs};
use crate::batch::Batch;
use crate::errors::{client_error, invalid_request};
use crate::seeds::{OwnedSeeds, seeds};
use crate::wait::wait_detached;
use pyo3::prelude::*;
use smaclite_ipc::{Client, ClientError, Order, WaitOptions};
use smaclite_pool::fields::Field;
use std::time::Duration;

impl Envs {
    /// The number of environments in a request.
    pub(super) fn request_size(&self, ids: Option<&Int32Array<'_>>) -> usize {
        ids.map_or(self.description.settings.num_envs, Int32Array::len)
    }

    /// Converts the argument `env_id`; `None` is all environments.
    pub(super) fn env_ids<'py>(
        &self,
        env_id: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Option<Int32Array<'py>>> {
        let num_envs = self.description.settings.num_envs;
        env_id.map(|env_id| arrays::env_ids("env_id", env_id, num_envs)).transpose()
    }

    /// Converts the argument `seed` of a request to these environments.
    pub(super) fn seeds(&self, seed: Option<&Bound<'_, PyAny>>, ids: Option<&[i32]>) -> PyResult<OwnedSeeds> {
        seeds(seed, ids.map_or(self.description.settings.num_envs, <[i32]>::len))
    }

    /// Converts the argument `levels` of a reset of these environments.
    fn levels(&self, levels: &Bound<'_, PyAny>, ids: Option<&[i32]>) -> PyResult<Vec<f32>> {
        if self.layout.level_len() == 0 {
            return Err(client_error(ClientError::NoLevels));
        }
        let num_envs = ids.map_or(self.description.settings.num_envs, <[i32]>::len);
        let [n_units, n_columns] = [1, 2].map(|axis| self.layout.shape(Field::Level)[axis]);
        arrays::levels(levels, &[num_envs, n_units, n_columns].map(Some))
    }

    /// Converts the arguments of `reset` and `async_reset`.
    pub(super) fn reset_arguments(
        &self,
        seed: Option<&Bound<'_, PyAny>>,
        env_id: Option<&Bound<'_, PyAny>>,
        levels: Option<&Bound<'_, PyAny>>,
        snapshots: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<ResetArguments> {
        let ids = match self.env_ids(env_id)? {
            Some(ids) => Some(require_envs(ids.as_slice()?.to_vec())?),
            None => None,
        };
        let start = match (levels, snapshots) {
            (levels, None) => {
                let levels = levels.map(|levels| self.levels(levels, ids.as_deref()));
                Start::Episode { levels: levels.transpose()? }
            }
            (None, Some(snapshots)) => {
                let num_envs = ids.as_ref().map_or(self.description.settings.num_envs, Vec::len);
                let size = self.layout.snapshot_size();
                Start::Snapshots(arrays::snapshot_rows(snapshots, num_envs, size)?)
            }
            (Some(_), Some(_)) => {
                let text = "levels and snapshots cannot be combined; pass only one of them";
                return Err(invalid_request(text));
            }
        };
        let seeds = self.seeds(seed, ids.as_deref())?;
        Ok(ResetArguments { ids, seeds, start })
    }

    /// Converts the arguments of `step` and `send`.
    pub(super) fn step_arguments<'py>(
        &self,
        py: Python<'py>,
        actions: Option<&Bound<'py, PyAny>>,
        env_id: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<(Actions<'py>, Option<Int32Array<'py>>)> {
        let ids = self.env_ids(env_id)?;
        if let Some(ids) = &ids {
            require_envs(ids.as_slice()?)?;
        }
        let n_envs = self.request_size(ids.as_ref());
        let none = py.None().into_bound(py);
        let actions = arrays::actions(actions.unwrap_or(&none), n_envs, self.description.sizes.n_actors())?;
        Ok((actions, ids))
    }
}

/// Which environments `reset` and `async_reset` change, and where they begin.
pub(super) struct ResetArguments {
    ids: Option<Vec<i32>>,
    seeds: OwnedSeeds,
    start: Start,
}

impl ResetArguments {
    pub(super) fn ids(&self) -> Option<&[i32]> {
        self.ids.as_deref()
    }

    pub(super) fn order(&self) -> Order<'_> {
        let seeds = self.seeds.as_deref();
        match &self.start {
            Start::Episode { levels } => Order::Reset { seeds, levels: levels.as_deref() },
            Start::Snapshots(snapshots) => Order::Restore { snapshots, seeds },
        }
    }
}

/// Where environments begin.
enum Start {
    Episode { levels: Option<Vec<f32>> },
    Snapshots(Vec<u8>),
}

/// Sends actions, without a wait if the pool reads its requests. The thread of a learner in the process of
/// its pool then works there until the next wait ends.
pub(super) fn begin_step(
    py: Python<'_>,
    client: &mut Client,
    actions: Actions<'_>,
    ids: Option<&[i32]>,
) -> PyResult<()> {
    match actions.read(|actions| client.begin(Order::Step(actions), ids, WaitOptions::no_wait())) {
        Err(ClientError::NotAccepted { .. }) => {
            // The arrays must not be read while other Python code runs.
            let actions = actions.read(<[i32]>::to_vec);
            let ids = ids.map(<[i32]>::to_vec);
            wait_detached(py, None, |wait| client.begin(Order::Step(&actions), ids.as_deref(), wait))
        }
        sent => sent.map_err(client_error),
    }
}

pub(super) fn receive(py: Python<'_>, client: &mut Client, timeout: Option<Duration>) -> PyResult<Batch> {
    wait_detached(py, timeout, |wait| client.recv(wait)).map(Batch::new)
}
