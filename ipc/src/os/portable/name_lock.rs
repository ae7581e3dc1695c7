//! The lock by which one process at a time has a pool's name.

use super::files::{FilesLock, try_lock};
use crate::os::folders::private_file;
use crate::process_owned::ProcessOwned;
use crate::runtime_dir::RuntimeDir;
use std::fs::File;
use std::path::PathBuf;

/// The right to a pool's name. Dropping it removes the files of the pool.
pub(crate) struct NameLock(#[allow(dead_code)] ProcessOwned<PoolFiles>);

/// The lock of a pool, which the system unlocks when its process ends; and the files, removed when dropped.
struct PoolFiles {
    lock: Option<File>,
    root: PathBuf,
    files: [PathBuf; 2],
}

impl NameLock {
    /// `None` if another process has it.
    pub(crate) fn try_take(runtime_dir: &RuntimeDir, name: &str) -> std::io::Result<Option<NameLock>> {
        let _files = FilesLock::take(runtime_dir.root())?;
        let lock = private_file(&runtime_dir.lock(name))?;
        if !try_lock(&lock)? {
            return Ok(None);
        }
        let files = [runtime_dir.socket(name), runtime_dir.lock(name)];
        let _ = std::fs::remove_file(&files[0]); // of a dead pool
        let (lock, root) = (Some(lock), runtime_dir.root().to_owned());
        Ok(Some(NameLock(ProcessOwned::new(PoolFiles { lock, root, files }))))
    }
}

impl Drop for PoolFiles {
    fn drop(&mut self) {
        // Without it, the next owner of the name finds files without a lock, and replaces them.
        let _files = FilesLock::take(&self.root);
        drop(self.lock.take()); // Windows removes no file that is open
        self.files.iter().for_each(|file| drop(std::fs::remove_file(file)));
    }
}

#[cfg(test)]
mod tests {
    use super::NameLock;
    use crate::runtime_dir::RuntimeDir;

    /// The second pool of a name waited for itself.
    #[test]
    fn a_name_is_taken_once_at_a_time() {
        let folder = tempfile::tempdir().expect("a folder");
        let runtime_dir = RuntimeDir::at(folder.path().join("pools")).expect("a runtime folder");
        let take = |name| NameLock::try_take(&runtime_dir, name).expect("files can be made");
        let first = take("one").expect("a free name");
        assert!(take("one").is_none());
        assert!(take("one").is_none(), "the attempt before freed the name");
        assert!(take("two").is_some());
        drop(first);
        assert!(take("one").is_some());
    }
}
