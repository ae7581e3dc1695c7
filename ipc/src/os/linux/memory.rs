//! Shared memory is reserved before it is used: a full `/dev/shm` is an error at the start, not a SIGBUS
//! later.

use crate::error::{IpcError, doing};
use rustix::fs::{FallocateFlags, fallocate};
use rustix::io::Errno;
use std::cell::RefCell;
use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

const SHM: &str = "/dev/shm";

/// Too little shared memory.
#[derive(Debug, thiserror::Error)]
#[error(
    "{SHM} has {available} bytes free, but {needed} are needed ({for_what}); give it more \
     (`docker run --shm-size={suggested}m`, `mount -o remount,size=... {SHM}`), use fewer environments, or \
     leave fields out"
)]
pub struct TooLittleMemory {
    needed: u64,
    available: u64,
    for_what: String,
    suggested: u64,
}

/// Bytes that iceoryx2 needs beside frames and requests for the ports of one process at one lane:
/// management segments and connections, one or a few pages each (measured: 30 to 60 kB). They cannot be
/// reserved, because they are created when peers come.
pub(crate) const PORTS: usize = 128 << 10;

/// Checks that `needed` bytes are free.
pub(crate) fn check_room(needed: usize, for_what: &str) -> Result<(), TooLittleMemory> {
    // Without a file system there, the creation of files will fail and say why.
    let Ok(stat) = rustix::fs::statvfs(SHM) else { return Ok(()) };
    let available = stat.f_bavail * stat.f_frsize;
    let needed = needed as u64;
    if needed <= available { Ok(()) } else { Err(too_little(needed, available, for_what)) }
}

fn too_little(needed: u64, available: u64, for_what: &str) -> TooLittleMemory {
    // Memory that others use there counts too: `size` is that of the whole file system.
    let used = rustix::fs::statvfs(SHM).map_or(0, |stat| (stat.f_blocks - stat.f_bavail) * stat.f_frsize);
    let suggested = (used + needed * 5 / 4) / (1 << 20) + 64;
    TooLittleMemory { needed, available, for_what: for_what.to_owned(), suggested }
}

/// Bytes reserved between two calls of `interrupted`: milliseconds of work.
const CHUNK: u64 = 8 << 20;

thread_local! {
    /// Large segments that this thread created, of whose pages most are not reserved.
    static UNRESERVED: RefCell<Vec<PathBuf>> = const { RefCell::new(Vec::new()) };
}

/// Leaves the pages of a new segment to [`reserve_segments`].
pub(crate) fn reserve_later(segment: &Path) {
    UNRESERVED.with_borrow_mut(|segments| segments.push(segment.to_owned()));
}

/// Has the kernel reserve every page of the segments that this thread created; `false` if `interrupted`
/// returned `true` meanwhile.
pub(crate) fn reserve_segments<E: From<TooLittleMemory> + From<IpcError>>(
    for_what: &str,
    interrupted: &mut dyn FnMut() -> bool,
) -> Result<bool, E> {
    let reserving = || doing(format!("reserving memory for {for_what}"));
    for path in UNRESERVED.take() {
        let file = match File::options().write(true).open(&path) {
            Ok(file) => file,
            Err(error) if error.kind() == ErrorKind::NotFound => continue, // of a pool that ended
            Err(error) => return Err(reserving()(error).into()),
        };
        let bytes = file.metadata().map_or(0, |m| m.len());
        let mut reserved = 0;
        while reserved < bytes {
            if interrupted() {
                return Ok(false);
            }
            let chunk = CHUNK.min(bytes - reserved);
            match fallocate(&file, FallocateFlags::empty(), reserved, chunk) {
                Ok(()) => reserved += chunk,
                Err(Errno::INTR) => {} // a signal; the kernel has undone this chunk
                Err(Errno::NOSPC) => {
                    let available = rustix::fs::statvfs(SHM).map_or(0, |s| s.f_bavail * s.f_frsize);
                    return Err(too_little(bytes, reserved + available, for_what).into());
                }
                Err(_) => break, // not every file system can
            }
        }
    }
    Ok(true)
}
