//! What the pool asks of a transport. `ipc` answers with iceoryx2; tests answer with the heap.

use crate::rejection::Rejection;
use std::sync::atomic::AtomicI32;
use std::time::Duration;

/// The pieces of one transport.
pub trait Transport: Send + Sync + 'static {
    /// Where a lane's requests come from.
    type Inlet: Inlet;
    /// Where a lane's frames go.
    type Outlet: Outlet;
    /// What wakes the supervisor.
    type Doorbell: Doorbell;
}

/// The receiving end of a lane.
pub trait Inlet: Send + 'static {
    /// A received request, kept alive while it is read.
    type Message: Message;
    /// The next request, if one is there; the error says what kept the lane from looking. Never blocks.
    fn receive(&mut self) -> Result<Option<Self::Message>, String>;
}

/// A message from a process that need not be honest.
pub trait Message {
    /// The request in it, if its form is right for the lane.
    fn request(&self) -> Result<Request<'_>, Rejection>;

    /// How long ago it was sent, as far as the sender tells; only figures depend on it.
    fn waited(&self) -> Duration {
        Duration::ZERO
    }
}

/// A request as it lies in shared memory. The sender can still write to it, so every value is read once and checked
/// after it was read; hence the atomics.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// The session that sends it; requests of any other are ignored.
    pub session: u64,
    /// The sender's count of its requests; answers name it.
    pub number: u64,
    /// What is asked.
    pub kind: RequestKind,
    /// `[count]`: the environments it is about.
    pub env_ids: &'a [AtomicI32],
    /// `[count, n_agents]`: their joint actions; empty for a reset.
    pub actions: &'a [AtomicI32],
}

/// What a request asks of its environments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RequestKind {
    /// One step.
    Step,
    /// A new episode; environment `i` is seeded with `seed + i` if there is a seed.
    Reset {
        /// The seed of environment 0.
        seed: Option<u64>,
    },
}

/// The sending end of a lane.
///
/// # Safety
/// What [`payload`](Outlet::payload) gives stays alive, at its address, and untouched by anyone else until its loan is
/// published or dropped: several threads write to it meanwhile.
#[allow(unsafe_code)] // a promise, no code
pub unsafe trait Outlet: Send + 'static {
    /// The memory of a frame being filled, aligned to [`BLOCK_ALIGN`](crate::layout::BLOCK_ALIGN).
    type Loan: Send;
    /// A frame to fill; the error says why there is none now. Never blocks.
    fn loan(&mut self) -> Result<Self::Loan, String>;
    /// The payload of a loaned frame; its address does not change until it is published.
    fn payload(loan: &mut Self::Loan) -> &mut [u8];
    /// Sends a filled frame of `round` and wakes whoever waits for it.
    fn publish(&mut self, loan: Self::Loan, epoch: Epoch, content: FrameContent);
}

/// What a published frame holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameContent {
    /// Every slot is filled.
    Batch,
    /// The first bytes are a JSON [`Rejection`].
    Rejection {
        /// The number of the refused request.
        request: u64,
        /// Bytes of the text.
        len: usize,
    },
}

/// What a result belongs to. A reset of all environments begins a new round; what is left of the old one is dropped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Epoch {
    /// The learner's session.
    pub session: u64,
    /// The number of the request that began the round; 0 before a session's first.
    pub request: u64,
}

/// Wakes the one worker that waits for requests.
pub trait Doorbell: Send + Sync + 'static {
    /// Blocks until the bell is rung or the time is over. A ring while nobody waits is not lost.
    fn wait(&self, timeout: Duration);
    /// Rings the bell.
    fn ring(&self);
}
