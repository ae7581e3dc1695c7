//! Shared memory of iceoryx2 as a file that is closed as soon as it is mapped. iceoryx2's own storage keeps
//! every file open, which costs a pool within a learner's process some thirty file descriptors that nothing
//! uses.
//!
//! Its pages are reserved when it is created (the first of them if it is large; `memory` reserves the
//! rest), so that a full `/dev/shm` is an error and not a SIGBUS. What the kernel refuses is noted for the
//! error message, because iceoryx2 reports an internal error.

#![allow(unsafe_code)] // maps memory, and implements unsafe functions of iceoryx2's traits

use crate::os::memory::reserve_later;
use crate::os::shortage::note;
use iceoryx2::prelude::{FileName, ZeroCopySend};
use iceoryx2_bb_elementary::bump_allocator::BumpAllocator;
use iceoryx2_bb_elementary::package_version::PackageVersion;
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable;
use iceoryx2_bb_posix::access_mode::AccessMode;
use iceoryx2_cal::dynamic_storage::file;
use iceoryx2_cal::dynamic_storage::{
    DynamicStorage, DynamicStorageBuilder, DynamicStorageCreateError, DynamicStorageOpenError,
    DynamicStorageOpenOrCreateError, Initializer,
};
use iceoryx2_cal::named_concept::{
    NamedConcept, NamedConceptBuilder, NamedConceptConfiguration, NamedConceptDoesExistError,
    NamedConceptListError, NamedConceptMgmt, NamedConceptPathHintRemoveError, NamedConceptRemoveError,
};
use rustix::fs::{FallocateFlags, Mode, OFlags, fallocate, fchmod, fstat, ftruncate};
use rustix::io::Errno;
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use std::fmt::Debug;
use std::marker::PhantomData;
use std::mem::MaybeUninit;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::ptr::NonNull;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

type Configuration<T> = <file::Storage<T> as NamedConceptMgmt>::Configuration;

/// Bytes that are reserved at the creation, which must not take long: milliseconds.
const RESERVED_AT_ONCE: u64 = 8 << 20;

/// The mode of a file that is being initialised; then it is [`PRIVATE`](crate::os::files::PRIVATE).
const UNFINISHED: Mode = Mode::WUSR;

/// A value in shared memory, which its creator initialises.
#[derive(Debug)]
pub struct Storage<T> {
    memory: Mapping,
    name: FileName,
    path: PathBuf,
    is_owner: AtomicBool,
    _value: PhantomData<T>,
}

// SAFETY: as iceoryx2's own storage: `get` shares the value, which is `Sync`, and the last owner drops it.
unsafe impl<T: Send + Sync> Send for Storage<T> {}
// SAFETY: as above.
unsafe impl<T: Send + Sync> Sync for Storage<T> {}

/// What the file begins with; memory for parts of the value follows.
#[repr(C)]
struct Content<T> {
    /// Of iceoryx2; 0 until the value is initialised.
    version: AtomicU64,
    value: MaybeUninit<T>,
}

/// Shared memory of this process.
#[derive(Debug)]
struct Mapping {
    start: NonNull<u8>,
    bytes: usize,
}

impl Mapping {
    fn new(file: &OwnedFd, bytes: usize, protection: ProtFlags) -> Result<Mapping, Errno> {
        // SAFETY: a new mapping, at an address that the kernel chooses, is memory that nothing else uses.
        let start = unsafe { mmap(std::ptr::null_mut(), bytes, protection, MapFlags::SHARED, file, 0) }?;
        Ok(Mapping { start: NonNull::new(start.cast()).ok_or(Errno::NOMEM)?, bytes })
    }

    fn content<T>(&self) -> *mut Content<T> {
        self.start.as_ptr().cast()
    }
}

impl Drop for Mapping {
    fn drop(&mut self) {
        // SAFETY: the mapping of `new`; who borrowed its memory borrowed this.
        let unmapped = unsafe { munmap(self.start.as_ptr().cast(), self.bytes) };
        debug_assert!(unmapped.is_ok());
    }
}

impl<T> Storage<T> {
    fn release(&mut self) {
        if *self.is_owner.get_mut() {
            // SAFETY: an owner's value is initialised, and only the last owner drops it.
            unsafe { (*self.memory.content::<T>()).value.assume_init_drop() };
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

impl<T> Drop for Storage<T> {
    fn drop(&mut self) {
        self.release();
    }
}

/// The builder of a [`Storage`].
#[derive(Debug)]
pub struct Builder<'builder, T: Send + Sync + Debug + ZeroCopySend> {
    name: FileName,
    config: Configuration<T>,
    supplementary_size: usize,
    is_owner: bool,
    timeout: Duration,
    initializer: Initializer<'builder, T>,
}

impl<T: Send + Sync + Debug + ZeroCopySend> Builder<'_, T> {
    fn path(&self) -> PathBuf {
        path_for(&self.config, &self.name)
    }

    /// The storage, if it is initialised.
    fn try_open(&self, path: &Path, mode: AccessMode) -> Result<Option<Storage<T>>, DynamicStorageOpenError> {
        let (flags, protection) = match mode {
            AccessMode::ReadWrite => (OFlags::RDWR, ProtFlags::READ | ProtFlags::WRITE),
            _ => (OFlags::RDONLY, ProtFlags::READ),
        };
        let failed = |errno| {
            note(errno);
            DynamicStorageOpenError::InternalError
        };
        let file = match rustix::fs::open(path, flags | OFlags::CLOEXEC | OFlags::NOFOLLOW, Mode::empty()) {
            Ok(file) => file,
            Err(Errno::NOENT) => return Err(DynamicStorageOpenError::DoesNotExist),
            Err(Errno::ACCESS) => return Ok(None), // its mode is not the final one yet
            Err(errno) => return Err(failed(errno)),
        };
        let bytes = fstat(&file).map_err(failed)?.st_size as usize;
        if bytes < size_of::<Content<T>>() {
            return Ok(None);
        }
        let memory = Mapping::new(&file, bytes, protection).map_err(failed)?;
        // SAFETY: the mapping is long enough, and page-aligned; the version is atomic in every process.
        let version = unsafe { &(*memory.content::<T>()).version }.load(Ordering::SeqCst);
        if version == 0 {
            return Ok(None);
        }
        if version != PackageVersion::get().to_u64() {
            return Err(DynamicStorageOpenError::VersionMismatch);
        }
        let (name, path) = (self.name, path.to_owned());
        Ok(Some(Storage { memory, name, path, is_owner: AtomicBool::new(false), _value: PhantomData }))
    }

    fn open_existing(&self, mode: AccessMode) -> Result<Storage<T>, DynamicStorageOpenError> {
        let (path, begin) = (self.path(), Instant::now());
        loop {
            match self.try_open(&path, mode)? {
                Some(storage) => return Ok(storage),
                None if begin.elapsed() >= self.timeout => {
                    return Err(DynamicStorageOpenError::InitializationNotYetFinalized);
                }
                None => std::thread::sleep(Duration::from_millis(1)),
            }
        }
    }

    fn create_new(&mut self) -> Result<Storage<T>, DynamicStorageCreateError> {
        let path = self.path();
        let file = create_exclusive(&path, UNFINISHED).map_err(|errno| match errno {
            Errno::EXIST => DynamicStorageCreateError::AlreadyExists,
            Errno::ACCESS => DynamicStorageCreateError::InsufficientPermissions,
            _ => DynamicStorageCreateError::InternalError,
        })?;
        let filled = self.fill(&file, &path);
        if filled.is_err() {
            let _ = std::fs::remove_file(&path);
        }
        filled
    }

    fn fill(&mut self, file: &OwnedFd, path: &Path) -> Result<Storage<T>, DynamicStorageCreateError> {
        let failed = |errno| {
            note(errno);
            DynamicStorageCreateError::InternalError
        };
        let bytes = size_of::<Content<T>>() + self.supplementary_size;
        ftruncate(file, bytes as u64).map_err(failed)?;
        match fallocate(file, FallocateFlags::empty(), 0, RESERVED_AT_ONCE.min(bytes as u64)) {
            Ok(()) | Err(Errno::OPNOTSUPP) => {}
            Err(Errno::INTR) => return self.fill(file, path), // a signal; the kernel has undone it
            Err(errno) => return Err(failed(errno)),
        }
        if bytes as u64 > RESERVED_AT_ONCE {
            reserve_later(path);
        }
        let memory = Mapping::new(file, bytes, ProtFlags::READ | ProtFlags::WRITE).map_err(failed)?;
        let content = memory.content::<T>();
        let parts = memory.start.as_ptr().wrapping_add(size_of::<Content<T>>());
        let mut allocator =
            BumpAllocator::new(NonNull::new(parts).expect("an address"), self.supplementary_size);
        // SAFETY: the mapping is long enough, page-aligned and zeroed, which is a valid `Content`; no other
        // process reads the value before the version is set.
        let content = unsafe { &mut *content };
        if !self.initializer.call(&mut content.value, &mut allocator) {
            return Err(DynamicStorageCreateError::InitializationFailed);
        }
        content.version.store(PackageVersion::get().to_u64(), Ordering::SeqCst);
        fchmod(file, Mode::from_raw_mode(crate::os::files::PRIVATE)).map_err(failed)?;
        let (name, path, is_owner) = (self.name, path.to_owned(), AtomicBool::new(self.is_owner));
        Ok(Storage { memory, name, path, is_owner, _value: PhantomData })
    }
}

/// A new file, and its folder if there is none.
pub(super) fn create_exclusive(path: &Path, mode: Mode) -> Result<OwnedFd, Errno> {
    use std::os::unix::fs::DirBuilderExt;
    let flags = OFlags::CREATE | OFlags::EXCL | OFlags::RDWR | OFlags::CLOEXEC | OFlags::NOFOLLOW;
    let create = || rustix::fs::open(path, flags, mode);
    let created = create().or_else(|errno| match path.parent() {
        Some(folder) if errno == Errno::NOENT => {
            let made = std::fs::DirBuilder::new().recursive(true).mode(0o700).create(folder);
            made.map_err(|error| Errno::from_io_error(&error).unwrap_or(Errno::IO))?;
            create()
        }
        _ => Err(errno),
    });
    created.inspect_err(|errno| note(*errno))
}

pub(super) fn path_for(config: &impl NamedConceptConfiguration, name: &FileName) -> PathBuf {
    PathBuf::from(config.path_for(name).to_string())
}

impl<T: Send + Sync + Debug + ZeroCopySend> NamedConceptBuilder<Storage<T>> for Builder<'_, T> {
    fn new(name: &FileName) -> Self {
        let (config, initializer) = (Configuration::default(), Initializer::new(|_, _| false));
        let (supplementary_size, timeout) = (0, Duration::ZERO);
        Builder { name: *name, config, supplementary_size, is_owner: true, timeout, initializer }
    }

    fn config(self, config: &Configuration<T>) -> Self {
        Builder { config: config.clone(), ..self }
    }
}

impl<'builder, T: Send + Sync + Debug + ZeroCopySend> DynamicStorageBuilder<'builder, T, Storage<T>>
    for Builder<'builder, T>
{
    fn has_ownership(self, is_owner: bool) -> Self {
        Builder { is_owner, ..self }
    }

    /// Ignored: no other user can enter the folder.
    fn enable_global_access(self, _: bool) -> Self {
        self
    }

    fn supplementary_size(self, supplementary_size: usize) -> Self {
        Builder { supplementary_size, ..self }
    }

    fn timeout(self, timeout: Duration) -> Self {
        Builder { timeout, ..self }
    }

    fn initializer<F: FnMut(&mut MaybeUninit<T>, &mut BumpAllocator) -> bool + 'builder>(
        self,
        initializer: F,
    ) -> Self {
        Builder { initializer: Initializer::new(initializer), ..self }
    }

    fn create(mut self) -> Result<Storage<T>, DynamicStorageCreateError> {
        self.create_new()
    }

    fn open(self, mode: AccessMode) -> Result<Storage<T>, DynamicStorageOpenError> {
        self.open_existing(mode)
    }

    fn open_or_create(mut self) -> Result<Storage<T>, DynamicStorageOpenOrCreateError> {
        loop {
            match self.open_existing(AccessMode::ReadWrite) {
                Err(DynamicStorageOpenError::DoesNotExist) => {}
                opened => return Ok(opened?),
            }
            match self.create_new() {
                Err(DynamicStorageCreateError::AlreadyExists) => {}
                created => return Ok(created?),
            }
        }
    }
}

impl<T: Send + Sync + Debug + ZeroCopySend> NamedConcept for Storage<T> {
    fn name(&self) -> &FileName {
        &self.name
    }
}

impl<T: Send + Sync + Debug + ZeroCopySend> NamedConceptMgmt for Storage<T> {
    type Configuration = Configuration<T>;

    fn does_exist_cfg(
        name: &FileName,
        config: &Configuration<T>,
    ) -> Result<bool, NamedConceptDoesExistError> {
        file::Storage::<T>::does_exist_cfg(name, config)
    }

    fn list_cfg(config: &Configuration<T>) -> Result<Vec<FileName>, NamedConceptListError> {
        file::Storage::<T>::list_cfg(config)
    }

    unsafe fn remove_cfg(
        name: &FileName,
        config: &Configuration<T>,
    ) -> Result<bool, NamedConceptRemoveError> {
        // SAFETY: the same promise of the caller.
        unsafe { file::Storage::<T>::remove_cfg(name, config) }
    }

    fn remove_path_hint(path: &iceoryx2::prelude::Path) -> Result<(), NamedConceptPathHintRemoveError> {
        file::Storage::<T>::remove_path_hint(path)
    }
}

impl<T: Send + Sync + Debug + ZeroCopySend> Abandonable for Storage<T> {
    unsafe fn abandon_in_place(mut this: NonNull<Self>) {
        // SAFETY: the caller does not use the storage again. Its file stays, as after the end of its process.
        unsafe { std::ptr::drop_in_place(&raw mut this.as_mut().memory) }
    }
}

impl<T: Send + Sync + Debug + ZeroCopySend> DynamicStorage<T> for Storage<T> {
    type Builder<'builder> = Builder<'builder, T>;

    fn does_support_persistency() -> bool {
        true
    }

    fn has_ownership(&self) -> bool {
        self.is_owner.load(Ordering::Relaxed)
    }

    fn release_ownership(&self) {
        self.is_owner.store(false, Ordering::Relaxed);
    }

    fn acquire_ownership(&self) {
        self.is_owner.store(true, Ordering::Relaxed);
    }

    fn get(&self) -> &T {
        // SAFETY: whoever opened it saw its version, and whoever created it initialised it.
        unsafe { (*self.memory.content::<T>()).value.assume_init_ref() }
    }

    unsafe fn __internal_set_type_name_in_config(config: &mut Configuration<T>, type_name: &str) {
        // SAFETY: the same promise of the caller.
        unsafe { file::Storage::<T>::__internal_set_type_name_in_config(config, type_name) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use iceoryx2::prelude::{Path as IceoryxPath, SemanticString};

    fn builder<'a>(folder: &Path) -> Builder<'a, u64> {
        let path = IceoryxPath::new(folder.as_os_str().as_encoded_bytes()).expect("a path");
        let config = Configuration::<u64>::default().path_hint(&path);
        Builder::new(&FileName::new(b"number").expect("a name")).config(&config)
    }

    #[test]
    fn a_value_is_shared_and_its_owner_removes_the_file() {
        let folder = tempfile::tempdir_in("/dev/shm").expect("a folder");
        assert!(matches!(
            builder(folder.path()).open(AccessMode::ReadWrite),
            Err(DynamicStorageOpenError::DoesNotExist)
        ));
        let set = |value: &mut MaybeUninit<u64>, _: &mut BumpAllocator| {
            value.write(7);
            true
        };
        let created = builder(folder.path()).initializer(set).create().expect("a storage");
        let opened = builder(folder.path()).open(AccessMode::ReadWrite).expect("the same one");
        assert_eq!((created.get(), opened.get()), (&7, &7));
        assert!(matches!(
            builder(folder.path()).initializer(set).create(),
            Err(DynamicStorageCreateError::AlreadyExists)
        ));
        drop(opened);
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 1);
        drop(created);
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0);
    }

    /// A process that was killed while it created a file must not block those that open it.
    #[test]
    fn a_file_that_is_never_finished_is_not_waited_for_beyond_the_timeout() {
        let folder = tempfile::tempdir_in("/dev/shm").expect("a folder");
        let path = builder(folder.path()).path();
        for content in [&[][..], &[0; 64]] {
            std::fs::write(&path, content).expect("a file");
            let opened = builder(folder.path()).timeout(Duration::from_millis(5)).open(AccessMode::Read);
            assert!(matches!(opened, Err(DynamicStorageOpenError::InitializationNotYetFinalized)));
        }
        std::fs::write(&path, [1; 64]).expect("a file");
        let opened = builder(folder.path()).open(AccessMode::Read);
        assert!(matches!(opened, Err(DynamicStorageOpenError::VersionMismatch)));
        std::fs::remove_file(path).expect("the file");
    }

    #[test]
    fn a_value_that_cannot_be_initialised_leaves_no_file() {
        let folder = tempfile::tempdir_in("/dev/shm").expect("a folder");
        let created = builder(folder.path()).initializer(|_, _| false).create();
        assert!(matches!(created, Err(DynamicStorageCreateError::InitializationFailed)));
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0);
    }
}
