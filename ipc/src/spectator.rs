//! Watching a lane: read-only, as many frames as the spectator has time for, without slowing down the workers
//! or the learner.

use crate::batch::Batch;
use crate::client::{ClientError, ConnectError, checked_layout};
use crate::control::client::ControlClient;
use crate::control::protocol::{ControlError, ControlRequest, ControlResponse, LaneDescription};
use crate::memory::{PORTS, check_room};
use crate::process_owned::ProcessOwned;
use crate::runtime_dir::RuntimeDir;
use crate::services::{FramePort, IpcNode, LaneServices, doing, open_node};
use crate::wait_options::WaitOptions;
use crate::wire::{ReceivedFrame, read_frame};
use smaclite_pool::layout::Layout;
use std::sync::Arc;

/// A spectator of a lane. It holds the newest batch that it fetched and misses those that it did not fetch.
pub struct Spectator {
    lane: ProcessOwned<WatchedLane>,
}

/// Dropped in this order: the frame before its port, that before its node, the control connection last.
struct WatchedLane {
    current: Option<Batch>,
    frames: Arc<FramePort>,
    _services: LaneServices,
    _ipc_node: IpcNode,
    control: ControlClient,
    description: LaneDescription,
    layout: Arc<Layout>,
}

impl Spectator {
    /// Watches a lane of a pool: its only lane, if none is named.
    pub fn connect(
        runtime_dir: &RuntimeDir,
        pool: &str,
        lane: Option<&str>,
    ) -> Result<Spectator, ConnectError> {
        let request = ControlRequest::Watch { lane: lane.map(str::to_owned) };
        let wait = WaitOptions::for_response();
        let (control, response) = ControlClient::request(runtime_dir, pool, &request, wait)?;
        let description = match response {
            ControlResponse::Lane(lane) => *lane,
            ControlResponse::Refused(refusal) => return Err(refusal.into()),
            other => return Err(ControlError::unexpected(&other).into()),
        };
        let layout = Arc::new(checked_layout(&description)?);
        let ports = open_ports(runtime_dir, &description).map_err(|error| control.cause_of(error))?;
        let (frames, services, ipc_node) = ports;
        let frames = Arc::new(frames);
        let lane = WatchedLane {
            current: None,
            frames,
            _services: services,
            _ipc_node: ipc_node,
            control,
            description,
            layout,
        };
        Ok(Spectator { lane: ProcessOwned::new(lane) })
    }

    /// The lane that it watches.
    pub fn description(&self) -> &LaneDescription {
        &self.lane.description
    }

    /// The newest batch of any session, `None` before the first. Never blocks.
    pub fn latest(&mut self) -> Result<Option<&Batch>, ClientError> {
        let lane = self.lane.get_mut()?;
        // The buffer holds one frame, so at most one is newer. It is read before the held batch is given
        // back, because the held batch stays if the newer frame is an error report. A subscriber may hold
        // two frames.
        if let Some(sample) = lane.frames.subscriber.receive().map_err(doing("receiving a frame"))? {
            let frame = read_frame(sample.user_header(), sample.payload(), &lane.layout);
            if frame == Some(ReceivedFrame::Batch) {
                lane.current = Some(Batch::new(sample, Arc::clone(&lane.layout), Arc::clone(&lane.frames)));
            }
        } else if !lane.control.is_alive() {
            return Err(ClientError::PoolDied { pool: lane.description.pool.clone() });
        }
        Ok(lane.current.as_ref())
    }
}

/// Opens what a spectator needs of iceoryx2.
fn open_ports(
    runtime_dir: &RuntimeDir,
    lane: &LaneDescription,
) -> Result<(FramePort, LaneServices, IpcNode), ConnectError> {
    check_room(PORTS, "a spectator")?;
    let ipc_node = open_node(runtime_dir, &format!("spectator of {}", lane.pool))?;
    let services = LaneServices::open(&ipc_node.node, &lane.instance, &lane.lane)?;
    Ok((services.frame_port(1, &ipc_node)?, services, ipc_node))
}
