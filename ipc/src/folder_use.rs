//! The use of the folder of iceoryx2's files.

use crate::os::shm_dir::ShmDir;
use iceoryx2::prelude::{Config, Path as IceoryxPath, SemanticString};
use std::path::Path;
use std::sync::{Arc, Weak};

/// The use of the folder of a pool's files by a learner or spectator. Batches prolong it.
pub struct FolderUse(Weak<ShmDir>);

impl FolderUse {
    pub(crate) fn of(shm_dir: &Arc<ShmDir>) -> FolderUse {
        FolderUse(Arc::downgrade(shm_dir))
    }

    /// For a process that exits: gives up the files, also if batches are left that nothing will drop any
    /// more. Their memory stays mapped. Only other processes and the pool itself keep the folder now.
    pub fn end(&self) {
        if let Some(shm_dir) = self.0.upgrade() {
            shm_dir.end();
        }
    }

    /// Whether nothing of the client is left.
    pub fn has_ended(&self) -> bool {
        self.0.strong_count() == 0
    }
}

/// The configuration of an iceoryx2 node with its files in this folder; explicit, so that no configuration
/// file changes it.
pub fn iceoryx(folder: &Path) -> Config {
    let mut config = Config::default();
    let folder = folder.as_os_str().as_encoded_bytes();
    config.global.set_root_path(&IceoryxPath::new(folder).expect("a short path"));
    config
}
