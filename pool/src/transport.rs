//! What the pool needs of a transport, as traits. `ipc` implements them over iceoryx2, the tests over the
//! heap.

use crate::rejection::Rejection;
use std::ops::Deref;
use std::sync::atomic::{AtomicI32, Ordering};
use std::time::Duration;

/// The parts of one transport.
pub trait Transport: Send + Sync + 'static {
    /// Where a lane's requests come from.
    type Inlet: Inlet;
    /// Where a lane's frames go.
    type Outlet: Outlet;
    /// What wakes the server.
    type Doorbell: Doorbell;
}

/// An error of the transport, for example that its memory is exhausted.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub struct TransportError(#[from] pub Box<dyn std::error::Error + Send + Sync>);

/// The receiving end of a lane.
pub trait Inlet: Send + 'static {
    /// A received request, kept alive while it is read.
    type Message: Message + Send;
    /// The next message, if one is waiting. Never blocks.
    ///
    /// # Errors
    /// If the transport fails.
    fn receive(&mut self) -> Result<Received<Self::Message>, TransportError>;
}

/// What a lane received from a process that is not trusted.
#[derive(Debug)]
pub enum Received<M> {
    /// No message.
    Nothing,
    /// A request that is well-formed for this lane.
    Request(M),
    /// Something else.
    Malformed(Rejection),
}

/// A well-formed request. What precedes its environments was read once, when it was received.
pub trait Message {
    /// The request.
    fn request(&self) -> Request<'_>;

    /// How long ago the sender claims to have sent it. Used for statistics only.
    fn waited(&self) -> Duration {
        Duration::ZERO
    }
}

/// One attachment of a learner to a lane. Unique within a supervisor, from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SessionId(pub u64);

/// Counts the requests of a session, from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct RequestNumber(pub u64);

impl RequestNumber {
    /// The number of the next request.
    pub fn next(self) -> RequestNumber {
        RequestNumber(self.0 + 1)
    }
}

/// What a result belongs to. A reset of all environments begins a new epoch; results of an older one are
/// dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Epoch {
    /// The learner's session.
    pub session: SessionId,
    /// The reset that began the epoch; `None` before the session's first.
    pub reset: Option<RequestNumber>,
}

/// A number of a request, in the memory of its sender.
pub trait Number {
    /// Reads it, once.
    fn read(&self) -> i32;
}

/// In shared memory, to which the sender can still write.
impl Number for AtomicI32 {
    #[inline]
    fn read(&self) -> i32 {
        self.load(Ordering::Relaxed)
    }
}

/// Of a thread of this process, which calls.
impl Number for i32 {
    #[inline]
    fn read(&self) -> i32 {
        *self
    }
}

/// A request. The sender of one in shared memory can still change it, so each value is read once and checked
/// after it was read.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a, N = AtomicI32> {
    /// The session of the sender.
    pub session: SessionId,
    /// The sender's number of the request, which a rejection names.
    pub number: RequestNumber,
    /// What the environments should do.
    pub kind: RequestKind,
    /// `[count]`: the environments that the request is about.
    pub env_ids: &'a [N],
    /// What the kind of the request says.
    pub body: &'a [N],
}

/// What the environments of a request should do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RequestKind {
    /// One step. The body has the joint actions, `[count, n_actors]`.
    Step,
    /// A new episode. The body is empty, or has the levels with which the episodes begin, f32
    /// `[count, n_units, 5]`.
    Reset {
        /// How they are seeded.
        seeds: Seeds<()>,
        /// The body has levels.
        levels: bool,
    },
    /// The state of a snapshot. The body has the snapshots, `[count, snapshot_size]` bytes.
    Restore {
        /// How they draw from there on: as after a reset.
        seeds: Seeds<()>,
    },
    /// The state of another environment. The body has the numbers of the others, `[count]`.
    Fork {
        /// As of a restore.
        seeds: Seeds<()>,
    },
}

impl RequestKind {
    /// How its environments are seeded.
    pub fn seeds(self) -> Seeds<()> {
        match self {
            RequestKind::Step => Seeds::Continue,
            RequestKind::Reset { seeds, .. }
            | RequestKind::Restore { seeds }
            | RequestKind::Fork { seeds } => seeds,
        }
    }

    /// Whether the request begins an epoch, if it is accepted: what was requested before is dropped. In a
    /// session that was not reset, it resets the environments of a synchronous lane that it does not name.
    pub fn begins_epoch(self, names_all: bool, is_synchronous: bool, was_reset: bool) -> bool {
        match self {
            RequestKind::Reset { .. } => names_all || is_synchronous && !was_reset,
            RequestKind::Restore { .. } => !was_reset && (names_all || is_synchronous),
            RequestKind::Step | RequestKind::Fork { .. } => false,
        }
    }
}

/// How the random generators of environments are seeded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seeds<T> {
    /// Not at all: they go on.
    Continue,
    /// That of environment `i` with this + `i`.
    From(u64),
    /// Each with its own, or not at all. In a request, the body then begins with them: i32
    /// `[count, SEED_WORDS]`, see [`seed_words`].
    Each(T),
}

impl<T> Seeds<T> {
    /// Which kind of seeds they are.
    pub fn form(&self) -> Seeds<()> {
        match self {
            Seeds::Continue => Seeds::Continue,
            Seeds::From(seed) => Seeds::From(*seed),
            Seeds::Each(_) => Seeds::Each(()),
        }
    }

    /// The same seeds, borrowed.
    pub fn as_deref(&self) -> Seeds<&T::Target>
    where
        T: Deref,
    {
        match self {
            Seeds::Continue => Seeds::Continue,
            Seeds::From(seed) => Seeds::From(*seed),
            Seeds::Each(seeds) => Seeds::Each(seeds),
        }
    }
}

impl<T> From<Option<u64>> for Seeds<T> {
    fn from(seed: Option<u64>) -> Self {
        seed.map_or(Seeds::Continue, Seeds::From)
    }
}

/// The numbers that a seed of one environment takes in a request.
pub const SEED_WORDS: usize = 3;

/// A seed of one environment in a request: 1 if there is one, else 0, and its halves, the lower first.
pub fn seed_words(seed: Option<u64>) -> [i32; SEED_WORDS] {
    let bits = seed.unwrap_or_default();
    [i32::from(seed.is_some()), bits as i32, (bits >> 32) as i32]
}

/// The seed of [`seed_words`] that a sender wrote.
pub(crate) fn read_seed<N: Number>(words: &[N; SEED_WORDS]) -> Option<u64> {
    let [is_given, low, high] = words.each_ref().map(N::read);
    (is_given != 0).then_some(u64::from(low as u32) | u64::from(high as u32) << 32)
}

/// The sending end of a lane.
///
/// # Safety
/// What [`payload`](Outlet::payload) returns stays alive, at its address and without any other access, until
/// its loan is published or dropped: several threads write to it in that time.
#[allow(unsafe_code)] // a promise, no code
pub unsafe trait Outlet: Send + 'static {
    /// The memory of a frame being filled, aligned to [`BLOCK_ALIGN`](crate::layout::BLOCK_ALIGN).
    type Loan: Send;
    /// A frame to fill. Never blocks.
    ///
    /// # Errors
    /// If no frame is free now.
    fn loan(&mut self) -> Result<Self::Loan, TransportError>;
    /// The payload of a loaned frame; its address does not change until it is published.
    fn payload(loan: &mut Self::Loan) -> &mut [u8];
    /// Sends a filled frame and wakes its readers. `epoch` is `None` while the lane has no learner.
    fn publish(&mut self, loan: Self::Loan, epoch: Option<Epoch>, content: FrameContent);
}

/// What a published frame holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameContent {
    /// Every slot is filled.
    Batch,
    /// The first bytes are a JSON [`Rejection`].
    Rejection {
        /// The refused request; `None` reports that the lane failed.
        request: Option<RequestNumber>,
        /// Bytes of the text.
        len: usize,
    },
}

/// Wakes the server, which waits for requests.
pub trait Doorbell: Send + Sync + 'static {
    /// Blocks until the bell rings or the time is over. A ring that comes before the wait ends it at once.
    fn wait(&self, timeout: Duration);
    /// Rings the bell.
    fn ring(&self);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Which is refused before the first reset, and what is dropped by a request, depends on it.
    #[test]
    fn resets_of_all_begin_an_epoch_and_so_does_what_comes_first() {
        let seeds = Seeds::Continue;
        let (reset, restore) = (RequestKind::Reset { seeds, levels: false }, RequestKind::Restore { seeds });
        let fork = RequestKind::Fork { seeds };
        for case in 0..8 {
            let [names_all, is_synchronous, was_reset] = [1, 2, 4].map(|bit| case & bit != 0);
            let begins = |kind: RequestKind| kind.begins_epoch(names_all, is_synchronous, was_reset);
            // The first batch of a synchronous lane has all environments, whichever are named.
            let is_first_of_all = !was_reset && (names_all || is_synchronous);
            let expected = [names_all || is_first_of_all, is_first_of_all, false, false];
            assert_eq!([reset, restore, RequestKind::Step, fork].map(begins), expected, "case {case}");
        }
    }

    #[test]
    fn seeds_are_read_as_they_were_written() {
        for seed in [None, Some(0), Some(1), Some(u64::from(u32::MAX)), Some(1 << 63 | 5), Some(u64::MAX)] {
            let words = seed_words(seed).map(AtomicI32::new);
            assert_eq!(read_seed(&words), seed);
        }
    }
}
