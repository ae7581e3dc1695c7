//! Writing files so that an error leaves what was there.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use tempfile::NamedTempFile;

/// Writes a file whole or not at all: under another name in its folder, which replaces the old file when it
/// is complete and on the disk. A link stays a link, and an old file's permissions stay. Every file is
/// written by this function or by [`write_new`]; what is no regular file, as a pipe, is written to.
///
/// # Errors
/// Those of `write` and of the system; the old file is unchanged.
pub fn write_whole<E: From<io::Error>>(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> Result<(), E>,
) -> Result<(), E> {
    let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let old = path.metadata().ok();
    if old.as_ref().is_some_and(|old| !old.is_file() && !old.is_dir()) {
        let mut output = BufWriter::new(std::fs::File::options().write(true).open(&path)?);
        write(&mut output)?;
        return Ok(output.flush()?);
    }
    let partial = partial_file(&path, "")?;
    if let Some(old) = old {
        partial.as_file().set_permissions(old.permissions())?;
    }
    fill(partial.as_file(), write)?;
    partial.persist(&path).map_err(|error| error.error)?;
    Ok(())
}

/// Checks that [`write_whole`] can begin this file, before work that takes long: makes a file beside it, and
/// removes it.
///
/// # Errors
/// Those of the system, and if it is a folder.
pub fn check_writable(path: &Path) -> io::Result<()> {
    let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    match path.metadata() {
        Ok(old) if old.is_dir() => Err(io::ErrorKind::IsADirectory.into()),
        Ok(old) if !old.is_file() => Ok(()),
        _ => partial_file(&path, "").map(drop),
    }
}

/// As [`write_whole`], of a file that must not exist yet: there is no moment at which it is empty or half.
///
/// # Errors
/// Those of `write` and of the system, also if the file exists; then it is unchanged.
pub fn write_new(path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    if path.symlink_metadata().is_ok() {
        return Err(io::ErrorKind::AlreadyExists.into());
    }
    let partial = partial_file(path, "")?;
    fill(partial.as_file(), write)?;
    partial.persist_noclobber(path).map_err(|error| error.error)?;
    Ok(())
}

/// Makes the file that gets this name when it is complete, in the same folder, with the permissions of a
/// user's other files. Its own name ends with the suffix.
///
/// # Errors
/// Those of the system. They do not name the file, which is no name that a user knows.
pub fn partial_file(path: &Path, suffix: &str) -> io::Result<NamedTempFile> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let make = |path: &Path| File::options().read(true).write(true).create_new(true).open(path);
    tempfile::Builder::new().suffix(suffix).make_in(folder, make)
}

/// Writes to the disk.
fn fill<E: From<io::Error>>(
    file: &File,
    write: impl FnOnce(&mut dyn Write) -> Result<(), E>,
) -> Result<(), E> {
    let mut output = BufWriter::new(file);
    write(&mut output)?;
    output.flush()?;
    Ok(file.sync_all()?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// The message was "No such file or directory at path \"missing/.tmpX1Y2Z3\"".
    #[test]
    fn errors_do_not_name_the_partial_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("missing/3m.json");
        let errors = [write_whole(&path, |_| io::Result::Ok(())), write_new(&path, |_| Ok(()))];
        for error in errors.map(Result::unwrap_err) {
            assert_eq!(error.kind(), io::ErrorKind::NotFound);
            assert!(!error.to_string().contains("path"), "{error}");
        }
    }

    #[test]
    fn an_error_leaves_the_old_file_and_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        fs::write(&path, "old").unwrap();
        let failed = write_whole(&path, |output| {
            output.write_all(b"half")?;
            Err(io::Error::other("the disk is full"))
        });
        assert_eq!(failed.unwrap_err().to_string(), "the disk is full");
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    /// On a full disk `new scenario` left an empty file, which the next one then refused to replace.
    #[test]
    fn an_error_leaves_no_new_file_and_an_old_one_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let failed = write_new(&path, |output| {
            output.write_all(b"half")?;
            Err(io::Error::other("the disk is full"))
        });
        assert_eq!(failed.unwrap_err().to_string(), "the disk is full");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        write_new(&path, |output| output.write_all(b"whole")).unwrap();
        let again = write_new(&path, |output| output.write_all(b"other"));
        assert_eq!(again.unwrap_err().kind(), io::ErrorKind::AlreadyExists);
        assert_eq!(fs::read_to_string(&path).unwrap(), "whole");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn links_and_permissions_stay() {
        let folder = tempfile::tempdir().unwrap();
        use std::fs::Permissions;
        use std::os::unix::fs::PermissionsExt;
        let (path, link) = (folder.path().join("file"), folder.path().join("link"));
        fs::write(&path, "old").unwrap();
        fs::set_permissions(&path, Permissions::from_mode(0o640)).unwrap();
        std::os::unix::fs::symlink(&path, &link).unwrap();
        write_whole(&link, |output| output.write_all(b"new")).unwrap();
        assert!(link.is_symlink());
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, 0o640);
    }
}
