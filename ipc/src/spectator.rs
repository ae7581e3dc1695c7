//! Watching a lane: read-only, as many frames as the spectator has time for, without slowing down the workers
//! or the learner.

use crate::batch::Batch;
use crate::client::{ClientError, ConnectError, checked_layout, connect_ports};
use crate::connection_failures::Failures;
use crate::connections::PeerPorts;
use crate::control::client::ControlClient;
use crate::control::protocol::{ControlError, ControlRequest, ControlResponse, LaneDescription};
use crate::folder_use::FolderUse;
use crate::os::memory::{PORTS, check_room};
use crate::process_owned::ProcessOwned;
use crate::runtime_dir::RuntimeDir;
use crate::services::{FramePort, IpcNode, LaneServices, doing, open_node};
use crate::wait_options::WaitOptions;
use crate::wire::{ReceivedFrame, read_frame};
use smaclite_pool::layout::Layout;
use std::sync::Arc;

/// Batches that a spectator may hold; [`Capacity`](crate::Capacity) has room for them.
const MAX_HELD: usize = 2;

/// A spectator of a lane. It holds the newest batch that it fetched and misses those that it did not fetch.
///
/// Use it to display or to log what a learner sees at this moment, from any process. It is not for data that
/// must be complete: a [`Follower`](crate::Follower) misses no step. It never delays learner or workers.
///
/// # Example
///
/// ```
/// use smaclite_ipc::{Client, Spectator, WaitOptions};
/// # use smaclite_ipc::{LaneConfig, RuntimeDir, Supervisor, SupervisorConfig};
/// # use smaclite_engine::BattleSetup;
/// # use smaclite_scenarios::ScenarioFiles;
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let folder = tempfile::tempdir()?;
/// # let runtime_dir = RuntimeDir::at(folder.path().to_owned())?;
/// # let (_, files) = ScenarioFiles::resolve("3m")?;
/// # let lanes = vec![LaneConfig::new("3m", BattleSetup::new(files), 2)];
/// # let (name, options) = ("train".to_owned(), Default::default());
/// # let config = SupervisorConfig { name, lanes, options, runtime_dir: runtime_dir.clone() };
/// # let supervisor = Supervisor::start(config)?;
///
/// let mut spectator = Spectator::connect(&runtime_dir, "train", None, WaitOptions::forever())?;
/// assert!(spectator.latest()?.is_none()); // there was no batch yet
/// let wait = WaitOptions::forever();
/// let mut client = Client::connect(&runtime_dir, "train", None, Default::default(), wait)?;
/// client.reset(Some(1), None, WaitOptions::forever())?;
/// let batch = spectator.latest()?.ok_or("a batch")?;
/// assert_eq!(batch.sequence(), 1);
/// # drop((client, spectator));
/// # drop(supervisor);
/// # Ok(())
/// # }
/// ```
///
/// # At the edges
///
/// It stays when the learner changes, and sees the batches of the next one. A lane has room for the number of
/// spectators that it was started with; one more is refused. When the pool ends, calls are errors.
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
    /// Watches a lane of a pool that runs: its only lane, if none is named. Waits for the pool's answer.
    ///
    /// # Errors
    /// As [`Client::connect`](crate::Client::connect), and if the lane has as many spectators as it can have.
    pub fn connect(
        runtime_dir: &RuntimeDir,
        pool: &str,
        lane: Option<&str>,
        mut wait: WaitOptions<'_>,
    ) -> Result<Spectator, ConnectError> {
        let request = ControlRequest::Watch { lane: lane.map(str::to_owned) };
        let (mut control, response) = ControlClient::request(runtime_dir, pool, &request, wait.reborrow())?;
        let description = match response {
            ControlResponse::Lane(lane) => *lane,
            ControlResponse::Refused(refusal) => return Err(refusal.into()),
            other => return Err(ControlError::unexpected(&other).into()),
        };
        let layout = Arc::new(checked_layout(&description)?);
        let ports = open_ports(runtime_dir, &description).map_err(|error| control.cause_of(error))?;
        let (frames, services, ipc_node) = ports;
        let number = frames.subscriber.id().value().to_string();
        connect_ports(&mut control, PeerPorts { frames: number, requests: None, frame_sent: None }, wait)?;
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

    /// Its use of the folder of the pool's files, which every batch prolongs.
    pub fn folder_use(&self) -> FolderUse {
        self.lane.frames.folder_use()
    }

    /// The newest batch of any session that was sent since it attached, `None` before the first. Never
    /// blocks.
    ///
    /// # Errors
    /// If the pool ended, or a frame is not one of this lane.
    pub fn latest(&mut self) -> Result<Option<&Batch>, ClientError> {
        let newer = self.newer()?;
        let lane = self.lane.get_mut()?;
        // The held batch is given back after the newer one was received, because it stays if the newer frame
        // is an error report.
        if newer.is_some() {
            lane.current = newer;
        }
        Ok(lane.current.as_ref())
    }

    /// The newest batch of any session, if there is one that this spectator has not received yet. Never
    /// blocks.
    ///
    /// # Errors
    /// [`ClientError::TooManyHeld`] if there is one, and two batches of this spectator exist: the lane has no
    /// memory for more.
    pub fn newer(&mut self) -> Result<Option<Batch>, ClientError> {
        let lane = self.lane.get_mut()?;
        // Every batch has a reference to the port.
        let is_full = Arc::strong_count(&lane.frames) > MAX_HELD;
        if is_full && lane.frames.subscriber.has_samples().map_err(doing("looking for a frame"))? {
            return Err(ClientError::TooManyHeld { limit: MAX_HELD });
        }
        // The buffer holds one frame, so at most one is newer.
        if !is_full
            && let Some(sample) = lane.frames.subscriber.receive().map_err(doing("receiving a frame"))?
        {
            let frame = read_frame(sample.user_header(), sample.payload(), &lane.layout);
            let batch = || Batch::new(sample, Arc::clone(&lane.layout), Arc::clone(&lane.frames));
            return Ok((frame == Some(ReceivedFrame::Batch)).then(batch));
        }
        if lane.control.is_alive() {
            Ok(None)
        } else {
            Err(ClientError::PoolDied { pool: lane.description.pool.clone() })
        }
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
    let failures = Failures::default();
    let frames = services.frame_port(1, &ipc_node, &failures)?;
    failures.check()?;
    Ok((frames, services, ipc_node))
}
