//! The runtime folder, by whose path pools of this process are told apart. It has no files of pools.

use super::socket::listening;
use crate::name::check_name;
use crate::runtime_dir::{RuntimeDir, RuntimeDirError};
use std::path::PathBuf;

/// Where the runtime folder is by default.
pub(crate) fn default_root() -> PathBuf {
    std::env::temp_dir().join("smaclite-pool")
}

/// Makes the folder if it does not exist, and returns its path without links.
pub(crate) fn private_folder(root: PathBuf) -> Result<PathBuf, RuntimeDirError> {
    let created = std::fs::create_dir_all(&root).and_then(|()| root.canonicalize());
    created.map_err(|source| RuntimeDirError::Create { root, source })
}

impl RuntimeDir {
    /// Names of the pools of this process.
    pub fn pool_names(&self) -> Vec<String> {
        let sockets = listening().into_iter().filter(|path| path.parent() == Some(self.root()));
        let names = sockets.filter_map(|path| Some(path.file_stem()?.to_str()?.to_owned()));
        names.filter(|name| check_name(name).is_ok()).collect()
    }

    /// Names of the pools that left files here: none.
    pub(crate) fn stale_names(&self) -> Vec<String> {
        Vec::new()
    }
}
