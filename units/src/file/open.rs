//! What is said of a path that is not a file.

use std::path::Path;

/// What a path is that is not a file.
pub(super) fn not_a_file(path: &Path) -> String {
    let is_run = path.join("run.json").is_file();
    match path.is_dir() {
        true if is_run => "it is the folder of a run of `smaclite-pool train`, not a file".into(),
        true => "it is a folder, not a file".into(),
        false => "it is not a regular file".into(),
    }
}
