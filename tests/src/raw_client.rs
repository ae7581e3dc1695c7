//! Clients without the checks of the real one: any text on the control socket, any bytes as a request.

use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::*;
use smaclite_ipc::control::protocol::PROTOCOL_VERSION;
use smaclite_ipc::wire::{FrameHeader, RequestHeader};
use smaclite_ipc::{LaneDescription, PoolService, RuntimeDir};
use smaclite_pool::layout::Layout;
use smaclite_pool::transport::{RequestKind, RequestNumber, SessionId};
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;

/// The variant of iceoryx2 services that pools use.
pub type Ipc = PoolService;

/// An iceoryx2 node in the pool's directory.
///
/// # Panics
/// If no pool runs.
pub fn node(runtime_dir: &RuntimeDir) -> Node<Ipc> {
    set_log_level(LogLevel::Fatal);
    let config = smaclite_ipc::iceoryx(&runtime_dir.shm_dir().expect("a pool that runs"));
    NodeBuilder::new()
        .config(&config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<Ipc>()
        .expect("a node")
}

/// The request to become the learner of a lane, or of the only lane.
pub fn attach_request(lane: Option<&str>) -> String {
    let lane = lane.map_or("null".to_owned(), |lane| format!("\"{lane}\""));
    request(&format!(r#""request":"attach","lane":{lane}"#))
}

/// A request of this release, by its own keys.
pub fn request(keys: &str) -> String {
    format!(r#"{{"version":{PROTOCOL_VERSION},"release":"0.0.0",{keys}}}"#)
}

/// A connection to the control socket of a pool.
pub struct Control(BufReader<UnixStream>);

impl Control {
    /// Connects to pool `train`.
    ///
    /// # Panics
    /// If it does not run.
    pub fn connect(runtime_dir: &RuntimeDir) -> Control {
        Control(BufReader::new(UnixStream::connect(runtime_dir.socket("train")).expect("the pool's socket")))
    }

    /// Writes a line of any text and returns the answer; empty if the pool closed the connection.
    pub fn ask(&mut self, line: &str) -> String {
        let mut answer = String::new();
        if self.0.get_mut().write_all(format!("{line}\n").as_bytes()).is_ok() {
            let _ = self.0.read_line(&mut answer);
        }
        answer
    }

    /// Attaches to a lane as its learner. Returns the session and the lane's description.
    ///
    /// # Panics
    /// If the pool refuses.
    pub fn attach(&mut self, lane: &str) -> (u64, LaneDescription) {
        let answer = self.ask(&attach_request(Some(lane)));
        let answer: serde_json::Value = serde_json::from_str(&answer).expect("an answer");
        let session = answer["session"].as_u64().unwrap_or_else(|| panic!("refused: {answer}"));
        (session, serde_json::from_value(answer["lane"].clone()).expect("a description"))
    }
}

/// Where a sent request lies in shared memory, which stays mapped while its publisher lives.
pub struct Sent {
    /// Its header.
    pub header: *mut RequestHeader,
    /// Its environments and body.
    pub payload: *mut u8,
}

/// The sending side of a lane's requests.
pub struct Requests {
    /// Publishes requests.
    pub publisher: Publisher<Ipc, [u8], RequestHeader>,
    notifier: Notifier<Ipc>,
}

/// Opens the requests of a lane, for payloads of up to `max_bytes` bytes.
///
/// # Panics
/// If the lane does not exist.
pub fn requests(node: &Node<Ipc>, lane: &LaneDescription, max_bytes: usize) -> Requests {
    let name = format!("{}//work", lane.instance);
    let work = node
        .service_builder(&ServiceName::new(&name).expect("a name"))
        .event()
        .open()
        .expect("an event service");
    let notifier = work.notifier_builder().create().expect("a notifier");
    let name = format!("{}/{}/requests", lane.instance, lane.lane);
    let service = node.service_builder(&ServiceName::new(&name).expect("a name"));
    let service =
        service.publish_subscribe::<[u8]>().user_header::<RequestHeader>().open().expect("requests");
    let builder = service.publisher_builder().initial_max_slice_len(max_bytes);
    let builder = builder.backpressure_strategy(BackpressureStrategy::DiscardData);
    Requests { publisher: builder.create().expect("a publisher"), notifier }
}

impl Requests {
    /// Sends a request, and waits while the queue is full. Returns where it lies in shared memory.
    ///
    /// # Panics
    /// If the supervisor does not read requests for [`TIMEOUT`](crate::process::TIMEOUT).
    pub fn send(&self, header: RequestHeader, payload: &[u8]) -> Sent {
        let mut sent = None;
        crate::process::eventually(|| {
            sent = self.try_send(header, payload);
            sent.is_some()
        });
        sent.expect("a supervisor that reads requests")
    }

    /// Sends a request unless the queue is full, as [`send`](Requests::send).
    pub fn try_send(&self, header: RequestHeader, payload: &[u8]) -> Option<Sent> {
        let mut sample = self.publisher.loan_slice(payload.len()).ok()?;
        *sample.user_header_mut() = header;
        sample.payload_mut().copy_from_slice(payload);
        let header = std::ptr::from_mut(sample.user_header_mut());
        let place = Sent { header, payload: sample.payload_mut().as_mut_ptr() };
        let sent = sample.send();
        let _ = self.notifier.notify();
        matches!(sent, Ok(receivers) if receivers > 0).then_some(place)
    }
}

/// A learner that checks nothing before it sends.
pub struct RawLearner {
    requests: Requests,
    /// The description of its lane.
    pub lane: LaneDescription,
    layout: Layout,
    session: u64,
    number: u64,
    _node: Node<Ipc>,
    _control: Control,
}

impl RawLearner {
    /// Attaches to a lane of pool `train`, for payloads of up to `max_bytes` bytes.
    ///
    /// # Panics
    /// If the pool refuses.
    pub fn attach(runtime_dir: &RuntimeDir, lane: &str, max_bytes: usize) -> RawLearner {
        let mut control = Control::connect(runtime_dir);
        let (session, lane) = control.attach(lane);
        let node = node(runtime_dir);
        let requests = requests(&node, &lane, max_bytes);
        let layout = lane.layout().expect("a layout");
        RawLearner { requests, lane, layout, session, number: 0, _node: node, _control: control }
    }

    /// Sends a request for `count` environments with the next number, as [`Requests::send`].
    pub fn send(&mut self, kind: RequestKind, payload: &[u8], count: usize) -> Sent {
        self.number += 1;
        self.send_numbered(self.number, kind, payload, count)
    }

    /// Sends a request with any number.
    pub fn send_numbered(&self, number: u64, kind: RequestKind, payload: &[u8], count: usize) -> Sent {
        let header =
            RequestHeader::new(&self.layout, SessionId(self.session), RequestNumber(number), kind, count);
        self.requests.send(header, payload)
    }
}

/// A subscriber to a lane's frames, like a spectator's.
///
/// # Panics
/// If the lane does not exist.
pub fn frame_subscriber(node: &Node<Ipc>, lane: &LaneDescription) -> Subscriber<Ipc, [u8], FrameHeader> {
    let name = format!("{}/{}/frames", lane.instance, lane.lane);
    let service = node.service_builder(&ServiceName::new(&name).expect("a name"));
    let service = service.publish_subscribe::<[u8]>().user_header::<FrameHeader>().open().expect("frames");
    service.subscriber_builder().create().expect("a subscriber")
}
