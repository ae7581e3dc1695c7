//! Folders and files that only this user can open, and the files by which pools are found.

use crate::name::check_name;
pub(crate) use crate::os::unix::{PRIVATE, owner_and_mode};
use crate::runtime_dir::RuntimeDir;
use rustix::fs::OFlags;
use std::fs::{File, Metadata};
use std::io::Error;
use std::os::fd::AsRawFd;
use std::os::unix::fs::{FileTypeExt, MetadataExt, OpenOptionsExt};
use std::path::Path;

impl RuntimeDir {
    /// Names of the pools that have a socket here, dead or alive.
    pub fn pool_names(&self) -> Vec<String> {
        self.names_of(&[".sock"], |_| true)
    }

    /// Names of the pools that left a socket or a lock here, dead or alive. A pool's files are private and
    /// its lock is empty; other files with such names are not ours.
    pub(crate) fn stale_names(&self) -> Vec<String> {
        let user = rustix::process::getuid().as_raw();
        let is_pools = |file: &Metadata| {
            let is_lock = file.is_file() && file.len() == 0;
            (is_lock || file.file_type().is_socket()) && file.uid() == user && file.mode() & 0o7777 == PRIVATE
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

/// Opens or makes a file to lock. The file is private even where the folder is not: another user could
/// block a pool by locking it. An existing file must be private and plain; to open a FIFO could block.
pub(crate) fn lock_file(path: &Path) -> std::io::Result<File> {
    let named = |error: Error| Error::new(error.kind(), format!("{}: {error}", path.display()));
    let flags = (OFlags::NOFOLLOW | OFlags::NONBLOCK).bits() as i32;
    let mut options = File::options();
    options.create(true).truncate(false).read(true).write(true).mode(PRIVATE).custom_flags(flags);
    let file = options.open(path).map_err(named)?;
    let found = file.metadata().map_err(named)?;
    let user = rustix::process::getuid().as_raw();
    if found.is_file() && found.uid() == user && found.mode() & 0o077 == 0 {
        return beyond_standard(file).map_err(named);
    }
    Err(Error::other(format!("{}: expected a private file; {}", path.display(), owner_and_mode(&found))))
}

/// The file, under a descriptor that is none of the standard streams': in a process that was started without
/// these, what prints would write into it.
fn beyond_standard(file: File) -> std::io::Result<File> {
    match file.as_raw_fd() {
        0..3 => Ok(File::from(rustix::io::fcntl_dupfd_cloexec(&file, 3)?)),
        _ => Ok(file),
    }
}

/// Is this still the file at `path`? Between the opening of a lock's file and its locking, its previous owner
/// may have removed it.
pub(crate) fn is_file_at(file: &File, path: &Path) -> bool {
    let same = |a: &Metadata, b: &Metadata| (a.dev(), a.ino()) == (b.dev(), b.ino());
    matches!((file.metadata(), path.metadata()), (Ok(ours), Ok(there)) if same(&ours, &there))
}
