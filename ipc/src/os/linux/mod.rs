//! Linux: Unix sockets, and shared memory in `/dev/shm` that is reserved before its use.

mod dead_nodes;
pub(crate) mod files;
mod fork;
pub(crate) mod memory;
mod name_lock;
pub(crate) mod shm_dir;
pub(crate) mod shortage;
pub(crate) mod socket;
pub(crate) mod storage;

pub(crate) use fork::{NotInherited, process_id};
pub(crate) use name_lock::NameLock;
pub(crate) use storage::{Event, Monitoring};

/// Nanoseconds by the clock that all processes of a machine share (`CLOCK_MONOTONIC`).
#[inline]
pub(crate) fn now_ns() -> u64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}
