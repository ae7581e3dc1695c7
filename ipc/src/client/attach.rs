//! Attaching to a lane: the request to the supervisor, and the ports of iceoryx2.

use super::error::ConnectError;
use super::outstanding::Outstanding;
use super::sampler::Sampler;
use super::{AttachedLane, Client};
use crate::CHECK_INTERVAL;
use crate::connection_failures::Failures;
use crate::connections::{PeerPorts, check_reaches_any};
use crate::control::client::{ControlClient, ControlSocketError, RESPONSE_TIMEOUT};
use crate::control::protocol::{ControlError, ControlRequest, ControlResponse, LaneDescription};
use crate::os::memory::{PORTS, check_room, reserve_segments};
use crate::process_owned::ProcessOwned;
use crate::runtime_dir::RuntimeDir;
use crate::services::{
    FramePort, IpcListener, IpcNode, IpcNotifier, LaneServices, RequestPublisher, WorkEvent, open_node,
};
use crate::wait_options::WaitOptions;
use smaclite_pool::WaitStrategy;
use smaclite_pool::layout::Layout;
use smaclite_pool::transport::{RequestNumber, SessionId};
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How often a learner looks for a pool that does not run yet.
const RETRY_INTERVAL: Duration = Duration::from_millis(20);

/// What a learner needs of iceoryx2. Dropped in this order: the ports before their node.
pub(super) struct Ports {
    pub(super) requests: RequestPublisher,
    pub(super) frames: Arc<FramePort>,
    /// Blocks until a frame was sent.
    pub(super) frame_sent: IpcListener,
    /// Wakes the supervisor's server.
    pub(super) work: IpcNotifier,
    _services: (LaneServices, WorkEvent),
    _ipc_node: IpcNode,
}

impl Client {
    /// Attaches to a lane of a pool, to its only lane if none is named, and waits until the pool appears and
    /// answers. With a timeout of zero it must run already, and has 10 seconds to answer.
    ///
    /// # Errors
    /// If no pool of that name answers in time, it has no such lane or another learner has it, the pool is of
    /// another release, or memory is short.
    pub fn connect(
        runtime_dir: &RuntimeDir,
        pool: &str,
        lane: Option<&str>,
        strategy: WaitStrategy,
        wait: WaitOptions<'_>,
    ) -> Result<Client, ConnectError> {
        let WaitOptions { timeout, interrupted } = wait;
        let begin = Instant::now();
        loop {
            let left = timeout.map(|time| time.saturating_sub(begin.elapsed()));
            let for_answer = match timeout {
                Some(Duration::ZERO) => Some(RESPONSE_TIMEOUT),
                _ => left.map(|left| left.max(CHECK_INTERVAL)),
            };
            let wait = WaitOptions { timeout: for_answer, interrupted: &mut *interrupted };
            match Client::attach(runtime_dir, pool, lane, strategy, wait) {
                Err(ConnectError::Control(
                    ControlSocketError::NoSuchPool { .. } | ControlSocketError::Gone { .. },
                )) if left != Some(Duration::ZERO) => {
                    if interrupted() {
                        return Err(ControlSocketError::Interrupted { pool: pool.to_owned() }.into());
                    }
                    std::thread::sleep(left.map_or(RETRY_INTERVAL, |left| left.min(RETRY_INTERVAL)));
                }
                outcome => return outcome,
            }
        }
    }

    fn attach(
        runtime_dir: &RuntimeDir,
        pool: &str,
        lane: Option<&str>,
        strategy: WaitStrategy,
        mut wait: WaitOptions<'_>,
    ) -> Result<Client, ConnectError> {
        let request = ControlRequest::Attach { lane: lane.map(str::to_owned) };
        let (mut control, response) = ControlClient::request(runtime_dir, pool, &request, wait.reborrow())?;
        let (session, description) = match response {
            ControlResponse::Attached { session, lane } => (session, *lane),
            ControlResponse::Refused(refusal) => return Err(refusal.into()),
            other => return Err(ControlError::unexpected(&other).into()),
        };
        let layout = Arc::new(checked_layout(&description)?);
        let ports = Ports::open(runtime_dir, &description, &layout);
        let ports = ports.map_err(|error| control.cause_of(error))?;
        connect_ports(&mut control, ports.numbers(), wait)?;
        let lane = AttachedLane {
            next_request: None,
            local: None,
            ports,
            control,
            all_ids: (0..description.settings.num_envs as i32).collect(),
            session: SessionId(session),
            epoch: None,
            sequence: None,
            lost: None,
            outstanding: Outstanding::new(&description.settings),
            refused: VecDeque::new(),
            may_be_more: false,
            sampler: Sampler::new(description.settings.seed),
            newest: None,
            polling: strategy.polling(description.threads),
            description,
            layout,
            last_request: RequestNumber(0),
            failure: None,
        };
        Ok(Client { lane: ProcessOwned::new(lane) })
    }
}

impl Ports {
    fn open(
        runtime_dir: &RuntimeDir,
        lane: &LaneDescription,
        layout: &Layout,
    ) -> Result<Ports, ConnectError> {
        let (capacity, num_envs) = (lane.capacity, lane.settings.num_envs);
        check_room(capacity.request_memory(layout, num_envs) + PORTS, "requests of a learner")?;
        let ipc_node = open_node(runtime_dir, &format!("learner of {}", lane.pool))?;
        let services = LaneServices::open(&ipc_node.node, &lane.instance, &lane.lane)?;
        let work_event = WorkEvent::open(&ipc_node.node, &lane.instance)?;
        let failures = Failures::default();
        let requests = services.request_publisher(layout, num_envs, capacity, &failures)?;
        reserve_segments::<ConnectError>("requests of a learner", &mut || false)?;
        let frames = Arc::new(services.frame_port(capacity.frames_waiting, &ipc_node, &failures)?);
        failures.check()?;
        let (frame_sent, work) = (services.frame_listener()?, work_event.notifier()?);
        check_reaches_any(&work)?;
        let _services = (services, work_event);
        Ok(Ports { requests, frames, frame_sent, work, _services, _ipc_node: ipc_node })
    }

    /// By which the supervisor finds them.
    fn numbers(&self) -> PeerPorts {
        PeerPorts {
            frames: self.frames.subscriber.id().value().to_string(),
            requests: Some(self.requests.id().value().to_string()),
            frame_sent: Some(self.frame_sent.id().value().to_string()),
        }
    }
}

/// Has the supervisor connect to the ports of this process. A learner that it cannot connect to would wait
/// without end.
pub(crate) fn connect_ports(
    control: &mut ControlClient,
    ports: PeerPorts,
    wait: WaitOptions<'_>,
) -> Result<(), ConnectError> {
    match control.repeat(&ControlRequest::Connect(ports), wait)?.0 {
        ControlResponse::Connected => Ok(()),
        ControlResponse::Refused(refusal) => Err(refusal.into()),
        other => Err(ControlError::unexpected(&other).into()),
    }
}

/// The layout of a lane's frames, if the supervisor computed the same one.
pub(crate) fn checked_layout(description: &LaneDescription) -> Result<Layout, ConnectError> {
    let layout = description.layout()?;
    if layout.hash() != description.layout_hash {
        let lane = description.lane.clone();
        return Err(ConnectError::Layout { lane, theirs: description.layout_hash, ours: layout.hash() });
    }
    Ok(layout)
}
