//! The folder of iceoryx2's files, in the runtime folder. Every process that uses iceoryx2 holds a shared
//! lock; the last one to release it removes the folder, and the first one what killed processes left there.

use super::files::{FilesLock, is_free, is_held};
use crate::os::folders::private_file;
use crate::process_owned::ProcessOwned;
use crate::runtime_dir::RuntimeDir;
use std::fs::{File, TryLockError};
use std::io::{Error, ErrorKind, Result};
use std::path::{Path, PathBuf};

/// No name that a folder of the user would have: what is in it is removed.
const FOLDER: &str = "smaclite-shm";
const LOCK_NAME: &str = "in-use";

/// Held for as long as this process uses iceoryx2.
pub(crate) struct ShmDir {
    usage: ProcessOwned<Usage>,
}

/// The shared lock, and what the last process removes. A forked child shares its parent's lock.
struct Usage {
    lock: File,
    root: PathBuf,
    folder: PathBuf,
}

impl RuntimeDir {
    pub(crate) fn open_shm_dir(&self) -> Result<ShmDir> {
        let _files = FilesLock::take(self.root())?;
        let (path, folder) = (self.root().join(LOCK_NAME), self.root().join(FOLDER));
        if is_free(&private_file(&path)?)? {
            remove_folder(&folder)?;
            std::fs::create_dir(&folder)?;
        }
        let lock = private_file(&path)?;
        match lock.try_lock_shared() {
            Ok(()) => {}
            Err(TryLockError::Error(error)) => return Err(error),
            Err(TryLockError::WouldBlock) => return Err(ErrorKind::WouldBlock.into()), // locked by no pool
        }
        let usage = Usage { lock, root: self.root().to_owned(), folder };
        Ok(ShmDir { usage: ProcessOwned::new(usage) })
    }

    /// Removes what pools left, unless a process uses the folder.
    pub(crate) fn remove_stale(&self) -> Result<()> {
        let _files = FilesLock::take(self.root())?;
        remove_unused(self.root())
    }

    /// The folder of the files of the running pools; `None` while there is none.
    pub fn shm_dir(&self) -> Option<PathBuf> {
        Some(self.root().join(FOLDER)).filter(|folder| folder.exists())
    }

    pub(crate) fn unused_shm_dirs(&self) -> Vec<PathBuf> {
        // Who starts to use the folder meanwhile would take this look for the lock of a process.
        let _files = FilesLock::take(self.root());
        if is_held(&self.root().join(LOCK_NAME)).unwrap_or(true) { Vec::new() } else { self.shm_dirs() }
    }

    pub(crate) fn shm_dirs(&self) -> Vec<PathBuf> {
        self.shm_dir().into_iter().collect()
    }
}

/// Under the lock of the files: if no process uses the folder, removes it and its lock.
fn remove_unused(root: &Path) -> Result<()> {
    let lock = root.join(LOCK_NAME);
    if is_held(&lock)? {
        return Ok(());
    }
    remove_folder(&root.join(FOLDER))?;
    match std::fs::remove_file(lock) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

fn remove_folder(folder: &Path) -> Result<()> {
    match std::fs::remove_dir_all(folder) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            Err(Error::new(error.kind(), format!("{}: {error}", folder.display())))
        }
        _ => Ok(()),
    }
}

impl ShmDir {
    /// The folder of iceoryx2's files.
    pub(crate) fn folder(&self) -> &Path {
        &self.usage.folder
    }

    pub(crate) fn check_segments(&self) -> Result<()> {
        Ok(())
    }

    pub(crate) fn complete_dead_nodes(&self, _own: u128) {}

    /// Gives up the files, also if something of them is still used.
    pub(crate) fn end(&self) {
        if self.usage.check().is_ok() {
            self.usage.end();
        }
    }
}

impl Usage {
    fn end(&self) {
        // What cannot be removed is removed by the next process that makes a pool here.
        let _files = FilesLock::take(&self.root);
        let _ = self.lock.unlock(); // Wine says that it could not, and could
        let _ = remove_unused(&self.root);
    }
}

impl Drop for Usage {
    fn drop(&mut self) {
        self.end();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicBool, Ordering};

    fn runtime_dir() -> (tempfile::TempDir, RuntimeDir) {
        let folder = tempfile::tempdir().expect("a folder");
        let runtime_dir = RuntimeDir::at(folder.path().to_owned()).expect("a private folder");
        (folder, runtime_dir)
    }

    /// The start of a pool failed while another process counted left-over files.
    #[test]
    fn who_looks_for_unused_folders_disturbs_nobody() {
        let (_folder, runtime_dir) = runtime_dir();
        let has_ended = AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !has_ended.load(Ordering::Relaxed) {
                    runtime_dir.unused_shm_dirs();
                }
            });
            let open = |_| runtime_dir.open_shm_dir().map(|opened| opened.folder().exists());
            let opened: Vec<_> = (0..500).map(open).collect();
            has_ended.store(true, Ordering::Relaxed);
            opened.into_iter().for_each(|opened| assert!(opened.expect("it is free"), "it has no folder"));
        });
    }

    /// A folder `shm` of the user in the root folder was removed with its files.
    #[test]
    fn only_files_of_iceoryx_are_removed() {
        let (folder, runtime_dir) = runtime_dir();
        let mine = folder.path().join("shm").join("thesis.tex");
        std::fs::create_dir(mine.parent().expect("a folder")).expect("a folder");
        std::fs::write(&mine, "kept").expect("a file");
        let [first, second] = [(); 2].map(|()| runtime_dir.open_shm_dir().expect("a folder"));
        std::fs::write(first.folder().join("1.data"), "left").expect("a file");
        drop(first);
        assert!(second.folder().join("1.data").exists());
        drop(second);
        assert!(mine.exists() && runtime_dir.shm_dir().is_none());
    }
}
