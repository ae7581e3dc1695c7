//! Whether the two ends of a lane are connected. iceoryx2 connects ports when one of them is used next, and
//! an end that cannot map the other's memory only logs it: the other one would wait for an answer that
//! never comes. So a learner or spectator that has opened its ports asks the supervisor, over the control
//! socket, to connect to them, and each end reports what it could not connect to.

use crate::connection_failures::{Failures, not_connected};
use crate::error::{IpcError, cause};
use crate::refusals::Refusals;
use crate::services::{FramePublisher, IpcNotifier, RequestSubscriber};
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::CallbackProgression;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// An error if the notifier reaches no process: waking it would do nothing.
pub(crate) fn check_reaches_any(notifier: &IpcNotifier) -> Result<(), IpcError> {
    if reaches(notifier, |_| true) { Ok(()) } else { Err(not_connected(&cause())) }
}

fn reaches(notifier: &IpcNotifier, is_meant: impl Fn(u128) -> bool) -> bool {
    let mut found = false;
    notifier.for_each_listener(|_, listener| {
        found |= is_meant(listener.listener_id.value());
        if found { CallbackProgression::Stop } else { CallbackProgression::Continue }
    });
    found
}

/// The ports that a learner or a spectator opened, by iceoryx2's numbers, which JSON cannot hold as such.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PeerPorts {
    /// The subscriber to frames.
    pub frames: String,
    /// Of a learner: the publisher of requests.
    pub requests: Option<String>,
    /// Of a learner: the listener that wakes it.
    pub frame_sent: Option<String>,
}

/// The supervisor's ports of a lane. Its workers use them, too.
pub(crate) struct LanePorts {
    pub(crate) requests: Arc<RequestSubscriber>,
    pub(crate) frames: Arc<FramePublisher>,
    pub(crate) notifier: Arc<IpcNotifier>,
    pub(crate) failures: Failures,
    pub(crate) refusals: Refusals,
}

impl LanePorts {
    /// Connects to the ports of a peer, unless a worker has done so already.
    ///
    /// # Errors
    /// Why it failed.
    pub(crate) fn connect_to(&self, peer: &PeerPorts) -> Result<(), String> {
        // Neither fails, because the handlers take note instead.
        let _ = (self.requests.update_connections(), self.frames.update_connections());
        let ports = [Some(&peer.frames), peer.requests.as_ref()];
        let is_peers = |port: u128| ports.iter().flatten().any(|own| **own == port.to_string());
        if let Some(cause) = self.failures.take(is_peers) {
            return Err(cause);
        }
        match &peer.frame_sent {
            Some(own) if !reaches(&self.notifier, |listener| *own == listener.to_string()) => Err(cause()),
            _ => Ok(()),
        }
    }
}
