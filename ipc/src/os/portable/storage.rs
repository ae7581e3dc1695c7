//! What the storages of iceoryx2's services need of a system: files that are mapped, listed and removed.
//! There are no modes, so what a file contains says whether it is complete.

use crate::os::folders::new_file;
use iceoryx2::prelude::{FileName, Path as FolderPath, SemanticString};
use iceoryx2_cal::named_concept::{
    NamedConceptConfiguration, NamedConceptDoesExistError, NamedConceptListError, NamedConceptMgmt,
    NamedConceptPathHintRemoveError, NamedConceptRemoveError,
};
use memmap2::{MmapOptions, MmapRaw};
use std::fs::File;
use std::io::{Error, ErrorKind, Result, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Shared memory of this process.
#[derive(Debug)]
pub(crate) struct Mapping(MmapRaw);

impl Mapping {
    pub(crate) fn new(file: &File, bytes: usize, writable: bool) -> Result<Mapping> {
        let mut options = MmapOptions::new();
        options.len(bytes);
        Ok(Mapping(if writable { options.map_raw(file) } else { options.map_raw_read_only(file) }?))
    }

    #[inline]
    pub(crate) fn start(&self) -> *mut u8 {
        self.0.as_mut_ptr()
    }
}

/// A new file for a segment.
pub(crate) fn create_segment(path: &Path) -> Result<File> {
    create_exclusive(path)
}

/// The file of a segment. Its version says whether it is complete.
pub(crate) fn open_segment(path: &Path, writable: bool) -> Result<Option<File>> {
    File::options().read(true).write(writable).open(path).map(Some)
}

/// Gives a new segment its size. Windows sets the room aside on the disk.
pub(crate) fn reserve(file: &File, _path: &Path, bytes: u64) -> Result<()> {
    file.set_len(bytes)
}

/// Its version says it.
pub(crate) fn complete_segment(_file: &File) -> Result<()> {
    Ok(())
}

/// Bytes before the content of a small file: one more than its length, and 0 while it is written.
const HEADER: usize = 8;

/// A new small file.
pub(crate) fn create_small(path: &Path) -> Result<File> {
    create_exclusive(path)
}

/// Writes all of a small file, and lets others read it.
pub(crate) fn write_small(file: &mut File, content: &[u8]) -> Result<()> {
    file.write_all(&[0; HEADER])?;
    file.write_all(content)?;
    file.seek(SeekFrom::Start(0))?;
    file.write_all(&header(content))
}

/// The content of a small file, if it is complete.
pub(crate) fn read_small(path: &Path) -> Result<Option<Vec<u8>>> {
    let file = std::fs::read(path)?;
    let complete = file.split_first_chunk().filter(|(before, content)| **before == header(content));
    Ok(complete.map(|(_, content)| content.to_owned()))
}

fn header(content: &[u8]) -> [u8; HEADER] {
    (content.len() as u64 + 1).to_le_bytes()
}

/// A new file, and its folder if there is none.
fn create_exclusive(path: &Path) -> Result<File> {
    new_file(path).or_else(|error| match path.parent() {
        Some(folder) if error.kind() == ErrorKind::NotFound => {
            std::fs::create_dir_all(folder)?;
            new_file(path)
        }
        _ => Err(error),
    })
}

/// A path beside another that no process has used, and that iceoryx2 takes for none of its files.
pub(super) fn path_beside(path: &Path, what: &str) -> PathBuf {
    static NUMBER: AtomicU64 = AtomicU64::new(0); // publishes nothing
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    path.with_file_name(format!("{what}-{}-{number}", std::process::id()))
}

/// Removes a file, which then has its name no more, and says whether it existed. Windows removes none that
/// another process has mapped, and older versions keep the name of one that is open: so it gets another name
/// first. What cannot be removed is removed later, at the latest with its folder.
pub(super) fn remove_file(path: &Path) -> Result<bool> {
    static LEFT: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());
    let is_left =
        |path: &PathBuf| std::fs::remove_file(path).is_err_and(|error| error.kind() != ErrorKind::NotFound);
    let mut left = LEFT.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    left.retain(is_left);
    let beside = path_beside(path, "removed");
    match std::fs::rename(path, &beside) {
        Ok(()) => left.extend(Some(beside).filter(is_left)),
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(false),
        Err(_) => std::fs::remove_file(path)?, // or says why not
    }
    Ok(true)
}

/// Removes a file that no process needs any more.
pub(crate) fn discard(path: &Path) {
    let _ = remove_file(path);
}

/// Whether a segment exists.
pub(crate) fn exists<S: NamedConceptMgmt>(
    name: &FileName,
    config: &S::Configuration,
) -> std::result::Result<bool, NamedConceptDoesExistError> {
    path_for(name, config).try_exists().map_err(|error| match error.kind() {
        ErrorKind::PermissionDenied => NamedConceptDoesExistError::InsufficientPermissions,
        _ => NamedConceptDoesExistError::InternalError,
    })
}

/// Whether a small file exists; an error while it is being written.
pub(crate) fn small_exists<S: NamedConceptMgmt>(
    name: &FileName,
    config: &S::Configuration,
) -> std::result::Result<bool, NamedConceptDoesExistError> {
    match read_small(&path_for(name, config)) {
        Ok(Some(_)) => Ok(true),
        Ok(None) => Err(NamedConceptDoesExistError::UnderlyingResourcesBeingSetUp),
        Err(error) => match error.kind() {
            ErrorKind::NotFound => Ok(false),
            ErrorKind::PermissionDenied => Err(NamedConceptDoesExistError::InsufficientPermissions),
            _ => Err(NamedConceptDoesExistError::InternalError),
        },
    }
}

/// The names of all files, also of those that are not complete: what a killed process left of them is then
/// removed with its node.
pub(crate) fn list<S: NamedConceptMgmt>(
    config: &S::Configuration,
) -> std::result::Result<Vec<FileName>, NamedConceptListError> {
    let failed = |error: Error| match error.kind() {
        ErrorKind::PermissionDenied => NamedConceptListError::InsufficientPermissions,
        _ => NamedConceptListError::InternalError,
    };
    let entries = match std::fs::read_dir(config.get_path_hint().to_string()) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.map_err(failed)?,
    };
    let mut names = Vec::new();
    for entry in entries {
        let file = entry.map_err(failed)?.file_name();
        let file = FileName::new(file.as_encoded_bytes()).ok();
        names.extend(file.and_then(|file| config.extract_name_from_file(&file)));
    }
    Ok(names)
}

/// Removes a file, and says whether it existed.
///
/// # Safety
///
/// As [`NamedConceptMgmt::remove_cfg`].
#[allow(unsafe_code)] // as on Linux
pub(crate) unsafe fn remove<S: NamedConceptMgmt>(
    name: &FileName,
    config: &S::Configuration,
) -> std::result::Result<bool, NamedConceptRemoveError> {
    remove_file(&path_for(name, config)).map_err(|error| match error.kind() {
        ErrorKind::PermissionDenied => NamedConceptRemoveError::InsufficientPermissions,
        _ => NamedConceptRemoveError::InternalError,
    })
}

/// How long the name of a file that was removed can stay on older versions of Windows: while another process
/// reads it.
const READING_LASTS: Duration = Duration::from_millis(20);

/// Removes a folder that is empty.
pub(crate) fn remove_folder(folder: &FolderPath) -> std::result::Result<(), NamedConceptPathHintRemoveError> {
    let (folder, begin) = (folder.to_string(), Instant::now());
    loop {
        match std::fs::remove_dir(&folder).map_err(|error| error.kind()) {
            Ok(()) | Err(ErrorKind::NotFound) => return Ok(()),
            Err(ErrorKind::DirectoryNotEmpty) if begin.elapsed() < READING_LASTS => {
                std::thread::sleep(Duration::from_millis(1));
            }
            Err(ErrorKind::PermissionDenied) => {
                return Err(NamedConceptPathHintRemoveError::InsufficientPermissions);
            }
            Err(_) => return Err(NamedConceptPathHintRemoveError::InternalError),
        }
    }
}

pub(super) fn path_for(name: &FileName, config: &impl NamedConceptConfiguration) -> PathBuf {
    PathBuf::from(config.path_for(name).to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_file_is_read_when_it_is_complete() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("new").join("file");
        let mut file = create_small(&path).expect("a file, in a new folder");
        assert_eq!(create_small(&path).expect_err("it exists").kind(), ErrorKind::AlreadyExists);
        assert_eq!(read_small(&path).expect("a file"), None);
        write_small(&mut file, b"").expect("nothing is written");
        assert_eq!(read_small(&path).expect("a file"), Some(Vec::new()));
        file.seek(SeekFrom::Start(0)).expect("a file");
        write_small(&mut file, b"content").expect("it is written");
        assert_eq!(read_small(&path).expect("a file").as_deref(), Some(&b"content"[..]));
        file.set_len(12).expect("a file");
        assert_eq!(read_small(&path).expect("a file"), None);
    }

    #[test]
    fn a_file_that_is_mapped_can_be_removed_and_made_anew() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("file");
        let file = create_segment(&path).expect("a file");
        reserve(&file, &path, 1 << 16).expect("room");
        let mapping = Mapping::new(&file, 1 << 16, true).expect("memory");
        assert!(remove_file(&path).expect("a file"));
        assert!(!remove_file(&path).expect("no file"));
        create_segment(&path).expect("another file");
        drop((file, mapping));
        assert!(remove_file(&path).expect("the other file"));
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0);
    }
}
