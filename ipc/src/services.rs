//! The iceoryx2 services of a pool: their names, settings and sizes, and how each side opens them.
//!
//! A pool has one event that wakes its server (`work`). Every lane has two data services: `frames`, which
//! the supervisor publishes to a learner and spectators, with an event of the same name that wakes the
//! learner; and `requests`, which the learner publishes to the supervisor. Names contain the supervisor's
//! instance, so that a restarted pool never finds services that a learner still holds of its predecessor.

use crate::capacity::{Capacity, REQUESTS_READ};
use crate::connection_failures::{Failures, PeerEnd};
pub use crate::error::IpcError;
pub(crate) use crate::error::doing;
use crate::folder_use::{FolderUse, iceoryx};
use crate::os::shm_dir::ShmDir;
use crate::runtime_dir::RuntimeDir;
use crate::wire::{FrameHeader, RequestHeader, max_request_bytes};
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::{Subscriber, SubscriberCreateError};
use iceoryx2::prelude::*;
use iceoryx2::sample::Sample;
use iceoryx2::sample_mut::SampleMut;
use iceoryx2::sample_mut_uninit::SampleMutUninit;
use iceoryx2::service::port_factory::{event, publish_subscribe};
use smaclite_pool::layout::Layout;
use std::mem::MaybeUninit;
use std::sync::Arc;
use std::time::{Duration, Instant};

pub(crate) type Ipc = crate::os::variant::PoolService;
pub(crate) type FrameLoan = SampleMutUninit<Ipc, [MaybeUninit<u8>], FrameHeader>;
pub(crate) type FramePublisher = Publisher<Ipc, [u8], FrameHeader>;
pub(crate) type FrameSubscriber = Subscriber<Ipc, [u8], FrameHeader>;
pub(crate) type FrameSample = Sample<Ipc, [u8], FrameHeader>;
pub(crate) type RequestLoan = SampleMut<Ipc, [u8], RequestHeader>;
pub(crate) type RequestPublisher = Publisher<Ipc, [u8], RequestHeader>;
pub(crate) type RequestSubscriber = Subscriber<Ipc, [u8], RequestHeader>;
pub(crate) type IpcListener = Listener<Ipc>;
pub(crate) type IpcNotifier = Notifier<Ipc>;

/// Extra entries for a supervisor and a learner that died and are still listed when their successors come.
const SLACK: usize = 4;

/// How long a subscription waits until one of a dead process is reclaimed.
const RECLAIM_TIMEOUT: Duration = Duration::from_secs(1);

/// A subscription to frames. Every batch keeps the one that received it: iceoryx2 reclaims the samples of a
/// dropped subscriber, also those that are still read. Dropped in this order.
pub(crate) struct FramePort {
    pub(crate) subscriber: FrameSubscriber,
    shm_dir: Arc<ShmDir>,
}

impl FramePort {
    pub(crate) fn folder_use(&self) -> FolderUse {
        FolderUse::of(&self.shm_dir)
    }
}

/// A node, and the folder of its files. Dropped in this order.
pub(crate) struct IpcNode {
    pub(crate) node: Node<Ipc>,
    pub(crate) shm_dir: Arc<ShmDir>,
}

impl IpcNode {
    /// Removes what killed processes left.
    pub(crate) fn clean_up_dead_nodes(&self) {
        self.shm_dir.complete_dead_nodes(self.node.id().value());
        self.node.try_cleanup_dead_nodes();
    }
}

/// A node without signal handlers, with an explicit configuration.
pub(crate) fn open_node(runtime_dir: &RuntimeDir, name: &str) -> Result<IpcNode, IpcError> {
    quiet();
    let entering = format!("entering the folder {}", runtime_dir.root().display());
    let shm_dir = runtime_dir.open_shm_dir().and_then(|shm_dir| shm_dir.check_segments().map(|()| shm_dir));
    let shm_dir = Arc::new(shm_dir.map_err(doing(entering)).map_err(|error| error.at(runtime_dir))?);
    let node = NodeBuilder::new()
        .name(&NodeName::new(name).map_err(doing("naming a node"))?)
        .config(&iceoryx(shm_dir.folder()))
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<Ipc>()
        .map_err(doing("creating an iceoryx2 node"))
        .map_err(|error| error.at(runtime_dir))?;
    Ok(IpcNode { node, shm_dir })
}

/// Keeps iceoryx2 from writing to the terminal: users get what matters as errors of this crate.
fn quiet() {
    set_log_level_from_env_or(LogLevel::Fatal);
}

fn still_held() -> IpcError {
    let what = "too many earlier clients still have batches that are held";
    IpcError::new("subscribing to a lane's frames", what, "drop those batches and every array over them")
}

fn service_name(instance: &str, lane: &str, what: &str) -> Result<ServiceName, IpcError> {
    ServiceName::new(&format!("{instance}/{lane}/{what}")).map_err(doing("naming a service"))
}

/// The event that wakes a pool's server.
pub(crate) struct WorkEvent(event::PortFactory<Ipc>);

impl WorkEvent {
    pub(crate) fn create(node: &Node<Ipc>, instance: &str, lanes: usize) -> Result<Self, IpcError> {
        let builder = node.service_builder(&service_name(instance, "", "work")?).event();
        let service = builder
            .max_listeners(1)
            .max_notifiers(lanes * 3 + SLACK)
            .max_nodes(lanes * 3 + SLACK)
            .create()
            .map_err(doing("creating the work event"))?;
        Ok(WorkEvent(service))
    }

    pub(crate) fn open(node: &Node<Ipc>, instance: &str) -> Result<Self, IpcError> {
        let builder = node.service_builder(&service_name(instance, "", "work")?).event();
        Ok(WorkEvent(builder.open().map_err(doing("opening the work event"))?))
    }

    pub(crate) fn listener(&self) -> Result<IpcListener, IpcError> {
        self.0.listener_builder().create().map_err(doing("listening to the work event"))
    }

    pub(crate) fn notifier(&self) -> Result<IpcNotifier, IpcError> {
        self.0.notifier_builder().create().map_err(doing("joining the work event"))
    }
}

type FrameService = publish_subscribe::PortFactory<Ipc, [u8], FrameHeader>;
type RequestService = publish_subscribe::PortFactory<Ipc, [u8], RequestHeader>;

fn create_frames(
    node: &Node<Ipc>,
    name: &ServiceName,
    nodes: usize,
    capacity: Capacity,
) -> Result<FrameService, IpcError> {
    let builder = node.service_builder(name).publish_subscribe::<[u8]>().user_header::<FrameHeader>();
    builder
        .max_publishers(1)
        .max_subscribers(capacity.subscriptions())
        .max_nodes(nodes)
        .subscriber_max_buffer_size(capacity.frames_waiting)
        .subscriber_max_borrowed_samples(capacity.max_held_batches)
        .history_size(0)
        // A learner or spectator that stopped reading must not stop the workers.
        .enable_safe_overflow(true)
        .create()
        .map_err(doing("creating a lane's frame service"))
}

fn create_requests(
    node: &Node<Ipc>,
    name: &ServiceName,
    nodes: usize,
    capacity: Capacity,
) -> Result<RequestService, IpcError> {
    let builder = node.service_builder(name).publish_subscribe::<[u8]>().user_header::<RequestHeader>();
    builder
        .max_publishers(1 + SLACK)
        .max_subscribers(1)
        .max_nodes(nodes)
        .subscriber_max_buffer_size(capacity.requests_waiting)
        .subscriber_max_borrowed_samples(REQUESTS_READ)
        .history_size(0)
        // A learner that sends faster than the server accepts must wait; a request is never dropped.
        .enable_safe_overflow(false)
        .create()
        .map_err(doing("creating a lane's request service"))
}

/// The services of one lane.
pub(crate) struct LaneServices {
    frames: FrameService,
    frames_event: event::PortFactory<Ipc>,
    requests: RequestService,
}

impl LaneServices {
    pub(crate) fn create(
        node: &Node<Ipc>,
        instance: &str,
        lane: &str,
        capacity: Capacity,
    ) -> Result<Self, IpcError> {
        let nodes = capacity.spectators + 2 + SLACK;
        let frames_name = service_name(instance, lane, "frames")?;
        let frames = create_frames(node, &frames_name, nodes, capacity)?;
        let frames_event = node.service_builder(&frames_name).event().max_listeners(1 + SLACK);
        let frames_event = frames_event.max_notifiers(1).max_nodes(nodes).create();
        let frames_event = frames_event.map_err(doing("creating a lane's frame event"))?;
        let requests = create_requests(node, &service_name(instance, lane, "requests")?, nodes, capacity)?;
        Ok(LaneServices { frames, frames_event, requests })
    }

    pub(crate) fn open(node: &Node<Ipc>, instance: &str, lane: &str) -> Result<Self, IpcError> {
        let frames_name = service_name(instance, lane, "frames")?;
        let frames = node.service_builder(&frames_name).publish_subscribe::<[u8]>();
        let frames =
            frames.user_header::<FrameHeader>().open().map_err(doing("opening a lane's frame service"))?;
        let frames_event = node.service_builder(&frames_name).event();
        let frames_event = frames_event.open().map_err(doing("opening a lane's frame event"))?;
        let requests = node.service_builder(&service_name(instance, lane, "requests")?);
        let requests = requests.publish_subscribe::<[u8]>().user_header::<RequestHeader>();
        let requests = requests.open().map_err(doing("opening a lane's request service"))?;
        Ok(LaneServices { frames, frames_event, requests })
    }

    pub(crate) fn frame_publisher(
        &self,
        layout: &Layout,
        capacity: Capacity,
        failures: &Failures,
    ) -> Result<FramePublisher, IpcError> {
        self.frames
            .publisher_builder()
            .initial_max_slice_len(layout.bytes())
            .max_loaned_samples(capacity.frames_filling)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .set_degradation_handler(failures.handler(PeerEnd::Receiver))
            .create()
            .map_err(doing("creating a lane's frame publisher"))
    }

    /// `waiting`: how many frames may wait; the oldest is dropped for a newer one.
    pub(crate) fn frame_port(
        &self,
        waiting: usize,
        ipc_node: &IpcNode,
        failures: &Failures,
    ) -> Result<FramePort, IpcError> {
        let begin = Instant::now();
        loop {
            let builder = self.frames.subscriber_builder().buffer_size(waiting);
            match builder.set_degradation_handler(failures.handler(PeerEnd::Sender)).create() {
                Ok(subscriber) => {
                    return Ok(FramePort { subscriber, shm_dir: Arc::clone(&ipc_node.shm_dir) });
                }
                Err(SubscriberCreateError::ExceedsMaxSupportedSubscribers)
                    if begin.elapsed() < RECLAIM_TIMEOUT =>
                {
                    // The supervisor looks for dead processes every 100 ms while a peer attaches.
                    std::thread::sleep(Duration::from_millis(20));
                }
                Err(SubscriberCreateError::ExceedsMaxSupportedSubscribers) => return Err(still_held()),
                Err(error) => return Err(doing("subscribing to a lane's frames")(error)),
            }
        }
    }

    pub(crate) fn frame_notifier(&self) -> Result<IpcNotifier, IpcError> {
        self.frames_event.notifier_builder().create().map_err(doing("joining a lane's frame event"))
    }

    pub(crate) fn frame_listener(&self) -> Result<IpcListener, IpcError> {
        self.frames_event.listener_builder().create().map_err(doing("listening to a lane's frame event"))
    }

    pub(crate) fn request_publisher(
        &self,
        layout: &Layout,
        num_envs: usize,
        capacity: Capacity,
        failures: &Failures,
    ) -> Result<RequestPublisher, IpcError> {
        let requests = capacity.requests();
        self.requests
            .publisher_builder()
            .initial_max_slice_len(max_request_bytes(layout, num_envs))
            .max_loaned_samples(1)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .set_degradation_handler(failures.handler(PeerEnd::Receiver))
            .override_sample_preallocation(move |_| requests)
            .create()
            .map_err(doing("creating a learner's request publisher"))
    }

    pub(crate) fn request_subscriber(&self, failures: &Failures) -> Result<RequestSubscriber, IpcError> {
        let builder = self.requests.subscriber_builder();
        builder
            .set_degradation_handler(failures.handler(PeerEnd::Sender))
            .create()
            .map_err(doing("subscribing to a lane's requests"))
    }
}
