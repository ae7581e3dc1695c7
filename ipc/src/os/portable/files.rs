//! The files by which pools are found, and the lock under which they are made and removed.

use crate::name::check_name;
use crate::os::folders::{is_private, private_file};
use crate::runtime_dir::RuntimeDir;
use std::fs::{File, Metadata, TryLockError};
use std::io::{Error, ErrorKind, Result};
use std::path::Path;
use std::time::{Duration, Instant};

/// How long to wait for another process that makes or removes files, which takes milliseconds.
const TIMEOUT: Duration = Duration::from_secs(5);

/// The right to make and remove files of pools in a runtime folder; only one process has it at a time. Its
/// own file stays: to remove that is what it protects other files from.
pub(super) struct FilesLock(File);

impl FilesLock {
    pub(super) fn take(root: &Path) -> Result<FilesLock> {
        let path = root.join("lock");
        let file = private_file(&path)?;
        let begin = Instant::now();
        while !try_lock(&file)? {
            if begin.elapsed() > TIMEOUT {
                let locked =
                    format!("{}: another process has held it locked for {TIMEOUT:?}", path.display());
                return Err(Error::new(ErrorKind::TimedOut, locked));
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        Ok(FilesLock(file))
    }
}

impl Drop for FilesLock {
    /// Closing it is not enough: a child that another thread has forked meanwhile holds a copy.
    fn drop(&mut self) {
        let _ = self.0.unlock(); // Wine says that it could not, and could
    }
}

/// `false` if another process, or another part of this one, has locked it.
pub(super) fn try_lock(file: &File) -> Result<bool> {
    match file.try_lock() {
        Ok(()) => Ok(true),
        Err(TryLockError::WouldBlock) => Ok(false),
        Err(TryLockError::Error(error)) => Err(error),
    }
}

/// As [`try_lock`], but unlocks it again, also for a child that another thread has forked meanwhile. To be
/// called under the lock of the files: others would take it for locked.
pub(super) fn is_free(file: &File) -> Result<bool> {
    let is_free = try_lock(file)?;
    if is_free {
        let _ = file.unlock(); // as above
    }
    Ok(is_free)
}

/// Whether a file exists and is locked, by a process or by another part of this one. To be called under the
/// lock of the files, too.
pub(super) fn is_held(lock: &Path) -> Result<bool> {
    match File::options().write(true).open(lock) {
        Ok(file) => Ok(!is_free(&file)?),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error),
    }
}

impl RuntimeDir {
    /// Names of the pools that have a socket here, dead or alive.
    pub fn pool_names(&self) -> Vec<String> {
        self.names_of("sock", |_| true)
    }

    /// Names of the pools that left files here, dead or alive. The lock, which is made first and removed
    /// last, is private and empty; other files with such names are not ours.
    pub(crate) fn stale_names(&self) -> Vec<String> {
        self.names_of("lock", |file| file.is_file() && file.len() == 0 && is_private(file))
    }

    fn names_of(&self, extension: &str, is_pools: impl Fn(&Metadata) -> bool) -> Vec<String> {
        let entries = std::fs::read_dir(self.root()).into_iter().flatten().flatten();
        let entries = entries.filter(|entry| entry.metadata().is_ok_and(|file| is_pools(&file)));
        let names = entries.filter_map(|entry| {
            let path = entry.path();
            let name = path.file_stem()?.to_str()?;
            (path.extension()? == extension && check_name(name).is_ok()).then(|| name.to_owned())
        });
        let mut names: Vec<_> = names.collect();
        names.sort();
        names.dedup();
        names
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A child that was forked while another thread held the lock kept it, and no process could connect to a
    /// pool or start one until the child ended.
    #[test]
    fn a_copy_in_a_forked_child_holds_no_lock() {
        let folder = tempfile::tempdir().expect("a folder");
        let lock = FilesLock::take(folder.path()).expect("a lock");
        let _childs = lock.0.try_clone().expect("a copy");
        drop(lock);
        drop(FilesLock::take(folder.path()).expect("it is free"));
        let path = folder.path().join("train.lock");
        let file = private_file(&path).expect("a file");
        let _childs = file.try_clone().expect("a copy");
        assert!(is_free(&file).expect("a file"));
        assert!(!is_held(&path).expect("a file"));
    }

    /// `clean` in a folder with other programs' locks removed them.
    #[test]
    fn locks_of_other_programs_are_not_those_of_pools() {
        let folder = tempfile::tempdir().expect("a folder");
        let runtime_dir = RuntimeDir::at(folder.path().to_owned()).expect("a private folder");
        for (name, content) in [("Cargo.lock", "kept"), ("notes.sock", "kept"), ("other.lock", "")] {
            std::fs::write(folder.path().join(name), content).expect("a file");
        }
        drop(private_file(&runtime_dir.lock("train")).expect("a file"));
        let expected = if cfg!(unix) { &["train"][..] } else { &["other", "train"] };
        assert_eq!(runtime_dir.stale_names(), expected);
    }
}
