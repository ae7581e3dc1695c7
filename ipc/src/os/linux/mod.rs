//! Linux: other processes attach to pools.

mod dead_nodes;
pub(crate) mod files;
mod fork;
pub(crate) mod memory;
mod name_lock;
pub(crate) mod shm_dir;
pub(crate) mod shortage;
pub(crate) mod socket;
pub(crate) mod variant;

pub(crate) use fork::{NotInherited, process_id};
pub(crate) use name_lock::NameLock;

/// Whether other processes can attach to pools on this system: on Linux they can.
pub const SERVES_OTHER_PROCESSES: bool = true;

/// Nanoseconds by the clock that all processes of a machine share (`CLOCK_MONOTONIC`).
#[inline]
pub(crate) fn now_ns() -> u64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}
