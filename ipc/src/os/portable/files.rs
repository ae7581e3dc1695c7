//! The files by which pools are found, and the lock under which they are made and removed.

use crate::name::check_name;
use crate::os::folders::private_file;
use crate::runtime_dir::RuntimeDir;
use std::fs::{File, TryLockError};
use std::io::{Error, ErrorKind, Result};
use std::path::Path;
use std::time::{Duration, Instant};

/// How long to wait for another process that makes or removes files, which takes milliseconds.
const TIMEOUT: Duration = Duration::from_secs(5);

/// The right to make and remove files of pools in a runtime folder; only one process has it at a time. Its
/// own file stays: to remove that is what it protects other files from.
pub(super) struct FilesLock(#[allow(dead_code)] File); // held, not read

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

/// `false` if another process, or another part of this one, has locked it.
pub(super) fn try_lock(file: &File) -> Result<bool> {
    match file.try_lock() {
        Ok(()) => Ok(true),
        Err(TryLockError::WouldBlock) => Ok(false),
        Err(TryLockError::Error(error)) => Err(error),
    }
}

/// Whether a file exists and is locked, by a process or by another part of this one.
pub(crate) fn is_held(lock: &Path) -> Result<bool> {
    match File::options().write(true).open(lock) {
        Ok(file) => Ok(!try_lock(&file)?),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error),
    }
}

impl RuntimeDir {
    /// Names of the pools that have a socket here, dead or alive.
    pub fn pool_names(&self) -> Vec<String> {
        self.names_of(&["sock"])
    }

    /// Names of the pools that left files here, dead or alive.
    pub(crate) fn stale_names(&self) -> Vec<String> {
        self.names_of(&["sock", "lock"])
    }

    fn names_of(&self, extensions: &[&str]) -> Vec<String> {
        let entries = std::fs::read_dir(self.root()).into_iter().flatten().flatten();
        let names = entries.filter_map(|entry| {
            let path = entry.path();
            let is_pools = extensions.contains(&path.extension()?.to_str()?);
            let name = path.file_stem()?.to_str()?;
            (is_pools && check_name(name).is_ok()).then(|| name.to_owned())
        });
        let mut names: Vec<_> = names.collect();
        names.sort();
        names.dedup();
        names
    }
}
