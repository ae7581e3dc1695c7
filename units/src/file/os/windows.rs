//! Files of Windows.

use std::fs::File;
use std::io;
use std::path::Path;

/// Opens a file for reads.
pub(in crate::file) fn without_waiting(path: &Path) -> io::Result<File> {
    File::open(path)
}

/// What makes a folder that gets its final name when it is complete.
pub fn partial_folder<'a>() -> tempfile::Builder<'a, 'a> {
    tempfile::Builder::new()
}

/// Writes bytes to a place of a file, to which other threads may write at other places.
///
/// # Errors
/// Those of the system.
pub fn write_all_at(file: &File, mut bytes: &[u8], mut offset: u64) -> io::Result<()> {
    while !bytes.is_empty() {
        match std::os::windows::fs::FileExt::seek_write(file, bytes, offset)? {
            0 => return Err(io::ErrorKind::WriteZero.into()),
            written => (bytes, offset) = (&bytes[written..], offset + written as u64),
        }
    }
    Ok(())
}

/// What a process locks that uses a folder: a file in it, since folders cannot be locked here.
///
/// # Errors
/// Those of the system.
pub fn to_lock(folder: &Path) -> io::Result<File> {
    File::options().create(true).truncate(false).write(true).open(folder.join("in-use.lock"))
}
