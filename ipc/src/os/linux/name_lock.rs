//! The lock by which one process at a time has a pool's name.

use super::NotInherited;
use super::files::is_file_at;
use crate::os::folders::private_file;
use crate::process_owned::ProcessOwned;
use crate::runtime_dir::RuntimeDir;
use rustix::fs::{FlockOperation, flock};
use std::fs::File;
use std::path::PathBuf;

/// The right to a pool's name. Dropping it removes the files of the pool, then unlocks the name.
pub(crate) struct NameLock {
    _files: ProcessOwned<PoolFiles>,
    _not_inherited: NotInherited,
    _lock: File,
}

/// The socket and the lock of a pool; removed when dropped.
struct PoolFiles([PathBuf; 2]);

impl NameLock {
    /// `None` if another process has it.
    pub(crate) fn try_take(runtime_dir: &RuntimeDir, name: &str) -> std::io::Result<Option<NameLock>> {
        let path = runtime_dir.lock(name);
        loop {
            let lock = private_file(&path)?;
            if flock(&lock, FlockOperation::NonBlockingLockExclusive).is_err() {
                return Ok(None);
            }
            if is_file_at(&lock, &path) {
                let files = PoolFiles([runtime_dir.socket(name), path]);
                let (_files, _not_inherited) = (ProcessOwned::new(files), NotInherited::new(&lock));
                return Ok(Some(NameLock { _files, _not_inherited, _lock: lock }));
            }
        }
    }
}

impl Drop for PoolFiles {
    fn drop(&mut self) {
        self.0.iter().for_each(|file| drop(std::fs::remove_file(file)));
    }
}
