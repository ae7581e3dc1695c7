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
        // A synchronous lane opens a frame, or loans it in advance, when no thread writes to the one before.
        // In an asynchronous one the thread that opens a frame writes to no other, and each of the rest may
        // write to a frame of an earlier session, or to the last slot of a full one. One more is for a
        // rejection, and one is kept back to report a failure.
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

#[cfg(test)]
mod tests {
    use super::*;
    use smaclite_engine::Sizes;
    use smaclite_pool::fields::FieldSet;

    /// That this suffices is tested with processes; more would refuse pools for which there is room.
    #[test]
    fn a_lane_has_room_for_what_its_learners_hold_and_its_threads_write() {
        let sizes =
            Sizes { n_agents: 2, n_enemies: 1, n_actions: 7, obs_size: 3, state_size: 5, ..Sizes::default() };
        let layout = |slots| Layout::new(sizes, 0, slots, FieldSet::without_final());
        let synchronous = LaneSettings::new(4);
        let capacity = Capacity::new(&synchronous, 3, 4, 1);
        assert_eq!((capacity.frames_waiting, capacity.frames_filling, capacity.requests_waiting), (2, 3, 2));
        // A learner, a departed one and a spectator, of 4 frames each and those that wait.
        assert_eq!((capacity.subscriptions(), capacity.frames(), capacity.requests()), (3, 3 * 6 + 3, 5));
        assert_eq!(layout(4).bytes(), 8192);
        assert_eq!(capacity.frame_memory(&layout(4)), 21 * (8192 + 192));
        assert_eq!(capacity.request_memory(&layout(4), 4), 5 * (64 + 64 + 192));

        let asynchronous = LaneSettings { batch_size: 2, ..LaneSettings::new(9) };
        let capacity = Capacity::new(&asynchronous, 3, 7, 0);
        assert_eq!((capacity.frames_waiting, capacity.frames_filling, capacity.requests_waiting), (5, 6, 9));
        assert_eq!((capacity.subscriptions(), capacity.frames(), capacity.requests()), (2, 2 * 12 + 6, 12));
        assert_eq!(Capacity::new(&asynchronous, 30, 7, 0).frames_filling, 12, "a thread per environment");
        let large = LaneSettings { batch_size: 1, ..LaneSettings::new(100) };
        assert_eq!(Capacity::new(&large, 3, 7, 0).requests_waiting, 64);
    }
}
