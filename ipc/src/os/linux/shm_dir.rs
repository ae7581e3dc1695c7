//! The folder in `/dev/shm` that contains all files of iceoryx2. Every process with an iceoryx2 node holds a
//! shared lock, and the last one to release it removes the folder.
//!
//! The folder has mode 0700, so other users can neither list nor open its files. Its name ends with a random
//! suffix, so that they cannot create it beforehand; the suffix is the content of the locked file.

use super::files::{is_file_at, owner_and_mode};
use crate::os::folders::private_file;
use crate::process_owned::ProcessOwned;
use crate::runtime_dir::RuntimeDir;
use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;
use rustix::rand::{GetRandomFlags, getrandom};
use std::fs::{DirBuilder, File};
use std::io::{Error, ErrorKind, Result};
use std::os::unix::fs::{DirBuilderExt, FileExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// The file that every process locks that uses iceoryx2 here; its content is the suffix.
const LOCK_NAME: &str = "in-use";

/// Characters of a suffix, each of 32 different ones.
const SUFFIX_LEN: usize = 16;
const SUFFIX_LETTERS: &[u8; 32] = b"abcdefghijklmnopqrstuvwxyz234567";

/// The file system of shared memory.
const SHM: &str = "/dev/shm";

/// How long to wait for another process that cleans up, which takes milliseconds.
const CLEAN_UP_TIMEOUT: Duration = Duration::from_secs(5);

/// Held by every process for as long as it uses iceoryx2.
pub(crate) struct ShmDir {
    usage: ProcessOwned<Usage>,
}

/// The shared lock, and what the last process removes with it. A forked child shares its parent's lock, so it
/// must not drop this.
struct Usage {
    lock: File,
    lock_path: PathBuf,
    folder: PathBuf,
}

impl RuntimeDir {
    /// Opens the folder; waits while another process cleans up. The first process removes what killed ones
    /// left.
    pub(crate) fn open_shm_dir(&self) -> Result<ShmDir> {
        let path = self.shm_dir_lock();
        let begin = Instant::now();
        while begin.elapsed() < CLEAN_UP_TIMEOUT {
            let lock = private_file(&path)?;
            if try_lock(&lock, FlockOperation::NonBlockingLockExclusive)? && is_file_at(&lock, &path) {
                if let Some(left) = self.folder_of(&lock) {
                    remove_folder(&left)?;
                }
                self.make_folder(&lock).inspect_err(|_| drop(std::fs::remove_file(&path)))?;
            }
            // The exclusive lock is released before the shared one is acquired: in between, another process
            // may make another folder.
            if try_lock(&lock, FlockOperation::NonBlockingLockShared)?
                && is_file_at(&lock, &path)
                && let Some(folder) = self.folder_of(&lock)
            {
                check_folder(&folder)?;
                let usage = Usage { lock, lock_path: path, folder };
                return Ok(ShmDir { usage: ProcessOwned::new(usage) });
            }
            drop(lock);
            std::thread::sleep(Duration::from_millis(1));
        }
        let path = path.display();
        let locked = format!("{path}: another process has held it locked for {CLEAN_UP_TIMEOUT:?}");
        Err(Error::new(ErrorKind::TimedOut, locked))
    }

    /// Removes the folders that pools left under this and earlier suffixes, unless a process uses them.
    pub(crate) fn remove_stale(&self) -> Result<()> {
        let path = self.shm_dir_lock();
        let lock = private_file(&path)?;
        if try_lock(&lock, FlockOperation::NonBlockingLockExclusive)? && is_file_at(&lock, &path) {
            self.shm_dirs().iter().try_for_each(|folder| remove_folder(folder))?;
            std::fs::remove_file(path)?;
        }
        Ok(())
    }

    /// The folder in shared memory of the running pools; `None` while no process uses one.
    pub fn shm_dir(&self) -> Option<PathBuf> {
        self.folder_of(&File::open(self.shm_dir_lock()).ok()?)
    }

    /// Those of this user's folders in shared memory that no process uses.
    pub(crate) fn unused_shm_dirs(&self) -> Vec<PathBuf> {
        // Locked for a moment; a process that opens the folder meanwhile tries again.
        let lock = File::open(self.shm_dir_lock());
        let is_used = lock.is_ok_and(|lock| flock(&lock, FlockOperation::NonBlockingLockExclusive).is_err());
        let used = if is_used { self.shm_dir() } else { None };
        self.shm_dirs().into_iter().filter(|dir| Some(dir) != used.as_ref()).collect()
    }

    /// This user's folders in shared memory whose names begin with this runtime folder's prefix.
    pub(crate) fn shm_dirs(&self) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(SHM).into_iter().flatten().flatten();
        let ours = entries.filter(|entry| {
            let name = entry.file_name();
            let suffix = name.to_str().and_then(|name| name.strip_prefix(self.shm_prefix()));
            suffix.is_some_and(|suffix| is_suffix(suffix.as_bytes())) && is_ours(&entry.path())
        });
        ours.map(|entry| entry.path()).collect()
    }

    fn shm_dir_lock(&self) -> PathBuf {
        self.root().join(LOCK_NAME)
    }

    /// Makes a folder with a new suffix, under the exclusive lock. The suffix is written before the folder is
    /// made, so that a process that dies in between leaves no folder that cannot be found.
    fn make_folder(&self, lock: &File) -> Result<()> {
        lock.set_len(0)?;
        lock.write_all_at(&new_suffix()?, 0)?;
        let unread = || Error::other(format!("{} cannot be read", self.shm_dir_lock().display()));
        let folder = self.folder_of(lock).ok_or_else(unread)?;
        let made = DirBuilder::new().mode(0o700).create(&folder);
        made.map_err(|error| Error::new(error.kind(), format!("{}: {error}", folder.display())))
    }

    /// The folder by the suffix in the lock's file; `None` if it has none yet.
    fn folder_of(&self, lock: &File) -> Option<PathBuf> {
        let mut suffix = [0; SUFFIX_LEN];
        lock.read_exact_at(&mut suffix, 0).ok()?;
        let name = format!("{}{}", self.shm_prefix(), String::from_utf8_lossy(&suffix));
        is_suffix(&suffix).then(|| Path::new(SHM).join(name))
    }
}

impl ShmDir {
    /// The folder of iceoryx2's files.
    pub(crate) fn folder(&self) -> &Path {
        &self.usage.folder
    }

    /// Gives up the files, also if something of them is still used.
    pub(crate) fn end(&self) {
        if self.usage.check().is_ok() {
            self.usage.end();
        }
    }

    /// Finds truncated segments, for which iceoryx2 would only report that it could not open the service. An
    /// empty segment that is readable was truncated: iceoryx2 makes segments readable when they are complete.
    pub(crate) fn check_segments(&self) -> Result<()> {
        for entry in std::fs::read_dir(&self.usage.folder)?.flatten() {
            let Ok(file) = entry.metadata() else { continue }; // of a peer that left meanwhile
            if file.is_file() && file.len() == 0 && file.mode() & 0o400 != 0 {
                let (path, found) = (entry.path(), owner_and_mode(&file));
                let wrong = format!("{}: a program truncated this file of a pool: {found}", path.display());
                let remedy = "stop the pools of this folder and run `smaclite-pool clean`";
                return Err(Error::other(format!("{wrong}; {remedy}")));
            }
        }
        Ok(())
    }
}

impl Usage {
    /// Gives up the shared lock. The last one removes the folder.
    fn end(&self) {
        // Where another lock is held, this fails and the shared lock is lost (flock(2)). A folder that cannot
        // be removed now is found by its suffix later.
        if flock(&self.lock, FlockOperation::NonBlockingLockExclusive).is_ok()
            && is_file_at(&self.lock, &self.lock_path)
            && remove_folder(&self.folder).is_ok()
        {
            let _ = std::fs::remove_file(&self.lock_path);
        }
    }
}

impl Drop for Usage {
    fn drop(&mut self) {
        self.end();
    }
}

fn is_ours(folder: &Path) -> bool {
    let user = rustix::process::getuid().as_raw();
    folder.symlink_metadata().is_ok_and(|found| found.is_dir() && found.uid() == user)
}

/// No other user can replace the folder: `/dev/shm` is sticky.
fn check_folder(folder: &Path) -> Result<()> {
    let named = |error: Error| {
        let remedy = match error.kind() {
            ErrorKind::NotFound => {
                "the processes that use it have another /dev/shm (share it: `docker run \
                 --ipc=container:NAME`), or it was removed (stop them)"
            }
            _ => "stop the pools that use it and run `smaclite-pool clean`",
        };
        Error::new(error.kind(), format!("{}: {error}; {remedy}", folder.display()))
    };
    let found = folder.symlink_metadata().map_err(named)?;
    if is_ours(folder) && found.mode() & 0o077 == 0 {
        return Ok(());
    }
    Err(named(Error::other(format!("expected a private folder; {}", owner_and_mode(&found)))))
}

/// Removes a folder of this user, if it exists. A folder of that name may belong to another user, who created
/// it after ours was gone.
fn remove_folder(folder: &Path) -> Result<()> {
    if !is_ours(folder) {
        return Ok(());
    }
    match std::fs::remove_dir_all(folder) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            Err(Error::new(error.kind(), format!("{}: {error}", folder.display())))
        }
        _ => Ok(()),
    }
}

/// `false` if another process has the lock.
fn try_lock(file: &File, operation: FlockOperation) -> Result<bool> {
    match flock(file, operation) {
        Ok(()) => Ok(true),
        Err(Errno::WOULDBLOCK) => Ok(false),
        Err(error) => Err(error.into()),
    }
}

fn new_suffix() -> Result<[u8; SUFFIX_LEN]> {
    let mut random = [0; SUFFIX_LEN];
    // A request of at most 256 bytes is always filled (getrandom(2)).
    getrandom(&mut random, GetRandomFlags::empty())?;
    Ok(random.map(|byte| SUFFIX_LETTERS[usize::from(byte % 32)]))
}

fn is_suffix(bytes: &[u8]) -> bool {
    bytes.len() == SUFFIX_LEN && bytes.iter().all(|letter| SUFFIX_LETTERS.contains(letter))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn runtime_dir() -> (tempfile::TempDir, RuntimeDir) {
        let folder = tempfile::tempdir_in("/tmp").unwrap();
        let runtime_dir = RuntimeDir::at(folder.path().to_owned()).unwrap();
        (folder, runtime_dir)
    }

    /// The clean-up once removed every file in every folder below the root, so a root set to a home folder
    /// lost everything.
    #[test]
    fn the_last_process_removes_only_files_of_iceoryx() {
        let (folder, runtime_dir) = runtime_dir();
        std::fs::create_dir(folder.path().join("nodes")).unwrap();
        let mine = ["thesis.tex", "nodes/notes"].map(|name| folder.path().join(name));
        mine.iter().for_each(|path| std::fs::write(path, "kept").unwrap());
        let [first, second] = [runtime_dir.open_shm_dir().unwrap(), runtime_dir.open_shm_dir().unwrap()];
        let shm = runtime_dir.shm_dir().expect("the folder is in use");
        std::fs::create_dir(shm.join("nodes")).unwrap();
        std::fs::write(shm.join("nodes/1"), "left").unwrap();
        drop(first);
        assert!(shm.exists());
        drop(second);
        assert!(!shm.exists() && runtime_dir.shm_dir().is_none());
        mine.iter().for_each(|file| assert!(file.exists(), "{}", file.display()));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    /// A learner in a container with its own `/dev/shm` was advised to stop the pool and to clean up.
    #[test]
    fn a_folder_that_is_not_in_this_shared_memory_says_what_to_share() {
        let (_root, runtime_dir) = runtime_dir();
        let pool = runtime_dir.open_shm_dir().unwrap();
        remove_folder(&pool.usage.folder).unwrap();
        let error = runtime_dir.open_shm_dir().err().expect("no folder").to_string();
        assert!(error.contains("No such file") && error.contains("--ipc=container:NAME"), "{error}");
    }

    #[test]
    fn every_use_has_a_new_private_folder() {
        let (_root, runtime_dir) = runtime_dir();
        let [first, second] = [runtime_dir.open_shm_dir().unwrap(), runtime_dir.open_shm_dir().unwrap()];
        assert_eq!(first.usage.folder, second.usage.folder);
        assert_eq!(first.usage.folder.metadata().unwrap().mode() & 0o7777, 0o700);
        let seen = first.usage.folder.clone();
        drop((first, second));
        assert_ne!(runtime_dir.open_shm_dir().unwrap().usage.folder, seen);
    }

    /// Killed before the suffix was written, before the folder was made, and while pools ran.
    #[test]
    fn a_suffix_that_a_killed_process_left_is_replaced() {
        let (_root, runtime_dir) = runtime_dir();
        for (left, has_folder) in
            [("", false), ("abc", false), ("abcdefghijklmnop", false), ("abcdefghijklmnop", true)]
        {
            private_file(&runtime_dir.shm_dir_lock()).unwrap().write_all_at(left.as_bytes(), 0).unwrap();
            let folder = PathBuf::from(format!("{SHM}/{}{left}", runtime_dir.shm_prefix()));
            if has_folder {
                std::fs::create_dir(&folder).unwrap();
                std::fs::write(folder.join("1.data"), "left").unwrap();
            }
            let shm_dir = runtime_dir.open_shm_dir().unwrap();
            assert_ne!(shm_dir.usage.folder, folder);
            assert!(!folder.exists());
            drop(shm_dir);
            assert!(!runtime_dir.shm_dir_lock().exists());
        }
    }

    /// A cleaner of /tmp removed the root folder, and with it the suffix.
    #[test]
    fn folders_without_a_lock_are_removed_when_no_process_uses_them() {
        let (_root, runtime_dir) = runtime_dir();
        let lost = PathBuf::from(format!("{SHM}/{}abcdefghijklmnop", runtime_dir.shm_prefix()));
        std::fs::create_dir(&lost).unwrap();
        let shm_dir = runtime_dir.open_shm_dir().unwrap();
        runtime_dir.remove_stale().unwrap();
        assert!(lost.exists() && shm_dir.usage.folder.exists());
        drop(shm_dir);
        runtime_dir.remove_stale().unwrap();
        assert!(!lost.exists() && !runtime_dir.shm_dir_lock().exists());
    }
}
