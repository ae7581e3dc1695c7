//! Opening files for reading.

use std::fs::File;
use std::io;
use std::path::Path;

/// Opens a file for reads that never wait. Some files that claim to be regular block when they are read, as
/// /proc/kmsg does. With NONBLOCK the read is an error instead.
#[cfg(not(target_family = "wasm"))]
pub(super) fn without_waiting(path: &Path) -> io::Result<File> {
    use rustix::fs::{Mode, OFlags};
    let flags = OFlags::RDONLY | OFlags::CLOEXEC | OFlags::NONBLOCK;
    Ok(File::from(rustix::fs::open(path, flags, Mode::empty())?))
}

/// In a browser there are no files, and this is an error that says so.
#[cfg(target_family = "wasm")]
pub(super) fn without_waiting(path: &Path) -> io::Result<File> {
    File::open(path)
}
