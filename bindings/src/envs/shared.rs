//! The client of environments, which one thread uses at a time, and what ends with it.

use crate::errors::class;
use crate::exit::{self, CloseAtExit};
use crate::recorder::RecordingToFile;
use crate::wait::IsCancelled;
use pyo3::prelude::*;
use smaclite_ipc::{Client, Supervisor};
use std::sync::{Arc, Mutex, MutexGuard, TryLockError};

/// The client of an `Envs`, and its pool if that is embedded; `None` once closed.
pub(super) struct SharedClient(Mutex<Option<Attached>>);

/// Dropped in this order: the client detaches from the pool before an embedded pool stops.
struct Attached {
    /// Written when these environments are closed.
    recording: Option<RecordingToFile>,
    client: Client,
    _embedded: Option<Arc<Supervisor>>,
}

impl CloseAtExit for SharedClient {
    /// A recording is written; the environments are closed also if that fails.
    fn close_if_idle(&self, interrupted: IsCancelled<'_>) -> Option<PyResult<()>> {
        let attached = match self.0.try_lock() {
            Ok(mut attached) => attached.take(),
            Err(TryLockError::Poisoned(attached)) => attached.into_inner().take(),
            Err(TryLockError::WouldBlock) => return None,
        };
        Some(attached.map_or(Ok(()), |attached| attached.close(interrupted)))
    }
}

impl SharedClient {
    pub(super) fn new(
        client: Client,
        embedded: Option<Arc<Supervisor>>,
        recording: Option<RecordingToFile>,
    ) -> SharedClient {
        SharedClient(Mutex::new(Some(Attached { recording, client, _embedded: embedded })))
    }

    /// Locks the client for one call. Never blocks: a signal handler that runs during `recv` and calls a
    /// method would wait for its own thread.
    pub(super) fn try_lock(&self) -> PyResult<ClientGuard<'_>> {
        if exit::is_exiting() {
            return Err(exit::exiting_error());
        }
        match self.0.try_lock() {
            Ok(attached) if attached.is_some() => Ok(ClientGuard(attached)),
            Ok(_) => Err(class::Closed::new_err("these environments are closed; call make or connect again")),
            Err(TryLockError::WouldBlock) => Err(class::Busy::new_err(
                "another thread is using these environments; only one thread may call them at a time",
            )),
            Err(TryLockError::Poisoned(_)) => Err(class::PoolError::new_err(
                "an earlier call of these environments panicked; close them and call make or connect again",
            )),
        }
    }
}

impl Attached {
    fn close(mut self, interrupted: IsCancelled<'_>) -> PyResult<()> {
        self.recording.as_mut().map_or(Ok(()), |recording| recording.finish(interrupted))
    }
}

pub(super) struct ClientGuard<'a>(MutexGuard<'a, Option<Attached>>);

impl ClientGuard<'_> {
    pub(super) fn client(&mut self) -> &mut Client {
        &mut self.0.as_mut().expect("try_lock returns a guard only while attached").client
    }
}
