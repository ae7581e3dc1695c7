//! Systems on which a pool serves the process that it runs in.

pub(crate) mod files;
pub(crate) mod memory;
mod name_lock;
pub(crate) mod shm_dir;
pub(crate) mod shortage;
pub(crate) mod socket;
pub(crate) mod variant;

pub(crate) use name_lock::NameLock;
use std::sync::OnceLock;
use std::time::Instant;

/// Whether other processes can attach to pools on this system: on Linux they can.
pub const SERVES_OTHER_PROCESSES: bool = false;

/// Nanoseconds since the first call.
pub(crate) fn now_ns() -> u64 {
    static BEGIN: OnceLock<Instant> = OnceLock::new();
    BEGIN.get_or_init(Instant::now).elapsed().as_nanos() as u64
}

/// The id of this process.
pub(crate) fn process_id() -> u32 {
    std::process::id()
}
