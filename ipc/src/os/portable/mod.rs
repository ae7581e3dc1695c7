//! Systems other than Linux: files, locks of files, and connections to this machine.

mod event;
pub(crate) mod files;
pub(crate) mod memory;
mod monitoring;
mod name_lock;
pub(crate) mod shm_dir;
pub(crate) mod shortage;
pub(crate) mod socket;
pub(crate) mod storage;

pub(crate) use event::Trigger as Event;
pub(crate) use monitoring::Monitoring;
pub(crate) use name_lock::NameLock;
use std::time::{SystemTime, UNIX_EPOCH};

/// Nanoseconds by the clock that all processes of a machine share.
pub(crate) fn now_ns() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos() as u64)
}

/// The id of this process.
pub(crate) fn process_id() -> u32 {
    std::process::id()
}
