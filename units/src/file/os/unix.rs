//! Files of Linux and macOS.

use std::fs::{File, Permissions};
use std::io;
use std::os::unix::fs::{FileExt, PermissionsExt};
use std::path::Path;

/// Opens a file for reads that never wait. Some files that claim to be regular block when they are read, as
/// /proc/kmsg does. With NONBLOCK the read is an error instead.
pub(in crate::file) fn without_waiting(path: &Path) -> io::Result<File> {
    use rustix::fs::{Mode, OFlags};
    let flags = OFlags::RDONLY | OFlags::CLOEXEC | OFlags::NONBLOCK;
    Ok(File::from(rustix::fs::open(path, flags, Mode::empty())?))
}

/// What makes a folder that gets its final name when it is complete. Temporary folders are private by
/// default; these are as the user's other folders.
pub fn partial_folder<'a>() -> tempfile::Builder<'a, 'a> {
    let mut builder = tempfile::Builder::new();
    builder.permissions(Permissions::from_mode(0o777));
    builder
}

/// Writes bytes to a place of a file, to which other threads may write at other places.
///
/// # Errors
/// Those of the system.
pub fn write_all_at(file: &File, bytes: &[u8], offset: u64) -> io::Result<()> {
    file.write_all_at(bytes, offset)
}

/// What a process locks that uses a folder: the folder itself.
///
/// # Errors
/// Those of the system.
pub fn to_lock(folder: &Path) -> io::Result<File> {
    File::open(folder)
}
