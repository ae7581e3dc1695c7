//! The lock by which one pool of this process at a time has a name.

use crate::runtime_dir::RuntimeDir;
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

static TAKEN: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn taken() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    TAKEN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The right to a pool's name, which ends when this is dropped.
pub(crate) struct NameLock(PathBuf);

impl NameLock {
    /// `None` if another pool has it.
    pub(crate) fn try_take(runtime_dir: &RuntimeDir, name: &str) -> std::io::Result<Option<NameLock>> {
        let path = runtime_dir.lock(name);
        Ok(taken().insert(path.clone()).then_some(NameLock(path)))
    }
}

impl Drop for NameLock {
    fn drop(&mut self) {
        taken().remove(&self.0);
    }
}
