//! Where pools of this user live: a private folder for sockets and locks. What iceoryx2 keeps in `/dev/shm`,
//! and who uses the place at the moment, is `stay`'s concern. One user per pool: nothing here can be opened
//! by another.

use crate::name::check_name;
use rustix::fs::OFlags;
use smaclite_pool::fnv::Fnv1a;
use std::fs::{File, Metadata};
use std::io::Error;
use std::os::unix::fs::{DirBuilderExt, FileTypeExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

/// Overrides the folder, for tests and for containers that share one. All processes of a pool must agree on
/// it.
pub const ROOT_VARIABLE: &str = "SMACLITE_POOL_ROOT";

/// The system limits paths of sockets to 108 bytes with the zero at their end; the longest is
/// `ROOT/NAME.sock`.
const MAX_ROOT_LEN: usize = 60;

/// Of a file that belongs to this user alone.
pub(crate) const PRIVATE: u32 = 0o600;

/// The folder of this user's pools.
#[derive(Clone, Debug)]
pub struct RuntimeDir {
    root: PathBuf,
    prefix: String,
}

/// Why there is no place for pools.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum RuntimeDirError {
    #[error("{ROOT_VARIABLE} is empty; set it to a folder of your own or unset it")]
    Empty,
    #[error("{root}: expected a folder; {found}; set {ROOT_VARIABLE} to a folder of your own", root = root.display())]
    NotAFolder { root: PathBuf, found: String },
    #[error("{root}: cannot be created: {source}", root = root.display())]
    Create { root: PathBuf, source: std::io::Error },
    #[error("{root}: belongs to user {owner}, not to user {user}; set {ROOT_VARIABLE} to a folder of your own", root = root.display())]
    NotOurs { root: PathBuf, owner: u32, user: u32 },
    #[error("{root}: other users can write to it (mode {mode:o}); `chmod 700` it or set {ROOT_VARIABLE} to a folder of your own", root = root.display())]
    Open { root: PathBuf, mode: u32 },
    #[error("{root}: is longer than {MAX_ROOT_LEN} bytes; set {ROOT_VARIABLE} to a shorter path", root = root.display())]
    TooLong { root: PathBuf },
}

impl RuntimeDir {
    /// `$SMACLITE_POOL_ROOT`, else `/tmp/smaclite-pool-<uid>`; created, private to this user, if it is not
    /// there.
    pub fn for_current_user() -> Result<RuntimeDir, RuntimeDirError> {
        let uid = rustix::process::getuid().as_raw();
        let default = PathBuf::from(format!("/tmp/smaclite-pool-{uid}"));
        let root = std::env::var_os(ROOT_VARIABLE).map_or(default, PathBuf::from);
        RuntimeDir::at(root)
    }

    /// Pools in a folder of the caller's choice.
    pub fn at(root: PathBuf) -> Result<RuntimeDir, RuntimeDirError> {
        if root.as_os_str().is_empty() {
            return Err(RuntimeDirError::Empty);
        }
        if root.as_os_str().len() > MAX_ROOT_LEN {
            return Err(RuntimeDirError::TooLong { root });
        }
        let created = std::fs::DirBuilder::new().recursive(true).mode(0o700).create(&root);
        created.map_err(|source| match root.symlink_metadata() {
            Ok(found) => RuntimeDirError::NotAFolder { root: root.clone(), found: owner_and_mode(&found) },
            Err(_) => RuntimeDirError::Create { root: root.clone(), source },
        })?;
        let user = rustix::process::getuid().as_raw();
        let failed = |source| RuntimeDirError::Create { root: root.clone(), source };
        // A link that another user put into /tmp would have us work in any folder of ours.
        let link = root.symlink_metadata().map_err(failed)?;
        let canonical = root.canonicalize().map_err(failed)?;
        let folder = canonical.metadata().map_err(failed)?;
        let root = canonical;
        if let Some(owner) = [link.uid(), folder.uid()].into_iter().find(|owner| *owner != user) {
            return Err(RuntimeDirError::NotOurs { root, owner, user });
        }
        if folder.mode() & 0o022 != 0 {
            return Err(RuntimeDirError::Open { root, mode: folder.mode() & 0o7777 });
        }
        // Two folders must not share names in /dev/shm, where the folder does not show.
        let mut hash = Fnv1a::default();
        hash.write(root.as_os_str().as_encoded_bytes());
        Ok(RuntimeDir { prefix: format!("sp{:08x}", hash.finish() as u32), root })
    }

    /// The folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// What the name of this place's folder in `/dev/shm` begins with; then comes a mark that cannot be
    /// guessed.
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
        self.names_of(&[".sock"], |_| true)
    }

    /// Names of the pools that left a socket or a lock here, dead or alive. Files that only happen to be
    /// named so are none of ours: a pool's files are private, and its lock is empty.
    pub(crate) fn stale_names(&self) -> Vec<String> {
        let user = rustix::process::getuid().as_raw();
        let is_pools = |file: &Metadata| {
            let is_lock = file.is_file() && file.len() == 0;
            (is_lock || file.file_type().is_socket()) && file.uid() == user && file.mode() & 0o7777 == PRIVATE
        };
        self.names_of(&[".sock", ".lock"], is_pools)
    }

    fn names_of(&self, suffixes: &[&str], is_pools: impl Fn(&Metadata) -> bool) -> Vec<String> {
        let entries = std::fs::read_dir(&self.root).into_iter().flatten().flatten();
        let entries = entries.filter(|entry| entry.metadata().is_ok_and(|file| is_pools(&file)));
        let names = entries.filter_map(|entry| {
            let file = entry.file_name().into_string().ok()?;
            let name = suffixes.iter().find_map(|suffix| file.strip_suffix(suffix))?;
            check_name(name).is_ok().then(|| name.to_owned())
        });
        let mut names: Vec<_> = names.collect();
        names.sort();
        names.dedup();
        names
    }
}

/// Opens or makes a file to lock, private even where the folder is not: a lock is all another user needs to
/// get in the way. What is there already must be ours alone and a plain file; a FIFO would be waited for.
pub(crate) fn lock_file(path: &Path) -> std::io::Result<File> {
    let named = |error: Error| Error::new(error.kind(), format!("{}: {error}", path.display()));
    let careful = (OFlags::NOFOLLOW | OFlags::NONBLOCK).bits() as i32;
    let mut options = File::options();
    options.create(true).truncate(false).read(true).write(true).mode(PRIVATE).custom_flags(careful);
    let file = options.open(path).map_err(named)?;
    let found = file.metadata().map_err(named)?;
    let user = rustix::process::getuid().as_raw();
    if found.is_file() && found.uid() == user && found.mode() & 0o077 == 0 {
        return Ok(file);
    }
    Err(Error::other(format!("{}: expected a private file; {}", path.display(), owner_and_mode(&found))))
}

/// For messages about files that are not as they must be.
pub(crate) fn owner_and_mode(file: &Metadata) -> String {
    let (user, mode, bytes) = (rustix::process::getuid().as_raw(), file.mode() & 0o7777, file.len());
    let kind = if file.is_file() { "it" } else { "it is not a plain file and" };
    format!(
        "{kind} belongs to user {} (this is user {user}), has mode {mode:o} and {bytes} bytes",
        file.uid()
    )
}

/// Is this still the file at `path`? Between opening a lock's file and locking it, its last learner_pid may have
/// removed it.
pub(crate) fn is_file_at(file: &File, path: &Path) -> bool {
    let same = |a: &Metadata, b: &Metadata| (a.dev(), a.ino()) == (b.dev(), b.ino());
    matches!((file.metadata(), path.metadata()), (Ok(ours), Ok(there)) if same(&ours, &there))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::Permissions;
    use std::os::unix::fs::PermissionsExt;

    /// The messages were ": cannot be created: No such file or directory" and "File exists", without owner
    /// and remedy.
    #[test]
    fn what_cannot_be_a_root_folder_says_why() {
        let refused = |root: &Path| RuntimeDir::at(root.to_owned()).unwrap_err().to_string();
        assert!(refused(Path::new("")).starts_with("SMACLITE_POOL_ROOT is empty; set it to a folder"));
        let folder = tempfile::tempdir().unwrap();
        let user = rustix::process::getuid().as_raw();
        let [file, link] = ["file", "link"].map(|name| folder.path().join(name));
        std::fs::write(&file, "").unwrap();
        std::os::unix::fs::symlink(folder.path().join("nothing"), &link).unwrap();
        for root in [&file, &link] {
            let text = refused(root);
            assert!(text.starts_with(&format!("{}: expected a folder; it", root.display())), "{text}");
            assert!(text.contains(&format!("belongs to user {user}")), "{text}");
            assert!(text.ends_with("set SMACLITE_POOL_ROOT to a folder of your own"), "{text}");
        }
    }

    #[test]
    fn a_folder_that_others_can_write_to_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        for (mode, is_fine) in [(0o700, true), (0o755, true), (0o770, false), (0o1777, false)] {
            std::fs::set_permissions(folder.path(), Permissions::from_mode(mode)).unwrap();
            let runtime_dir = RuntimeDir::at(folder.path().to_owned());
            assert_eq!(runtime_dir.is_ok(), is_fine, "{mode:o}: {runtime_dir:?}");
        }
    }
}
