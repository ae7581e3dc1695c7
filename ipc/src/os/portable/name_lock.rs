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
        let is_new = taken().insert(path.clone());
        // Not `then_some`: a lock that is made in vain would give up the name of the other pool.
        Ok(is_new.then(|| NameLock(path)))
    }
}

impl Drop for NameLock {
    fn drop(&mut self) {
        taken().remove(&self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::NameLock;
    use crate::runtime_dir::RuntimeDir;

    /// The second pool of a name waited for itself.
    #[test]
    fn a_name_is_taken_once_at_a_time() {
        let folder = tempfile::tempdir().expect("a folder");
        let runtime_dir = RuntimeDir::at(folder.path().join("pools")).expect("a runtime folder");
        let take = || NameLock::try_take(&runtime_dir, "one").expect("no file is needed");
        let first = take().expect("a free name");
        assert!(take().is_none());
        assert!(take().is_none(), "the attempt before freed the name");
        assert!(NameLock::try_take(&runtime_dir, "two").expect("no file is needed").is_some());
        drop(first);
        assert!(take().is_some());
    }
}
