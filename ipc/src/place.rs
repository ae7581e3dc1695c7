//! Where pools of this user live: a private folder for sockets, locks and iceoryx2's files, and a prefix for what
//! iceoryx2 puts into `/dev/shm`. One user a pool: nothing here can be opened by another.

use iceoryx2::prelude::{Config, FileName, Path, SemanticString};
use rustix::fs::{FlockOperation, flock};
use std::fs::{File, Permissions};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path as FsPath, PathBuf};

/// Overrides the folder, for tests and for containers that share one. All processes of a pool must agree on it.
pub const ROOT_VARIABLE: &str = "SMACLITE_POOL_ROOT";

/// Locked by every process that uses iceoryx2 here.
const STAY_LOCK: &str = "in-use";

/// Where iceoryx2 keeps shared memory.
const SHM: &str = "/dev/shm";

/// Where iceoryx2 keeps everything else, below the root.
const ICEORYX_FOLDERS: [&str; 2] = ["nodes", "services"];

/// iceoryx2 builds socket paths below the folder, which the system limits to 108 bytes.
const MAX_ROOT_LEN: usize = 60;

/// The folder of this user's pools.
#[derive(Clone, Debug)]
pub struct Place {
    root: PathBuf,
    prefix: String,
}

/// Why there is no place for pools.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum PlaceError {
    #[error("{root}: cannot be created: {source}", root = root.display())]
    Create { root: PathBuf, source: std::io::Error },
    #[error("{root}: belongs to user {owner}, not to user {user}; set {ROOT_VARIABLE} to a folder of your own", root = root.display())]
    NotOurs { root: PathBuf, owner: u32, user: u32 },
    #[error("{root}: other users can write to it (mode {mode:o}); `chmod 700` it or set {ROOT_VARIABLE} to a folder of your own", root = root.display())]
    Open { root: PathBuf, mode: u32 },
    #[error("{root}: is longer than {MAX_ROOT_LEN} bytes; set {ROOT_VARIABLE} to a shorter path", root = root.display())]
    TooLong { root: PathBuf },
}

impl Place {
    /// `$SMACLITE_POOL_ROOT`, else `/tmp/smaclite-pool-<uid>`; created, private to this user, if it is not there.
    pub fn of_this_user() -> Result<Place, PlaceError> {
        let uid = rustix::process::getuid().as_raw();
        let default = PathBuf::from(format!("/tmp/smaclite-pool-{uid}"));
        let root = std::env::var_os(ROOT_VARIABLE).map_or(default, PathBuf::from);
        Place::at(root)
    }

    /// Pools in a folder of the caller's choice.
    pub fn at(root: PathBuf) -> Result<Place, PlaceError> {
        if root.as_os_str().len() > MAX_ROOT_LEN {
            return Err(PlaceError::TooLong { root });
        }
        let created = std::fs::DirBuilder::new().recursive(true).mode(0o700).create(&root);
        created.map_err(|source| PlaceError::Create { root: root.clone(), source })?;
        let user = rustix::process::getuid().as_raw();
        let failed = |source| PlaceError::Create { root: root.clone(), source };
        // A link that another user put into /tmp would have us work in any folder of ours.
        let link = root.symlink_metadata().map_err(failed)?;
        let canonical = root.canonicalize().map_err(failed)?;
        let folder = canonical.metadata().map_err(failed)?;
        let root = canonical;
        if let Some(owner) = [link.uid(), folder.uid()].into_iter().find(|owner| *owner != user) {
            return Err(PlaceError::NotOurs { root, owner, user });
        }
        if folder.mode() & 0o022 != 0 {
            return Err(PlaceError::Open { root, mode: folder.mode() & 0o7777 });
        }
        // Two folders must not share names in /dev/shm, where the folder does not show.
        let mark = root.as_os_str().as_encoded_bytes().iter().fold(0xcbf2_9ce4_8422_2325u64, |hash, byte| {
            (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
        });
        Ok(Place { prefix: format!("smaclite{user}_{:08x}_", mark as u32), root })
    }

    /// The folder.
    pub fn root(&self) -> &FsPath {
        &self.root
    }

    /// What the names of this place's files in `/dev/shm` begin with.
    pub fn shm_prefix(&self) -> &str {
        &self.prefix
    }

    /// The control socket of a pool.
    pub fn socket(&self, pool: &str) -> PathBuf {
        self.root.join(format!("{pool}.sock"))
    }

    /// The file a pool's supervisor holds locked.
    pub fn lock(&self, pool: &str) -> PathBuf {
        self.root.join(format!("{pool}.lock"))
    }

    /// Names of the pools that have a socket here, dead or alive.
    pub fn pool_names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.root).into_iter().flatten().flatten();
        let names = entries.filter_map(|e| e.file_name().to_str()?.strip_suffix(".sock").map(str::to_owned));
        let mut names: Vec<_> = names.collect();
        names.sort();
        names
    }

    /// The configuration of every iceoryx2 node; explicit, so that no file of the machine changes it.
    pub(crate) fn iceoryx(&self) -> Config {
        let mut config = Config::default();
        let root = self.root.as_os_str().as_encoded_bytes();
        config.global.set_root_path(&Path::new(root).expect("the length was checked"));
        config.global.prefix =
            FileName::new(self.prefix.as_bytes()).expect("letters, digits and underscores");
        config
    }
}

/// Held by every process of a place for as long as it uses iceoryx2. The last one to leave removes what iceoryx2 keeps for
/// good, and what its clean-up could not take from processes that were killed.
pub(crate) struct Stay {
    lock: File,
    place: Place,
    owner: u32,
}

impl Place {
    /// Enters the place; waits while another process tidies it up.
    pub(crate) fn enter(&self) -> std::io::Result<Stay> {
        let path = self.root.join(STAY_LOCK);
        loop {
            let lock = lock_file(&path)?;
            flock(&lock, FlockOperation::LockShared)?;
            if is_file_at(&lock, &path) {
                return Ok(Stay { lock, place: self.clone(), owner: std::process::id() });
            }
        }
    }

    /// Files of this place in `/dev/shm` and iceoryx2's in the root and its folders there. All bear the prefix; whatever
    /// else somebody keeps in the folder is none of our business.
    pub(crate) fn left_overs(&self) -> Vec<PathBuf> {
        let mut files = Vec::new();
        collect_files(FsPath::new(SHM), &self.prefix, 0, &mut files);
        collect_files(&self.root, &self.prefix, 0, &mut files);
        for folder in ICEORYX_FOLDERS {
            collect_files(&self.root.join(folder), &self.prefix, 1, &mut files);
        }
        files
    }

    /// iceoryx2 counts its nodes in a file that every user may write to; here nobody else has a node to count.
    pub(crate) fn close_counter(&self) {
        let mut files = Vec::new();
        collect_files(FsPath::new(SHM), &self.prefix, 0, &mut files);
        for file in files.iter().filter(|file| file.extension().is_some_and(|e| e == "global_mgmt")) {
            let _ = std::fs::set_permissions(file, Permissions::from_mode(0o600)); // gone, or another user's
        }
    }
}

impl Drop for Stay {
    fn drop(&mut self) {
        if self.owner != std::process::id() {
            return; // a forked child shares its parent's lock
        }
        if flock(&self.lock, FlockOperation::NonBlockingLockExclusive).is_ok() {
            self.place.left_overs().iter().for_each(|file| drop(std::fs::remove_file(file)));
            let _ = std::fs::remove_file(self.place.root.join(STAY_LOCK));
        }
    }
}

/// Opens a file to lock, private even where the folder is not: a lock is all another user needs to get in the way.
pub(crate) fn lock_file(path: &FsPath) -> std::io::Result<File> {
    File::options().create(true).truncate(false).write(true).mode(0o600).open(path)
}

/// Is this still the file at `path`? Between opening a lock's file and locking it, its last holder may have removed it.
pub(crate) fn is_file_at(file: &File, path: &FsPath) -> bool {
    let same = |a: &std::fs::Metadata, b: &std::fs::Metadata| (a.dev(), a.ino()) == (b.dev(), b.ino());
    matches!((file.metadata(), path.metadata()), (Ok(ours), Ok(there)) if same(&ours, &there))
}

/// Files whose names begin with `prefix` in a folder and in `depth` levels of folders below it. Links are not followed.
fn collect_files(folder: &FsPath, prefix: &str, depth: usize, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
        if is_folder && depth > 0 {
            collect_files(&entry.path(), prefix, depth - 1, files);
        } else if !is_folder && entry.file_name().to_str().is_some_and(|name| name.starts_with(prefix)) {
            files.push(entry.path());
        }
    }
}

/// May this be a pool's or lane's name? Names become parts of file names and of messages to people.
pub fn check_name(name: &str) -> Result<(), String> {
    let fine = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    if name.is_empty() || name.len() > 40 || !name.chars().all(fine) || name.starts_with('.') {
        return Err(format!(
            "`{}` cannot be a name: a name has 1 to 40 letters, digits, `-`, `_` or `.`, and no `.` at the start",
            name.chars().take(60).collect::<String>().escape_debug()
        ));
    }
    Ok(())
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
        let folder = tempfile::tempdir().unwrap();
        let place = Place::at(folder.path().to_owned()).unwrap();
        let below = |path: &str| place.root().join(path.replace("PREFIX", place.shm_prefix()));
        let mine =
            ["thesis.tex", "nodes/notes", "thesis/PREFIXa", "nodes/1/2/PREFIXa"].map(|p| write(below(p)));
        let left = ["PREFIXa.event", "services/PREFIXa.service", "nodes/1/PREFIXa"].map(|p| write(below(p)));
        drop(place.enter().unwrap());
        mine.iter().for_each(|file| assert!(file.exists(), "{}", file.display()));
        left.iter().for_each(|file| assert!(!file.exists(), "{}", file.display()));
    }

    #[test]
    fn a_folder_that_others_can_write_to_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        for (mode, is_fine) in [(0o700, true), (0o755, true), (0o770, false), (0o1777, false)] {
            std::fs::set_permissions(folder.path(), Permissions::from_mode(mode)).unwrap();
            let place = Place::at(folder.path().to_owned());
            assert_eq!(place.is_ok(), is_fine, "{mode:o}: {place:?}");
        }
    }
}
