//! Folders and files that only this user can open, and the files by which pools are found.

use crate::name::check_name;
pub(crate) use crate::os::unix::{PRIVATE, is_private, owner_and_mode};
use crate::runtime_dir::RuntimeDir;
use std::fs::{File, Metadata};
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::Path;

impl RuntimeDir {
    /// Names of the pools that have a socket here, dead or alive.
    pub fn pool_names(&self) -> Vec<String> {
        self.names_of(&[".sock"], |_| true)
    }

    /// Names of the pools that left a socket or a lock here, dead or alive. A pool's files are private and
    /// its lock is empty; other files with such names are not ours.
    pub(crate) fn stale_names(&self) -> Vec<String> {
        let is_pools = |file: &Metadata| {
            let is_lock = file.is_file() && file.len() == 0;
            (is_lock || file.file_type().is_socket()) && is_private(file)
        };
        self.names_of(&[".sock", ".lock"], is_pools)
    }

    fn names_of(&self, suffixes: &[&str], is_pools: impl Fn(&Metadata) -> bool) -> Vec<String> {
        let entries = std::fs::read_dir(self.root()).into_iter().flatten().flatten();
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

/// Is this still the file at `path`? Between the opening of a lock's file and its locking, its previous owner
/// may have removed it.
pub(crate) fn is_file_at(file: &File, path: &Path) -> bool {
    let same = |a: &Metadata, b: &Metadata| (a.dev(), a.ino()) == (b.dev(), b.ino());
    matches!((file.metadata(), path.metadata()), (Ok(ours), Ok(there)) if same(&ours, &there))
}
