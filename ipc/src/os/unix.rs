//! Linux and macOS: folders and files that only this user can open.

use crate::runtime_dir::error::{MAX_ROOT_LEN, RuntimeDirError};
use rustix::fs::OFlags;
use std::fs::{File, Metadata};
use std::io::Error;
use std::os::fd::AsRawFd;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

/// The mode of a file that only this user can open.
pub(crate) const PRIVATE: u32 = 0o600;

/// Where the runtime folder is by default.
pub(crate) fn default_root() -> PathBuf {
    PathBuf::from(format!("/tmp/smaclite-pool-{}", rustix::process::getuid().as_raw()))
}

/// Makes the folder if it does not exist, checks that no other user can write to it, and returns its path
/// without links.
pub(crate) fn private_folder(root: PathBuf) -> Result<PathBuf, RuntimeDirError> {
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
    // A link that another user put into /tmp could lead to any folder of this user.
    let link = root.symlink_metadata().map_err(failed)?;
    let canonical = root.canonicalize().map_err(failed)?;
    let folder = canonical.metadata().map_err(failed)?;
    if link.is_symlink() && link.uid() != user {
        return Err(RuntimeDirError::LinkNotOurs { root, owner: link.uid(), user });
    }
    let root = canonical;
    if folder.uid() != user {
        return Err(RuntimeDirError::NotOurs { root, owner: folder.uid(), user });
    }
    if folder.mode() & 0o022 != 0 {
        return Err(RuntimeDirError::Open { root, mode: folder.mode() & 0o7777 });
    }
    Ok(root)
}

/// Owner, mode and size of a file, for errors.
pub(crate) fn owner_and_mode(file: &Metadata) -> String {
    let (user, mode, bytes) = (rustix::process::getuid().as_raw(), file.mode() & 0o7777, file.len());
    let kind = if file.is_file() { "it" } else { "it is not a plain file and" };
    format!(
        "{kind} belongs to user {} (this is user {user}), has mode {mode:o} and {bytes} bytes",
        file.uid()
    )
}

/// Whether a file is one that only this user can open.
pub(crate) fn is_private(file: &Metadata) -> bool {
    file.uid() == rustix::process::getuid().as_raw() && file.mode() & 0o7777 == PRIVATE
}

/// Opens or makes a file to lock or to write. The file is private even where the folder is not: another user
/// could block a pool by locking it. An existing file must be private and plain; to open a FIFO could block.
pub(crate) fn private_file(path: &Path) -> std::io::Result<File> {
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

/// Opens a new file that only this user can open.
#[allow(dead_code)] // not on Linux
pub(crate) fn new_file(path: &Path) -> std::io::Result<File> {
    File::options().create_new(true).read(true).write(true).mode(PRIVATE).open(path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime_dir::RuntimeDir;
    use std::fs::Permissions;
    use std::os::unix::fs::PermissionsExt;

    /// The messages were ": cannot be created: No such file or directory" and "File exists", without owner
    /// and remedy.
    #[test]
    fn what_cannot_be_a_root_folder_says_why() {
        let refused = |root: &Path| RuntimeDir::at(root.to_owned()).unwrap_err().to_string();
        assert!(
            refused(Path::new(""))
                .starts_with("the path of the runtime folder is empty; set SMACLITE_POOL_ROOT to a")
        );
        let folder = tempfile::tempdir().unwrap();
        let user = rustix::process::getuid().as_raw();
        let [file, link] = ["file", "link"].map(|name| folder.path().join(name));
        std::fs::write(&file, "").unwrap();
        std::os::unix::fs::symlink(folder.path().join("nothing"), &link).unwrap();
        for root in [&file, &link] {
            let text = refused(root);
            assert!(text.starts_with(&format!("{}: expected a folder; it", root.display())), "{text}");
            assert!(text.contains(&format!("belongs to user {user}")), "{text}");
            assert!(text.ends_with("set SMACLITE_POOL_ROOT to a private folder"), "{text}");
        }
    }

    /// In a container with a read-only `/tmp` the message said no remedy.
    #[test]
    fn a_folder_that_cannot_be_made_says_how_to_choose_another() {
        let text = RuntimeDir::at(PathBuf::from("/proc/smaclite-pool")).unwrap_err().to_string();
        assert!(text.starts_with("/proc/smaclite-pool: cannot be created: "), "{text}");
        assert!(text.ends_with("for example `SMACLITE_POOL_ROOT=/dev/shm/pools`"), "{text}");
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
