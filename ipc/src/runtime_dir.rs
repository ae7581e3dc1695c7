//! The runtime folder of a user's pools: a private folder for sockets and locks, which no other user can
//! open. The files of iceoryx2 in `/dev/shm`, and which processes use them, are `shm_dir`'s concern.

pub(crate) mod error;

use crate::os::folders;
pub use error::{ROOT_VARIABLE, RuntimeDirError};
use smaclite_engine::fnv::Fnv1a;
use std::path::{Path, PathBuf};

/// The folder of this user's pools.
#[derive(Clone, Debug)]
pub struct RuntimeDir {
    root: PathBuf,
    prefix: String,
}

impl RuntimeDir {
    /// `$SMACLITE_POOL_ROOT`, else `/tmp/smaclite-pool-<uid>`, or on Windows `smaclite-pool` in the user's
    /// folder of temporary files; created, private to this user, if it does not exist.
    ///
    /// # Errors
    /// As [`at`](RuntimeDir::at).
    pub fn for_current_user() -> Result<RuntimeDir, RuntimeDirError> {
        RuntimeDir::at(std::env::var_os(ROOT_VARIABLE).map_or_else(folders::default_root, PathBuf::from))
    }

    /// The given folder; created, private to this user, if it does not exist.
    ///
    /// # Errors
    /// If the path is empty or too long, is not a folder, or other users own it or can write to it.
    pub fn at(root: PathBuf) -> Result<RuntimeDir, RuntimeDirError> {
        if root.as_os_str().is_empty() {
            return Err(RuntimeDirError::Empty);
        }
        let root = folders::private_folder(root)?;
        // Names in /dev/shm do not contain the folder, so two folders need different prefixes.
        let mut hash = Fnv1a::default();
        hash.write(root.as_os_str().as_encoded_bytes());
        Ok(RuntimeDir { prefix: format!("sp{:08x}", hash.finish() as u32), root })
    }

    /// The folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The first part of the name of its folder in `/dev/shm`; a suffix that cannot be guessed follows.
    pub fn shm_prefix(&self) -> &str {
        &self.prefix
    }

    /// The control socket of a pool.
    pub fn socket(&self, pool: &str) -> PathBuf {
        self.root.join(format!("{pool}.sock"))
    }

    /// The file that a pool's supervisor holds locked.
    pub fn lock(&self, pool: &str) -> PathBuf {
        self.root.join(format!("{pool}.lock"))
    }
}
