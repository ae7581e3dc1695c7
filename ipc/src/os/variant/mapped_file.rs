//! Shared memory of iceoryx2 as a file that is closed as soon as it is mapped. iceoryx2's own storage keeps
//! every file open, which costs a pool within a learner's process some thirty file descriptors that nothing
//! uses.
//!
//! On Linux its pages are reserved when it is created (the first of them if it is large; `memory` reserves
//! the rest), so that a full `/dev/shm` is an error and not a SIGBUS. What the system refuses is noted for
//! the error message, because iceoryx2 reports an internal error.

#![allow(unsafe_code)] // uses mapped memory, and implements unsafe functions of iceoryx2's traits

use crate::os::shortage::note;
use crate::os::storage::{self, Mapping, create_segment, discard, open_segment};
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
use std::fmt::Debug;
use std::fs::File;
use std::io::{Error, ErrorKind};
use std::marker::PhantomData;
use std::mem::MaybeUninit;
use std::path::{Path, PathBuf};
use std::ptr::NonNull;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

type Configuration<T> = <file::Storage<T> as NamedConceptMgmt>::Configuration;

/// A value in shared memory, which its creator initialises. Dropped in this order: Windows removes no file
/// that is mapped.
#[derive(Debug)]
pub struct Storage<T> {
    memory: Mapping,
    file: OwnedFile,
    name: FileName,
    _value: PhantomData<T>,
}

/// The file of a storage, which its owner removes.
#[derive(Debug)]
struct OwnedFile {
    path: PathBuf,
    is_owner: AtomicBool,
}

impl Drop for OwnedFile {
    fn drop(&mut self) {
        if *self.is_owner.get_mut() {
            discard(&self.path);
        }
    }
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

fn content<T>(memory: &Mapping) -> *mut Content<T> {
    memory.start().cast()
}

impl<T> Drop for Storage<T> {
    fn drop(&mut self) {
        if *self.file.is_owner.get_mut() {
            // SAFETY: an owner's value is initialised, and only the last owner drops it.
            unsafe { (*content::<T>(&self.memory)).value.assume_init_drop() };
        }
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
        let failed = |error| {
            note(&error);
            DynamicStorageOpenError::InternalError
        };
        let writable = mode == AccessMode::ReadWrite;
        let file = match open_segment(path, writable) {
            Ok(Some(file)) => file,
            Ok(None) => return Ok(None),
            Err(error) if error.kind() == ErrorKind::NotFound => {
                return Err(DynamicStorageOpenError::DoesNotExist);
            }
            Err(error) => return Err(failed(error)),
        };
        let bytes = file.metadata().map_err(failed)?.len() as usize;
        if bytes < size_of::<Content<T>>() {
            return Ok(None);
        }
        let memory = Mapping::new(&file, bytes, writable).map_err(failed)?;
        // SAFETY: the mapping is long enough, and page-aligned; the version is atomic in every process.
        let version = unsafe { &(*content::<T>(&memory)).version }.load(Ordering::SeqCst);
        if version == 0 {
            return Ok(None);
        }
        if version != PackageVersion::get().to_u64() {
            return Err(DynamicStorageOpenError::VersionMismatch);
        }
        Ok(Some(self.storage(memory, path, false)))
    }

    fn storage(&self, memory: Mapping, path: &Path, is_owner: bool) -> Storage<T> {
        let file = OwnedFile { path: path.to_owned(), is_owner: AtomicBool::new(is_owner) };
        Storage { memory, file, name: self.name, _value: PhantomData }
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
        let file = create_segment(&path).map_err(|error| match error.kind() {
            ErrorKind::AlreadyExists => DynamicStorageCreateError::AlreadyExists,
            ErrorKind::PermissionDenied => DynamicStorageCreateError::InsufficientPermissions,
            _ => DynamicStorageCreateError::InternalError,
        })?;
        let filled = self.fill(&file, &path);
        if filled.is_err() {
            drop(file); // Windows removes no file that is open
            discard(&path);
        }
        filled
    }

    fn fill(&mut self, file: &File, path: &Path) -> Result<Storage<T>, DynamicStorageCreateError> {
        let failed = |error: Error| {
            note(&error);
            DynamicStorageCreateError::InternalError
        };
        let bytes = size_of::<Content<T>>() + self.supplementary_size;
        storage::reserve(file, path, bytes as u64).map_err(failed)?;
        let memory = Mapping::new(file, bytes, true).map_err(failed)?;
        let content = content::<T>(&memory);
        let parts = memory.start().wrapping_add(size_of::<Content<T>>());
        let mut allocator =
            BumpAllocator::new(NonNull::new(parts).expect("an address"), self.supplementary_size);
        // SAFETY: the mapping is long enough, page-aligned and zeroed, which is a valid `Content`; no other
        // process reads the value before the version is set.
        let content = unsafe { &mut *content };
        if !self.initializer.call(&mut content.value, &mut allocator) {
            return Err(DynamicStorageCreateError::InitializationFailed);
        }
        content.version.store(PackageVersion::get().to_u64(), Ordering::SeqCst);
        storage::complete_segment(file).map_err(failed)?;
        Ok(self.storage(memory, path, self.is_owner))
    }
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
        storage::exists::<file::Storage<T>>(name, config)
    }

    fn list_cfg(config: &Configuration<T>) -> Result<Vec<FileName>, NamedConceptListError> {
        storage::list::<file::Storage<T>>(config)
    }

    unsafe fn remove_cfg(
        name: &FileName,
        config: &Configuration<T>,
    ) -> Result<bool, NamedConceptRemoveError> {
        // SAFETY: the same promise of the caller.
        unsafe { storage::remove::<file::Storage<T>>(name, config) }
    }

    fn remove_path_hint(path: &iceoryx2::prelude::Path) -> Result<(), NamedConceptPathHintRemoveError> {
        storage::remove_folder(path)
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
        self.file.is_owner.load(Ordering::Relaxed)
    }

    fn release_ownership(&self) {
        self.file.is_owner.store(false, Ordering::Relaxed);
    }

    fn acquire_ownership(&self) {
        self.file.is_owner.store(true, Ordering::Relaxed);
    }

    fn get(&self) -> &T {
        // SAFETY: whoever opened it saw its version, and whoever created it initialised it.
        unsafe { (*content::<T>(&self.memory)).value.assume_init_ref() }
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
