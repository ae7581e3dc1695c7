//! A transport of channels and vectors. Everything else of a pool is as in production, so tests with this
//! transport also run where shared memory does not: under Miri, valgrind and a fuzzer.

use smaclite_pool::fields::Field;
use smaclite_pool::layout::{BLOCK_ALIGN, Element, Layout};
use smaclite_pool::transport::{
    Doorbell, Epoch, FrameContent, Inlet, Message, Outlet, Received, Request, RequestKind, RequestNumber,
    SessionId, Transport, TransportError,
};
use smaclite_pool::{LaneSpec, Rejection};
use std::sync::atomic::{AtomicBool, AtomicI32, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex};
use std::time::Duration;

/// Lanes whose requests and frames are in the memory of one process.
pub struct InMemory;

impl Transport for InMemory {
    type Inlet = MemoryInlet;
    type Outlet = MemoryOutlet;
    type Doorbell = Bell;
}

/// A request, which need not be valid.
pub struct SentMessage {
    /// The sender's session.
    pub session: u64,
    /// The sender's count.
    pub number: u64,
    /// The kind of request; `None` for a malformed message.
    pub kind: Option<RequestKind>,
    /// Environments.
    pub env_ids: Vec<i32>,
    /// What the kind of request has besides; of a step the actions, `n_actors` per environment.
    pub actions: Vec<i32>,
}

/// A message on the pool's side; atomics, as in shared memory.
pub struct ReceivedMessage {
    message: SentMessage,
    kind: RequestKind,
    env_ids: Vec<AtomicI32>,
    actions: Vec<AtomicI32>,
}

impl Message for ReceivedMessage {
    fn request(&self) -> Request<'_> {
        let (session, number) = (SessionId(self.message.session), RequestNumber(self.message.number));
        let (env_ids, body) = (&self.env_ids[..], &self.actions[..]);
        Request { session, number, kind: self.kind, env_ids, body }
    }
}

/// A lane's requests.
pub struct MemoryInlet(Receiver<SentMessage>);

impl Inlet for MemoryInlet {
    type Message = ReceivedMessage;

    fn receive(&mut self) -> Result<Received<ReceivedMessage>, TransportError> {
        let Ok(message) = self.0.try_recv() else { return Ok(Received::Nothing) };
        let Some(kind) = message.kind else {
            let what = "a malformed message".to_owned();
            return Ok(Received::Malformed(Rejection::Malformed { what }));
        };
        let atomics = |values: &[i32]| values.iter().map(|v| AtomicI32::new(*v)).collect();
        let (env_ids, actions) = (atomics(&message.env_ids), atomics(&message.actions));
        Ok(Received::Request(ReceivedMessage { kind, env_ids, actions, message }))
    }
}

/// Memory of one frame. `start` is the first aligned byte.
pub struct FrameMemory {
    bytes: Vec<u8>,
    start: usize,
    len: usize,
}

impl FrameMemory {
    fn new(len: usize) -> FrameMemory {
        // Not zeros: a row that is never written must not look right by chance.
        let bytes = vec![0xa5; len + BLOCK_ALIGN];
        let start = bytes.as_ptr().align_offset(BLOCK_ALIGN);
        FrameMemory { bytes, start, len }
    }
}

/// While it is on, an outlet lends no frames.
#[derive(Default)]
pub struct Shortage {
    /// The switch.
    pub on: AtomicBool,
    /// How many requests for a frame were refused.
    pub refused: AtomicUsize,
    /// How many frames the lane has, because they were lent and not published.
    pub lent: AtomicUsize,
}

/// A lane's frames.
pub struct MemoryOutlet {
    frames: Sender<Frame>,
    len: usize,
    shortage: Arc<Shortage>,
}

// SAFETY: a loan owns its vector, which is not resized; moving the loan does not move what the vector points
// to.
#[allow(unsafe_code)]
unsafe impl Outlet for MemoryOutlet {
    type Loan = FrameMemory;

    fn loan(&mut self) -> Result<FrameMemory, TransportError> {
        if self.shortage.on.load(Ordering::SeqCst) {
            self.shortage.refused.fetch_add(1, Ordering::SeqCst);
            return Err(TransportError("all frames are in use".into()));
        }
        self.shortage.lent.fetch_add(1, Ordering::SeqCst);
        Ok(FrameMemory::new(self.len))
    }

    fn payload(loan: &mut FrameMemory) -> &mut [u8] {
        &mut loan.bytes[loan.start..loan.start + loan.len]
    }

    fn publish(&mut self, memory: FrameMemory, epoch: Option<Epoch>, content: FrameContent) {
        self.shortage.lent.fetch_sub(1, Ordering::SeqCst);
        let _ = self.frames.send(Frame { memory, epoch, content }); // a learner that is gone does not read it
    }
}

/// A published frame.
pub struct Frame {
    memory: FrameMemory,
    /// What it answers.
    pub epoch: Option<Epoch>,
    /// Batch or rejection.
    pub content: FrameContent,
}

impl Frame {
    /// The frame's bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.memory.bytes[self.memory.start..][..self.memory.len]
    }

    /// A field of all slots.
    pub fn field<T: Element>(&self, layout: &Layout, field: Field) -> Option<Vec<T>> {
        layout.view::<T>(self.bytes(), field).map(<[T]>::to_vec)
    }

    /// The rejection in it, if it is one, with the request's number.
    pub fn rejection(&self) -> Option<(u64, Rejection)> {
        let FrameContent::Rejection { request, len } = self.content else { return None };
        let text = &self.bytes()[..len];
        Some((
            request.map_or(0, |number| number.0),
            serde_json::from_slice(text).expect("rejections are JSON"),
        ))
    }
}

/// A learner rings it after sending a request.
#[derive(Clone, Default)]
pub struct Bell(Arc<(Mutex<bool>, Condvar)>);

impl Doorbell for Bell {
    fn wait(&self, timeout: Duration) {
        let (rung, changed) = &*self.0;
        let rung = rung.lock().unwrap();
        let (mut rung, _) = changed.wait_timeout_while(rung, timeout, |rung| !*rung).unwrap();
        *rung = false;
    }

    fn ring(&self) {
        let (rung, changed) = &*self.0;
        *rung.lock().unwrap() = true;
        changed.notify_one();
    }
}

/// The learner's side of a lane.
pub struct LearnerSide {
    /// Sends requests.
    pub requests: Sender<SentMessage>,
    /// Receives frames.
    pub frames: Receiver<Frame>,
    /// Withholds the lane's frames.
    pub shortage: Arc<Shortage>,
}

/// The arguments of [`smaclite_pool::Pool::start`] for a lane, and the learner's side of it.
pub fn lane(spec: LaneSpec) -> ((LaneSpec, MemoryInlet, MemoryOutlet), LearnerSide) {
    let (requests, inlet) = channel();
    let (outlet, frames) = channel();
    let len = spec.layout().bytes();
    let shortage = Arc::new(Shortage::default());
    let outlet = MemoryOutlet { frames: outlet, len, shortage: Arc::clone(&shortage) };
    ((spec, MemoryInlet(inlet), outlet), LearnerSide { requests, frames, shortage })
}
