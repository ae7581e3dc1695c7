//! What the storages of iceoryx2's services need of Linux. A file gets its final mode when it is complete,
//! and iceoryx2 itself lists and removes files.

#![allow(unsafe_code)] // maps memory

use crate::os::files::PRIVATE;
use crate::os::memory::reserve_later;
use crate::os::shortage::note;
use iceoryx2::prelude::{FileName, Path as FolderPath, Service, ipc_threadsafe};
use iceoryx2_bb_lock_free::mpmc::counting_bit_set::RelocatableCountingBitSet;
use iceoryx2_cal::event::trigger::{State, unix_datagram_socket::GenericUnixDatagramSocketTrigger};
use iceoryx2_cal::named_concept::{
    NamedConceptDoesExistError, NamedConceptListError, NamedConceptMgmt, NamedConceptPathHintRemoveError,
    NamedConceptRemoveError,
};
use rustix::fs::{FallocateFlags, Mode, OFlags, fallocate, fchmod, ftruncate};
use rustix::io::Errno;
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use std::fs::{File, Permissions};
use std::io::{Read, Result, Write};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::Path;
use std::ptr::NonNull;

pub(crate) type Monitoring = <ipc_threadsafe::Service as Service>::Monitoring;
pub(crate) type Event = GenericUnixDatagramSocketTrigger<
    RelocatableCountingBitSet,
    crate::os::variant::Storage<State<RelocatableCountingBitSet, ()>>,
>;

/// Bytes that are reserved at the creation, which must not take long: milliseconds.
const RESERVED_AT_ONCE: u64 = 8 << 20;

/// The mode of a segment that is being initialised; then it is [`PRIVATE`].
const UNFINISHED_SEGMENT: Mode = Mode::WUSR;

/// The modes of a small file that is being written, and of one that is complete, which are iceoryx2's: it
/// lists files by them.
const UNFINISHED: u32 = 0o600;
const COMPLETE: u32 = 0o400;

/// Shared memory of this process.
#[derive(Debug)]
pub(crate) struct Mapping {
    start: NonNull<u8>,
    bytes: usize,
}

impl Mapping {
    pub(crate) fn new(file: &File, bytes: usize, writable: bool) -> Result<Mapping> {
        let protection = if writable { ProtFlags::READ | ProtFlags::WRITE } else { ProtFlags::READ };
        // SAFETY: a new mapping, at an address that the kernel chooses, is memory that nothing else uses.
        let start = unsafe { mmap(std::ptr::null_mut(), bytes, protection, MapFlags::SHARED, file, 0) }?;
        Ok(Mapping { start: NonNull::new(start.cast()).ok_or(Errno::NOMEM)?, bytes })
    }

    #[inline]
    pub(crate) fn start(&self) -> *mut u8 {
        self.start.as_ptr()
    }
}

impl Drop for Mapping {
    fn drop(&mut self) {
        // SAFETY: the mapping of `new`; who borrowed its memory borrowed this.
        let unmapped = unsafe { munmap(self.start.as_ptr().cast(), self.bytes) };
        debug_assert!(unmapped.is_ok());
    }
}

/// A new file for a segment.
pub(crate) fn create_segment(path: &Path) -> Result<File> {
    create_exclusive(path, UNFINISHED_SEGMENT)
}

/// The file of a segment; `None` if it is being made.
pub(crate) fn open_segment(path: &Path, writable: bool) -> Result<Option<File>> {
    let flags = if writable { OFlags::RDWR } else { OFlags::RDONLY };
    match rustix::fs::open(path, flags | OFlags::CLOEXEC | OFlags::NOFOLLOW, Mode::empty()) {
        Ok(file) => Ok(Some(file.into())),
        Err(Errno::ACCESS) => Ok(None), // its mode is not the final one yet
        Err(errno) => Err(errno.into()),
    }
}

/// Gives a new segment its size, and reserves its pages.
pub(crate) fn reserve(file: &File, path: &Path, bytes: u64) -> Result<()> {
    ftruncate(file, bytes)?;
    loop {
        match fallocate(file, FallocateFlags::empty(), 0, RESERVED_AT_ONCE.min(bytes)) {
            Ok(()) | Err(Errno::OPNOTSUPP) => break,
            Err(Errno::INTR) => {} // a signal; the kernel has undone it
            Err(errno) => return Err(errno.into()),
        }
    }
    if bytes > RESERVED_AT_ONCE {
        reserve_later(path);
    }
    Ok(())
}

/// Lets others open a segment.
pub(crate) fn complete_segment(file: &File) -> Result<()> {
    Ok(fchmod(file, Mode::from_raw_mode(PRIVATE))?)
}

/// A new small file.
pub(crate) fn create_small(path: &Path) -> Result<File> {
    create_exclusive(path, Mode::from_raw_mode(UNFINISHED))
}

/// Writes all of a small file, and lets others read it.
pub(crate) fn write_small(file: &mut File, content: &[u8]) -> Result<()> {
    file.write_all(content)?;
    file.set_permissions(Permissions::from_mode(COMPLETE))
}

/// The content of a small file, if it is complete.
pub(crate) fn read_small(path: &Path) -> Result<Option<Vec<u8>>> {
    let mut file = File::open(path)?;
    if file.metadata()?.mode() & 0o777 == UNFINISHED {
        return Ok(None);
    }
    let mut content = Vec::new();
    file.read_to_end(&mut content)?;
    Ok(Some(content))
}

/// A new file, and its folder if there is none.
fn create_exclusive(path: &Path, mode: Mode) -> Result<File> {
    use std::os::unix::fs::DirBuilderExt;
    let flags = OFlags::CREATE | OFlags::EXCL | OFlags::RDWR | OFlags::CLOEXEC | OFlags::NOFOLLOW;
    let create = || Ok(rustix::fs::open(path, flags, mode)?.into());
    let created = create().or_else(|error: std::io::Error| match path.parent() {
        Some(folder) if error.kind() == std::io::ErrorKind::NotFound => {
            std::fs::DirBuilder::new().recursive(true).mode(0o700).create(folder)?;
            create()
        }
        _ => Err(error),
    });
    created.inspect_err(note)
}

/// Removes a file that no process needs any more.
pub(crate) fn discard(path: &Path) {
    let _ = std::fs::remove_file(path);
}

pub(crate) fn exists<S: NamedConceptMgmt>(
    name: &FileName,
    config: &S::Configuration,
) -> std::result::Result<bool, NamedConceptDoesExistError> {
    S::does_exist_cfg(name, config)
}

pub(crate) use exists as small_exists;

pub(crate) fn list<S: NamedConceptMgmt>(
    config: &S::Configuration,
) -> std::result::Result<Vec<FileName>, NamedConceptListError> {
    S::list_cfg(config)
}

/// # Safety
///
/// As [`NamedConceptMgmt::remove_cfg`].
pub(crate) unsafe fn remove<S: NamedConceptMgmt>(
    name: &FileName,
    config: &S::Configuration,
) -> std::result::Result<bool, NamedConceptRemoveError> {
    // SAFETY: the same promise of the caller.
    unsafe { S::remove_cfg(name, config) }
}

pub(crate) fn remove_folder(folder: &FolderPath) -> std::result::Result<(), NamedConceptPathHintRemoveError> {
    iceoryx2_cal::static_storage::file::Storage::remove_path_hint(folder)
}
