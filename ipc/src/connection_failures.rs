//! What the ports of a process could not connect to. iceoryx2 reports it on the thread that used the port,
//! which may be any worker; who attached to whom is known elsewhere (`connections`).

use crate::error::{IpcError, cause};
use iceoryx2::port::{DegradationAction, DegradationCause, DegradationInfo};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

/// Failures that are remembered: more than peers that attach to a lane at the same time.
const MAX_FAILURES: usize = 64;

/// What the ports of one end could not connect to, and why.
#[derive(Clone, Default)]
pub(crate) struct Failures(Arc<Mutex<VecDeque<(u128, String)>>>);

/// Which end of a failed connection the other end's port is.
#[derive(Clone, Copy)]
pub(crate) enum PeerEnd {
    Sender,
    Receiver,
}

impl Failures {
    /// What iceoryx2 calls on the thread on which a connection failed. The port goes on with its other peers.
    pub(crate) fn handler(
        &self,
        peer: PeerEnd,
    ) -> impl Fn(DegradationCause, &DegradationInfo) -> DegradationAction + Send + 'static {
        let failures = self.clone();
        move |_, info| {
            let port = match peer {
                PeerEnd::Sender => info.sender_port_id,
                PeerEnd::Receiver => info.receiver_port_id,
            };
            let cause = cause();
            tracing::warn!(port, cause, "a port could not connect to a peer");
            let mut failures = failures.0.lock().unwrap_or_else(PoisonError::into_inner);
            failures.truncate(MAX_FAILURES - 1);
            failures.push_front((port, cause));
            DegradationAction::Ignore
        }
    }

    /// Why the connection to a port of the other end failed, if it did; forgets it.
    pub(crate) fn take(&self, is_peer: impl Fn(u128) -> bool) -> Option<String> {
        let mut failures = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let found = failures.iter().find(|(port, _)| is_peer(*port)).map(|(_, cause)| cause.clone());
        failures.retain(|(port, _)| !is_peer(*port));
        found
    }

    /// An error if any connection failed.
    pub(crate) fn check(&self) -> Result<(), IpcError> {
        self.take(|_| true).map_or(Ok(()), |cause| Err(not_connected(&cause)))
    }
}

/// The error of a process that is not connected to a pool.
pub(crate) fn not_connected(cause: &str) -> IpcError {
    IpcError::new("connecting to the pool's shared memory", "not all of it could be opened", cause)
}
