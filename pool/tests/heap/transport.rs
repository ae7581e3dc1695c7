//! A transport of channels and vectors. Everything of the pool but the transport is what it is in production,
//! so these tests run where shared memory does not: under Miri, valgrind and a fuzzer.

use smaclite_pool::fields::Field;
use smaclite_pool::layout::{BLOCK_ALIGN, Element, Layout};
use smaclite_pool::transport::{
    Doorbell, Epoch, FrameContent, Inlet, Message, Outlet, Request, RequestKind, Transport,
};
use smaclite_pool::{LaneSpec, Rejection};
use std::sync::atomic::{AtomicBool, AtomicI32, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex};
use std::time::Duration;

/// Lanes over the heap.
pub struct Heap;

impl Transport for Heap {
    type Inlet = HeapInlet;
    type Outlet = HeapOutlet;
    type Doorbell = Bell;
}

/// A request, or what a sender made of one.
pub struct HeapMessage {
    /// The sender's session.
    pub session: u64,
    /// The sender's count.
    pub number: u64,
    /// What is asked; `None` for a message without a form.
    pub kind: Option<RequestKind>,
    /// Whom it is about.
    pub env_ids: Vec<i32>,
    /// Joint actions, `n_agents` an environment.
    pub actions: Vec<i32>,
}

/// A message where the pool reads it.
pub struct Received {
    message: HeapMessage,
    env_ids: Vec<AtomicI32>,
    actions: Vec<AtomicI32>,
}

impl Message for Received {
    fn request(&self) -> Result<Request<'_>, Rejection> {
        let Some(kind) = self.message.kind else {
            return Err(Rejection::Malformed { what: "a message without a form".to_owned() });
        };
        let (session, number) = (self.message.session, self.message.number);
        Ok(Request { session, number, kind, env_ids: &self.env_ids, actions: &self.actions })
    }
}

/// A lane's requests.
pub struct HeapInlet(Receiver<HeapMessage>);

impl Inlet for HeapInlet {
    type Message = Received;

    fn receive(&mut self) -> Result<Option<Received>, String> {
        let Ok(message) = self.0.try_recv() else { return Ok(None) };
        let atomics = |values: &[i32]| values.iter().map(|v| AtomicI32::new(*v)).collect();
        Ok(Some(Received { env_ids: atomics(&message.env_ids), actions: atomics(&message.actions), message }))
    }
}

/// Memory of one frame; `start` is where it is aligned.
pub struct Memory {
    bytes: Vec<u8>,
    start: usize,
    len: usize,
}

impl Memory {
    fn new(len: usize) -> Memory {
        // Filled with nonsense: a row that nobody writes must not look right by chance.
        let bytes = vec![0xa5; len + BLOCK_ALIGN];
        let start = bytes.as_ptr().align_offset(BLOCK_ALIGN);
        Memory { bytes, start, len }
    }

    fn as_slice(&self) -> &[u8] {
        &self.bytes[self.start..self.start + self.len]
    }
}

/// While it is on, an outlet has no frames to fill.
#[derive(Default)]
pub struct Shortage {
    pub on: AtomicBool,
    /// How often a frame was asked for in vain.
    pub refused: AtomicUsize,
}

/// A lane's frames.
pub struct HeapOutlet {
    frames: Sender<Frame>,
    len: usize,
    shortage: Arc<Shortage>,
}

// SAFETY: a loan owns its vector, which is not resized; moving the loan does not move what the vector points
// to.
#[allow(unsafe_code)]
unsafe impl Outlet for HeapOutlet {
    type Loan = Memory;

    fn loan(&mut self) -> Result<Memory, String> {
        if self.shortage.on.load(Ordering::SeqCst) {
            self.shortage.refused.fetch_add(1, Ordering::SeqCst);
            return Err("all frames are in use".to_owned());
        }
        Ok(Memory::new(self.len))
    }

    fn payload(loan: &mut Memory) -> &mut [u8] {
        &mut loan.bytes[loan.start..loan.start + loan.len]
    }

    fn publish(&mut self, memory: Memory, epoch: Epoch, content: FrameContent) {
        let _ = self.frames.send(Frame { memory, epoch, content }); // a learner that left does not read it
    }
}

/// A published frame.
pub struct Frame {
    memory: Memory,
    /// What it answers.
    pub epoch: Epoch,
    /// Batch or rejection.
    pub content: FrameContent,
}

impl Frame {
    /// A field of all slots.
    pub fn field<T: Element>(&self, layout: &Layout, field: Field) -> Option<Vec<T>> {
        layout.view::<T>(self.memory.as_slice(), field).map(<[T]>::to_vec)
    }

    /// The rejection in it, if it is one, and the request's number.
    pub fn rejection(&self) -> Option<(u64, Rejection)> {
        let FrameContent::Rejection { request, len } = self.content else { return None };
        let text = &self.memory.as_slice()[..len];
        Some((request, serde_json::from_slice(text).expect("rejections are JSON")))
    }
}

/// Rung by whoever sends a request.
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

/// The learner's ends of a lane.
pub struct Ends {
    /// Where requests go.
    pub requests: Sender<HeapMessage>,
    /// Where frames come from.
    pub frames: Receiver<Frame>,
    /// Takes the lane's frames away.
    pub shortage: Arc<Shortage>,
}

/// What [`smaclite_pool::Pool::start`] takes for a lane, and the learner's ends of it.
pub fn lane(spec: LaneSpec) -> ((LaneSpec, HeapInlet, HeapOutlet), Ends) {
    let (requests, inlet) = channel();
    let (outlet, frames) = channel();
    let len = spec.layout().bytes();
    let shortage = Arc::new(Shortage::default());
    let outlet = HeapOutlet { frames: outlet, len, shortage: Arc::clone(&shortage) };
    ((spec, HeapInlet(inlet), outlet), Ends { requests, frames, shortage })
}
