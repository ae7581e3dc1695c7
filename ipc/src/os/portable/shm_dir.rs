//! The folder of iceoryx2's files: here it has none, since its services are those of one process.

use crate::runtime_dir::RuntimeDir;
use iceoryx2::prelude::Config;
use std::io::Result;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Weak};

/// Held for as long as this process uses iceoryx2.
pub(crate) struct ShmDir(());

impl RuntimeDir {
    pub(crate) fn open_shm_dir(&self) -> Result<ShmDir> {
        Ok(ShmDir(()))
    }

    /// Removes what pools left: nothing.
    pub(crate) fn remove_stale(&self) -> Result<()> {
        Ok(())
    }

    /// The folder in shared memory of the running pools: `None`, there is none here.
    pub fn shm_dir(&self) -> Option<PathBuf> {
        None
    }

    pub(crate) fn unused_shm_dirs(&self) -> Vec<PathBuf> {
        Vec::new()
    }

    pub(crate) fn shm_dirs(&self) -> Vec<PathBuf> {
        Vec::new()
    }
}

impl ShmDir {
    /// The configuration of every iceoryx2 node; explicit, so that no configuration file changes it.
    pub(crate) fn iceoryx(&self) -> Config {
        Config::default()
    }

    pub(crate) fn check_segments(&self) -> Result<()> {
        Ok(())
    }

    pub(crate) fn complete_dead_nodes(&self, _own: u128) {}
}

/// The use of a pool's memory by a learner or spectator. Batches prolong it.
pub struct FolderUse(Weak<ShmDir>);

impl FolderUse {
    pub(crate) fn of(shm_dir: &Arc<ShmDir>) -> FolderUse {
        FolderUse(Arc::downgrade(shm_dir))
    }

    /// For a process that exits: there are no files to give up.
    pub fn end(&self) {}

    /// Whether nothing of the client is left.
    pub fn has_ended(&self) -> bool {
        self.0.strong_count() == 0
    }
}

/// The configuration of an iceoryx2 node; of no folder here.
pub fn iceoryx(_folder: &Path) -> Config {
    Config::default()
}
