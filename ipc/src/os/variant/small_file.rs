//! Constant data of iceoryx2 (the configurations of services, the tags of ports) as a file that is closed
//! as soon as it is written or read, for the same reasons as in `mapped_file`.

#![allow(unsafe_code)] // implements unsafe functions of iceoryx2's traits

use super::mapped_file::path_for;
use crate::os::shortage::note;
use crate::os::storage::{self, create_small, discard, read_small, write_small};
use iceoryx2::prelude::FileName;
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable;
use iceoryx2_cal::named_concept::{
    NamedConcept, NamedConceptBuilder, NamedConceptDoesExistError, NamedConceptListError, NamedConceptMgmt,
    NamedConceptPathHintRemoveError, NamedConceptRemoveError,
};
use iceoryx2_cal::static_storage::file;
use iceoryx2_cal::static_storage::{
    StaticStorage, StaticStorageBuilder, StaticStorageCreateError, StaticStorageLocked,
    StaticStorageOpenError, StaticStorageReadError, StaticStorageUnlockError, StaticStorageView,
};
use std::fs::File;
use std::io::ErrorKind;
use std::ptr::NonNull;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

type Configuration = <file::Storage as NamedConceptMgmt>::Configuration;

/// Data that does not change.
#[derive(Debug)]
pub struct Storage {
    name: FileName,
    config: Configuration,
    is_owner: AtomicBool,
    content: Content,
}

/// What was read or written.
#[derive(Debug, Default)]
pub struct Content(Vec<u8>);

/// A file that is not written yet.
#[derive(Debug)]
pub struct Locked {
    storage: Storage,
    file: File,
}

/// The builder of a [`Storage`].
#[derive(Debug)]
pub struct Builder {
    name: FileName,
    config: Configuration,
    is_owner: bool,
}

impl Drop for Storage {
    fn drop(&mut self) {
        if *self.is_owner.get_mut() {
            discard(&path_for(&self.config, &self.name));
        }
    }
}

impl Builder {
    fn storage(self, content: Vec<u8>) -> Storage {
        let (is_owner, content) = (AtomicBool::new(self.is_owner), Content(content));
        Storage { name: self.name, config: self.config, is_owner, content }
    }
}

impl NamedConceptBuilder<Storage> for Builder {
    fn new(name: &FileName) -> Self {
        Builder { name: *name, config: Configuration::default(), is_owner: true }
    }

    fn config(self, config: &Configuration) -> Self {
        Builder { config: config.clone(), ..self }
    }
}

impl StaticStorageBuilder<Storage> for Builder {
    fn has_ownership(self, is_owner: bool) -> Self {
        Builder { is_owner, ..self }
    }

    fn create_locked(self) -> Result<Locked, StaticStorageCreateError> {
        let path = path_for(&self.config, &self.name);
        let file = create_small(&path).map_err(|error| match error.kind() {
            ErrorKind::AlreadyExists => StaticStorageCreateError::AlreadyExists,
            ErrorKind::PermissionDenied => StaticStorageCreateError::InsufficientPermissions,
            _ => StaticStorageCreateError::InternalError,
        })?;
        Ok(Locked { storage: self.storage(Vec::new()), file })
    }

    fn open(self, timeout: Duration) -> Result<Storage, StaticStorageOpenError> {
        let (path, begin) = (path_for(&self.config, &self.name), Instant::now());
        loop {
            match read_small(&path) {
                Ok(Some(content)) => return Ok(self.storage(content)),
                Ok(None) if begin.elapsed() > timeout => {
                    return Err(StaticStorageOpenError::InitializationNotYetFinalized);
                }
                Ok(None) => std::thread::sleep(Duration::from_millis(1)),
                Err(error) => {
                    note(&error);
                    return Err(match error.kind() {
                        ErrorKind::NotFound => StaticStorageOpenError::DoesNotExist,
                        ErrorKind::PermissionDenied => StaticStorageOpenError::InsufficientPermissions,
                        _ => StaticStorageOpenError::InternalError,
                    });
                }
            }
        }
    }
}

impl StaticStorageLocked<Storage> for Locked {
    fn unlock(mut self, content: &[u8]) -> Result<Storage, StaticStorageUnlockError> {
        write_small(&mut self.file, content).map_err(|error| {
            note(&error);
            match error.kind() {
                ErrorKind::StorageFull => StaticStorageUnlockError::NoSpaceLeft,
                _ => StaticStorageUnlockError::InternalError,
            }
        })?;
        self.storage.content = Content(content.to_owned());
        Ok(self.storage)
    }
}

impl StaticStorage for Storage {
    type Builder = Builder;
    type Locked = Locked;
    type View = Content;

    fn view(&self) -> &Content {
        &self.content
    }

    fn release_ownership(&self) {
        self.is_owner.store(false, Ordering::Relaxed);
    }

    fn acquire_ownership(&self) {
        self.is_owner.store(true, Ordering::Relaxed);
    }
}

impl StaticStorageView for Content {
    fn len(&self) -> u64 {
        self.0.len() as u64
    }

    fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    fn read(&self, content: &mut [u8]) -> Result<(), StaticStorageReadError> {
        let Some(content) = content.get_mut(..self.0.len()) else {
            return Err(StaticStorageReadError::BufferTooSmall);
        };
        content.copy_from_slice(&self.0);
        Ok(())
    }
}

impl StaticStorageView for Storage {
    fn len(&self) -> u64 {
        self.content.len()
    }

    fn is_empty(&self) -> bool {
        self.content.is_empty()
    }

    fn read(&self, content: &mut [u8]) -> Result<(), StaticStorageReadError> {
        self.content.read(content)
    }
}

impl NamedConcept for Storage {
    fn name(&self) -> &FileName {
        &self.name
    }
}

impl NamedConcept for Locked {
    fn name(&self) -> &FileName {
        &self.storage.name
    }
}

impl NamedConceptMgmt for Storage {
    type Configuration = Configuration;

    fn does_exist_cfg(name: &FileName, config: &Configuration) -> Result<bool, NamedConceptDoesExistError> {
        storage::small_exists::<file::Storage>(name, config)
    }

    fn list_cfg(config: &Configuration) -> Result<Vec<FileName>, NamedConceptListError> {
        storage::list::<file::Storage>(config)
    }

    unsafe fn remove_cfg(name: &FileName, config: &Configuration) -> Result<bool, NamedConceptRemoveError> {
        // SAFETY: the same promise of the caller.
        unsafe { storage::remove::<file::Storage>(name, config) }
    }

    fn remove_path_hint(path: &iceoryx2::prelude::Path) -> Result<(), NamedConceptPathHintRemoveError> {
        storage::remove_folder(path)
    }
}

// Their files stay, as after the end of their process; nothing else is to be given back.

impl Abandonable for Storage {
    unsafe fn abandon_in_place(_: NonNull<Self>) {}
}

impl Abandonable for Content {
    unsafe fn abandon_in_place(_: NonNull<Self>) {}
}

impl Abandonable for Locked {
    unsafe fn abandon_in_place(_: NonNull<Self>) {}
}
