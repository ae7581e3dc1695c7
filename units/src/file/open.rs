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

/// What a path is that is not a file.
pub(super) fn not_a_file(path: &Path) -> String {
    let is_run = path.join("run.json").is_file();
    match path.is_dir() {
        true if is_run => "it is the folder of a run of `smaclite-pool train`, not a file".into(),
        true => "it is a folder, not a file".into(),
        false => "it is not a regular file".into(),
    }
}
