//! Reading JSON files of a known shape: what is wrong with a file, in one line that a person can act on.
//!
//! Objects keep the order of their keys, because the order of unit types in a group places the units, and a key
//! given twice is an error. What the keys mean is the business of the readers in `parse` and in
//! `smaclite-scenarios`.

mod error;
mod json;
mod node;

pub use error::{FileError, did_you_mean};
pub use json::Json;
pub use node::{Limits, Node, Object};

use std::io::Read;
use std::path::Path;

/// The largest file that is read, in bytes: a map of 1024 x 1024 squares fits, and a wrong path to something huge
/// does not fill the memory.
pub const MAX_FILE_BYTES: u64 = 8 << 20;

/// The text of a file of at most [`MAX_FILE_BYTES`].
///
/// # Errors
/// [`FileError::Unreadable`] if it is no regular file, too large, not UTF-8, or cannot be opened.
pub fn read_text(path: &Path) -> Result<String, FileError> {
    let unreadable = |reason: String| FileError::Unreadable { file: path.display().to_string(), reason };
    let metadata = std::fs::metadata(path).map_err(|error| unreadable(error.to_string()))?;
    if !metadata.is_file() {
        return Err(unreadable("it is not a regular file".into()));
    }
    let file = std::fs::File::open(path).map_err(|error| unreadable(error.to_string()))?;
    let mut bytes = Vec::new();
    // One byte over the limit shows a file that grew since its size was asked for.
    file.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes).map_err(|error| unreadable(error.to_string()))?;
    if bytes.len() as u64 > MAX_FILE_BYTES {
        return Err(unreadable(format!("it is larger than {} MiB", MAX_FILE_BYTES >> 20)));
    }
    String::from_utf8(bytes).map_err(|_| unreadable("it is not UTF-8 text".into()))
}
