//! How many frames and requests the memory of a lane has room for, and how many bytes they take.
//!
//! iceoryx2 sets the memory of a lane aside once, so it must suffice for the worst case.

use crate::wire::max_request_bytes;
use serde::{Deserialize, Serialize};
use smaclite_pool::LaneSettings;
use smaclite_pool::layout::Layout;

/// Subscriptions of earlier learners that may last: of one that was killed, until its memory is reclaimed, or
/// of one that is gone but whose process still holds frames. Each costs the memory of a learner's frames.
const DEPARTED_LEARNERS: usize = 1;

/// Requests of a learner that the supervisor holds at once: one, and one more.
pub(crate) const REQUESTS_READ: usize = 2;

/// iceoryx2 keeps this many bytes in front of every payload of a frame or request: its header and ours, on
/// cache lines.
const CHUNK_OVERHEAD: usize = 192;

/// How many frames and requests the memory of a lane has room for. Part of the lane's description.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Capacity {
    /// Frames that a learner may hold at once.
    pub max_held_batches: usize,
    /// Frames that can wait for the learner: all results of one request to every environment, and an error
    /// report.
    pub frames_waiting: usize,
    /// Frames being filled at once.
    pub frames_filling: usize,
    /// Spectators at once.
    pub spectators: usize,
    /// Requests that can wait for the supervisor.
    pub requests_waiting: usize,
}

impl Capacity {
    /// What a lane needs that at most `threads` threads write to at once.
    pub fn new(
        settings: &LaneSettings,
        threads: usize,
        max_held_batches: usize,
        spectators: usize,
    ) -> Capacity {
        let LaneSettings { num_envs, batch_size, .. } = *settings;
        let synchronous = settings.is_synchronous();
        // A synchronous lane opens a frame when no thread writes to the one before. In an asynchronous one
        // the thread that opens a frame writes to no other, and each of the rest may write to a frame of an
        // earlier session, or to the last slot of a full one. One more is for a rejection, and one is kept
        // back to report a failure.
        let writing = if synchronous { 1 } else { threads.min(num_envs) + 1 };
        Capacity {
            max_held_batches,
            frames_waiting: num_envs / batch_size + 1,
            frames_filling: writing + 2,
            spectators,
            requests_waiting: if synchronous { 2 } else { num_envs.min(64) },
        }
    }

    /// Subscriptions to a lane's frames at once.
    pub(crate) fn subscriptions(&self) -> usize {
        self.spectators + 1 + DEPARTED_LEARNERS
    }

    /// Frames that can exist at once, as iceoryx2 counts them: whatever the subscribers hold back, there is
    /// one to fill.
    fn frames(&self) -> usize {
        self.subscriptions() * (self.frames_waiting + self.max_held_batches) + self.frames_filling
    }

    /// Bytes of shared memory that the supervisor needs for a lane.
    pub fn frame_memory(&self, layout: &Layout) -> usize {
        self.frames() * (layout.bytes() + CHUNK_OVERHEAD).next_multiple_of(64)
    }

    /// Requests of a learner that can exist at once: one is being written, and some are being read.
    pub(crate) fn requests(&self) -> usize {
        self.requests_waiting + 1 + REQUESTS_READ
    }

    /// Bytes of shared memory that a learner needs for its requests.
    pub fn request_memory(&self, layout: &Layout, num_envs: usize) -> usize {
        let bytes = max_request_bytes(layout, num_envs);
        self.requests() * (bytes + CHUNK_OVERHEAD).next_multiple_of(64)
    }
}
