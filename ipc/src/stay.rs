//! Using a place: every process that has an iceoryx2 node here holds a shared lock, and the last one to leave removes
//! what iceoryx2 keeps for good and what its clean-up could not take from processes that were killed.
//!
//! The locked file holds the *mark*, which is part of the name of every file of iceoryx2's. The first process to come
//! draws it at random, so nobody can put files in the way of a pool before it starts: to learn the mark one must read a
//! file of mode 0600, or see a name that is already in use.

use crate::place::{Place, is_file_at, lock_file, owner_and_mode};
use crate::variant::random;
use iceoryx2::prelude::{Config, FileName, Path as IceoryxPath, SemanticString};
use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;
use std::fs::{File, Metadata};
use std::io::{Error, ErrorKind, Result};
use std::os::unix::fs::{FileExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Locked by every process that uses iceoryx2 here; its content is the mark.
const STAY_LOCK: &str = "in-use";

/// Characters of a mark, of 32 different ones.
pub(crate) const MARK_LEN: usize = 8;
const MARK_LETTERS: &[u8; 32] = b"abcdefghijklmnopqrstuvwxyz234567";

/// Where iceoryx2 keeps shared memory.
const SHM: &str = "/dev/shm";

/// Where iceoryx2 keeps everything else, below the root.
const ICEORYX_FOLDERS: [&str; 2] = ["nodes", "services"];

/// How long to wait for another process that tidies the place up; it takes milliseconds.
const PATIENCE: Duration = Duration::from_secs(5);

/// Held by every process of a place for as long as it uses iceoryx2.
pub(crate) struct Stay {
    lock: File,
    place: Place,
    prefix: String,
    owner: u32,
}

impl Place {
    /// Enters the place; waits while another process tidies it up. The first to come removes what the killed left.
    pub(crate) fn enter(&self) -> Result<Stay> {
        let path = self.root().join(STAY_LOCK);
        let begin = Instant::now();
        while begin.elapsed() < PATIENCE {
            let lock = lock_file(&path)?;
            if try_lock(&lock, FlockOperation::NonBlockingLockExclusive)? && is_file_at(&lock, &path) {
                self.remove_left_overs(self.shm_prefix_of(&lock).as_deref());
                lock.set_len(0)?;
                lock.write_all_at(&new_mark()?, 0)?;
            }
            // To share the lock is to give it up first: another process may come in between and draw another mark.
            if try_lock(&lock, FlockOperation::NonBlockingLockShared)?
                && is_file_at(&lock, &path)
                && let Some(prefix) = self.shm_prefix_of(&lock)
            {
                return Ok(Stay { lock, place: self.clone(), prefix, owner: std::process::id() });
            }
            drop(lock);
            std::thread::sleep(Duration::from_millis(1));
        }
        let locked = format!("{}: another process has held it locked for {PATIENCE:?}", path.display());
        Err(Error::new(ErrorKind::TimedOut, locked))
    }

    /// Removes what pools left here under this and earlier marks, unless a process uses the place.
    pub(crate) fn tidy(&self) -> Result<()> {
        let path = self.root().join(STAY_LOCK);
        let lock = lock_file(&path)?;
        if try_lock(&lock, FlockOperation::NonBlockingLockExclusive)? && is_file_at(&lock, &path) {
            self.remove_left_overs(Some(self.shm_prefix()));
            std::fs::remove_file(path)?;
        }
        Ok(())
    }

    /// Files of this user and place in `/dev/shm`, and iceoryx2's in the root and its folders there. All bear the prefix;
    /// whatever else is kept in the folder is none of our business.
    pub(crate) fn left_overs(&self) -> Vec<PathBuf> {
        self.files_with(self.shm_prefix())
    }

    fn files_with(&self, prefix: &str) -> Vec<PathBuf> {
        let mut files = Vec::new();
        collect_files(Path::new(SHM), prefix, 0, &mut files);
        collect_files(self.root(), prefix, 0, &mut files);
        for folder in ICEORYX_FOLDERS {
            collect_files(&self.root().join(folder), prefix, 1, &mut files);
        }
        files
    }

    /// For the holder of the exclusive lock.
    fn remove_left_overs(&self, prefix: Option<&str>) {
        let files = prefix.map_or(Vec::new(), |prefix| self.files_with(prefix));
        files.iter().for_each(|file| drop(std::fs::remove_file(file)));
        for folder in ICEORYX_FOLDERS.map(|folder| self.root().join(folder)) {
            // What is not empty stays.
            let below = std::fs::read_dir(&folder).into_iter().flatten().flatten();
            below.for_each(|entry| drop(std::fs::remove_dir(entry.path())));
            let _ = std::fs::remove_dir(folder);
        }
    }

    /// What names begin with by the mark in this file; `None` if there is none yet.
    fn shm_prefix_of(&self, lock: &File) -> Option<String> {
        let mut mark = [0; MARK_LEN];
        lock.read_exact_at(&mut mark, 0).ok()?;
        let is_mark = mark.iter().all(|letter| MARK_LETTERS.contains(letter));
        is_mark.then(|| format!("{}{}_", self.shm_prefix(), String::from_utf8_lossy(&mark)))
    }

    /// What the names of iceoryx2's files here begin with at the moment; `None` while no process uses the place.
    pub fn shm_prefix_in_use(&self) -> Option<String> {
        self.shm_prefix_of(&File::open(self.root().join(STAY_LOCK)).ok()?)
    }
}

impl Stay {
    /// The configuration of every iceoryx2 node; explicit, so that no file of the machine changes it.
    pub(crate) fn iceoryx(&self) -> Config {
        let mut config = Config::default();
        let root = self.place.root().as_os_str().as_encoded_bytes();
        config.global.set_root_path(&IceoryxPath::new(root).expect("the length was checked"));
        config.global.prefix =
            FileName::new(self.prefix.as_bytes()).expect("letters, digits and an underscore");
        config
    }

    /// Are the segments here as iceoryx2 made them? It gives a segment its size and only then makes it readable, and
    /// waits without a limit for the size of one that is readable (`dynamic_storage/posix_shared_memory.rs`).
    pub(crate) fn check_segments(&self) -> Result<()> {
        let mut files = Vec::new();
        collect_files(Path::new(SHM), &self.prefix, 0, &mut files);
        let is_broken = |file: &Metadata| {
            !file.is_file() || file.mode() & 0o077 != 0 || (file.mode() & 0o400 != 0 && file.len() == 0)
        };
        for path in files {
            // Gone in the meantime: of a peer that left.
            let Ok(file) = path.symlink_metadata() else { continue };
            if is_broken(&file) {
                let (path, found) = (path.display(), owner_and_mode(&file));
                let wrong = format!("{path}: a program other than iceoryx2 changed this file of a pool");
                let remedy = "stop the pools of this folder and run `smaclite-pool clean`";
                return Err(Error::other(format!("{wrong}: {found}; {remedy}")));
            }
        }
        Ok(())
    }
}

impl Drop for Stay {
    fn drop(&mut self) {
        if self.owner != std::process::id() {
            return; // a forked child shares its parent's lock
        }
        if flock(&self.lock, FlockOperation::NonBlockingLockExclusive).is_ok() {
            self.place.remove_left_overs(Some(&self.prefix));
            let _ = std::fs::remove_file(self.place.root().join(STAY_LOCK));
        }
    }
}

/// `false` if another process has it.
fn try_lock(file: &File, operation: FlockOperation) -> Result<bool> {
    match flock(file, operation) {
        Ok(()) => Ok(true),
        Err(Errno::WOULDBLOCK) => Ok(false),
        Err(error) => Err(error.into()),
    }
}

fn new_mark() -> Result<[u8; MARK_LEN]> {
    Ok(random()?.to_ne_bytes().map(|byte| MARK_LETTERS[usize::from(byte % 32)]))
}

/// This user's files whose names begin with `prefix` in a folder and in `depth` levels of folders below it. Links are not
/// followed.
fn collect_files(folder: &Path, prefix: &str, depth: usize, files: &mut Vec<PathBuf>) {
    let user = rustix::process::getuid().as_raw();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let Ok(file) = entry.metadata() else { continue };
        if file.is_dir() && depth > 0 {
            collect_files(&entry.path(), prefix, depth - 1, files);
        } else if !file.is_dir()
            && file.uid() == user
            && entry.file_name().to_str().is_some_and(|name| name.starts_with(prefix))
        {
            files.push(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(path: PathBuf) -> PathBuf {
        std::fs::create_dir_all(path.parent().expect("a folder")).unwrap();
        std::fs::write(&path, "kept").unwrap();
        path
    }

    /// The clean-up once removed every file in every folder below the root: with the root set to one's home, all of it.
    #[test]
    fn whoever_leaves_last_removes_nothing_but_what_iceoryx_keeps() {
        let folder = tempfile::tempdir_in("/tmp").unwrap();
        let place = Place::at(folder.path().to_owned()).unwrap();
        let stay = place.enter().unwrap();
        let prefix = place.shm_prefix_in_use().expect("the place is in use");
        let below = |path: &str| place.root().join(path.replace("PREFIX", &prefix));
        let mine =
            ["thesis.tex", "nodes/notes", "thesis/PREFIXa", "nodes/1/2/PREFIXa"].map(|p| write(below(p)));
        let left = ["PREFIXa.event", "services/PREFIXa.service", "nodes/1/PREFIXa"].map(|p| write(below(p)));
        drop(stay);
        mine.iter().for_each(|file| assert!(file.exists(), "{}", file.display()));
        left.iter().for_each(|file| assert!(!file.exists(), "{}", file.display()));
        assert!(!below("services").exists() && !below("in-use").exists());
    }

    /// A mark outlives those who use the place and no longer.
    #[test]
    fn every_use_of_a_place_has_a_mark_of_its_own() {
        let folder = tempfile::tempdir_in("/tmp").unwrap();
        let place = Place::at(folder.path().to_owned()).unwrap();
        let [first, second] = [place.enter().unwrap(), place.enter().unwrap()];
        assert_eq!(first.prefix, second.prefix);
        assert_eq!(place.shm_prefix_in_use().as_ref(), Some(&first.prefix));
        let seen = first.prefix.clone();
        drop((first, second));
        assert_eq!(place.shm_prefix_in_use(), None);
        assert_ne!(place.enter().unwrap().prefix, seen);
    }

    /// Killed between making the file and writing the mark; and killed while pools ran.
    #[test]
    fn a_mark_that_a_killed_process_left_is_replaced() {
        let folder = tempfile::tempdir_in("/tmp").unwrap();
        let place = Place::at(folder.path().to_owned()).unwrap();
        let path = place.root().join(STAY_LOCK);
        for left in ["", "abc", "abcdefgh"] {
            lock_file(&path).unwrap().write_all_at(left.as_bytes(), 0).unwrap();
            let segment = PathBuf::from(format!("{SHM}/{}{left}_1.data", place.shm_prefix()));
            std::fs::write(&segment, "left").unwrap();
            let stay = place.enter().unwrap();
            assert_ne!(stay.prefix, format!("{}{left}_", place.shm_prefix()));
            assert_eq!(segment.exists(), left.len() < MARK_LEN, "{left}");
            drop(stay);
            place.tidy().unwrap();
            assert!(!segment.exists() && !path.exists());
        }
    }
}
