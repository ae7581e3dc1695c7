//! The client of environments, which one thread uses at a time, and what ends with it.

use super::requests::receive;
use crate::batch::Batch;
use crate::errors::client_error;
use crate::exclusive::{Exclusive, Guard, Texts};
use crate::exit::CloseAtExit;
use crate::wait::check_interrupts;
use pyo3::prelude::*;
use smaclite_ipc::{Client, Supervisor};
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

const TEXTS: Texts = Texts {
    closed: "these environments are closed; call make or connect again",
    busy: "another thread is using these environments; only one thread may call them at a time",
    panicked: "an earlier call of these environments panicked; close them and call make or connect again",
};

/// The client of an `Envs`, and its pool if that is embedded.
pub(super) struct SharedClient(Exclusive<Attached>);

/// Dropped in this order: the client detaches from the pool before an embedded pool stops.
struct Attached {
    client: Client,
    /// Received, and not returned yet: the exception of a signal was raised in its place. Those of an epoch
    /// that is over are discarded when they are looked at.
    kept: VecDeque<Batch>,
    _embedded: Option<Arc<Supervisor>>,
}

impl CloseAtExit for SharedClient {
    fn close_if_idle(&self) -> bool {
        self.0.take_if_idle().is_some()
    }
}

impl SharedClient {
    pub(super) fn new(client: Client, embedded: Option<Arc<Supervisor>>) -> SharedClient {
        let attached = Attached { client, kept: VecDeque::new(), _embedded: embedded };
        SharedClient(Exclusive::new(attached, TEXTS))
    }

    /// Locks the client for one call.
    pub(super) fn try_lock(&self) -> PyResult<ClientGuard<'_>> {
        self.0.try_lock().map(ClientGuard)
    }
}

impl Attached {
    /// What is kept of the present epoch.
    fn kept(&mut self) -> &mut VecDeque<Batch> {
        let Attached { client, kept, .. } = self;
        kept.retain(|batch| client.is_current(batch.received()));
        kept
    }
}

pub(super) struct ClientGuard<'a>(Guard<'a, Attached>);

impl ClientGuard<'_> {
    fn attached(&mut self) -> &mut Attached {
        self.0.as_mut().expect("try_lock returns a guard only while attached")
    }

    pub(super) fn client(&mut self) -> &mut Client {
        &mut self.attached().client
    }

    /// Whether [`receive`](Self::receive) returns after a request to these environments.
    pub(super) fn check_is_answered(&mut self, ids: Option<&[i32]>) -> PyResult<()> {
        let attached = self.attached();
        match attached.kept().is_empty() {
            true => attached.client.check_is_answered(ids).map_err(client_error),
            false => Ok(()),
        }
    }

    /// The client, which has sent a request or is to send a reset: what is kept of a synchronous lane is
    /// over.
    pub(super) fn sent(&mut self) -> &mut Client {
        let attached = self.attached();
        if attached.client.description().settings.is_synchronous() {
            attached.kept.clear(); // the request was of all environments
        }
        &mut attached.client
    }

    /// Waits for the next batch.
    pub(super) fn receive(&mut self, py: Python<'_>, timeout: Option<Duration>) -> PyResult<Batch> {
        let attached = self.attached();
        if attached.kept().is_empty() {
            let batch = receive(py, &mut attached.client, timeout)?;
            return self.hand_over(py, batch);
        }
        attached.client.leave(); // it does not receive
        check_interrupts(py)?;
        Ok(attached.kept.pop_front().expect("one is kept"))
    }

    /// Returns the oldest batch that was received: this one, or one that was kept before it. Python raises
    /// what a signal handler raises when a call has returned, and the batch would be lost: so it is raised
    /// here, and the batch kept for the next `recv`.
    pub(super) fn hand_over(&mut self, py: Python<'_>, batch: Batch) -> PyResult<Batch> {
        let kept = self.attached().kept();
        kept.push_back(batch);
        check_interrupts(py)?;
        Ok(kept.pop_front().expect("one was added"))
    }
}
