//! Files and folders that commands write: what is refused before the work, and that they are written whole.

use crate::CommandResult;
use smaclite_units::file::{check_writable, write_whole};
use std::error::Error;
use std::io::{self, Write};
use std::path::Path;

/// Refuses a file where an option names a folder.
pub(crate) fn refuse_file(option: &str, out: &Path) -> CommandResult {
    if out.exists() && !out.is_dir() {
        return Err(format!("{option} must name a folder, but `{}` is a file", out.display()).into());
    }
    Ok(())
}

/// Refuses an --out for files of results that is a file, or the folder of a run, whose files they would hide
/// among.
pub(crate) fn check_out(out: &Path) -> CommandResult {
    refuse_file("--out", out)?;
    if smaclite_learn::DESCRIPTIONS.iter().any(|name| out.join(name).is_file()) {
        let out = out.display();
        return Err(
            format!("--out must not be the folder of a run, as `{out}` is; choose another one").into()
        );
    }
    Ok(())
}

/// Makes the folder of --out, before the work whose files it gets.
pub(crate) fn make_out(out: &Path) -> CommandResult {
    Ok(std::fs::create_dir_all(out).map_err(|error| format!("--out {}: {error}", out.display()))?)
}

/// Refuses a path, given by an option, whose folder does not exist, before battles are played for it.
pub(crate) fn check_folder_of(option: &str, path: &Path) -> CommandResult {
    match path.parent().filter(|folder| !folder.as_os_str().is_empty() && !folder.is_dir()) {
        None => Ok(()),
        Some(folder) => {
            let folder = folder.display();
            Err(format!("{option} must be in a folder that exists; there is no `{folder}`").into())
        }
    }
}

/// Refuses a file, given by an option, that cannot be written, before battles are played for it.
pub(crate) fn check_file_of(option: &str, path: &Path) -> CommandResult {
    check_folder_of(option, path)?;
    Ok(check_writable(path).map_err(|error| format!("{option} {}: {error}", path.display()))?)
}

/// Writes a file whole or not at all; errors name it.
pub(crate) fn write_file<E: Error + From<io::Error> + 'static>(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> Result<(), E>,
) -> CommandResult {
    Ok(write_whole(path, write).map_err(|error| format!("{}: {error}", path.display()))?)
}

/// Writes files, names with contents, to a folder: none where the disk is full before the last. Each is
/// complete before the next begins, and replaces an old one after the next has done so.
pub(crate) fn write_files(folder: &Path, files: &[(impl AsRef<Path>, impl AsRef<[u8]>)]) -> CommandResult {
    let [(name, content), others @ ..] = files else { return Ok(()) };
    let path = folder.join(name);
    let written = write_whole(&path, |output| -> CommandResult {
        output.write_all(content.as_ref())?;
        output.flush()?;
        write_files(folder, others)
    });
    // That of one of the others is named already.
    written.map_err(|error| match error.downcast::<io::Error>() {
        Ok(error) => format!("{}: {error}", path.display()).into(),
        Err(named) => named,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A full disk left some files of a new report among those of an old one.
    #[test]
    fn files_are_written_all_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let files = |b: &str, content: &str| ["a", b, "c"].map(|name| (name.to_owned(), content.to_owned()));
        let contents = || ["a", "c"].map(|name| std::fs::read_to_string(path(name)).unwrap());
        write_files(folder.path(), &files("b", "old")).unwrap();
        assert_eq!(contents(), ["old"; 2]);
        let error = write_files(folder.path(), &files("absent/b", "new")).unwrap_err().to_string();
        assert_eq!(error, format!("{}: No such file or directory (os error 2)", path("absent/b").display()));
        assert_eq!(contents(), ["old"; 2]);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3, "nothing is left beside them");
    }
}
