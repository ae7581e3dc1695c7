//! Windows: folders and files of this user. Those in the user's folder of temporary files are private.

use crate::runtime_dir::error::RuntimeDirError;
use std::fs::{File, Metadata};
use std::os::windows::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

/// `FILE_ATTRIBUTE_TEMPORARY`: Windows keeps what is written in memory, and not on the disk, while there is
/// room.
const TEMPORARY: u32 = 0x100;

/// Where the runtime folder is by default.
pub(crate) fn default_root() -> PathBuf {
    std::env::temp_dir().join("smaclite-pool")
}

/// Makes the folder if it does not exist, and returns its whole path.
pub(crate) fn private_folder(root: PathBuf) -> Result<PathBuf, RuntimeDirError> {
    let created = std::fs::create_dir_all(&root).and_then(|()| std::path::absolute(&root));
    created.map_err(|source| RuntimeDirError::Create { root, source })
}

/// Every file of this user is.
pub(crate) fn is_private(_file: &Metadata) -> bool {
    true
}

/// Opens a file to write it; it is made if it does not exist.
pub(crate) fn private_file(path: &Path) -> std::io::Result<File> {
    File::options().create(true).truncate(false).read(true).write(true).open(path)
}

/// Opens a new file that does not outlive the processes that use it.
pub(crate) fn new_file(path: &Path) -> std::io::Result<File> {
    File::options().create_new(true).read(true).write(true).attributes(TEMPORARY).open(path)
}
