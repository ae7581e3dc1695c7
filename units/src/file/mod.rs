//! Checked reading of JSON files: every mistake becomes a [`Problem`] of one line that says where it is and
//! what is accepted, and the reader goes on to find the next one.
//!
//! Objects keep the order of their keys, because the order of unit types in a group decides where the units
//! start, and a duplicate key is a problem. The keys are declared in `keys` and in `smaclite-scenarios`.

mod hint;
mod json;
mod key;
mod node;
pub mod os;
mod problem;
mod shown;
mod syntax;
#[cfg(not(target_family = "wasm"))] // a browser has no files
mod write;

pub use hint::{did_you_mean, or_did_you_mean};
pub use json::without_mark;
pub use key::{
    AnyKey, Flag, Key, Kind, Presence, Range, SCHEMA_DIALECT, SCHEMA_KEY, Schema, Shape, Text, Whole, Word,
    Words, object_schema,
};
pub use node::{Document, Node, Object, Scalar};
pub use problem::{Problem, Problems, Report, Reported};
pub use shown::{printable_text, shortened, shown_path, shown_reason, without_os_errors};
#[cfg(not(target_family = "wasm"))]
pub use write::{check_writable, partial_file, write_new, write_whole};

use std::io::Read;
use std::path::Path;

/// The largest scenario file, in bytes: a map of 1024 x 1024 squares fits, and a wrong path to a huge file
/// does not fill the memory.
pub const MAX_SCENARIO_BYTES: u64 = 8 << 20;

/// The largest unit file, in bytes. A scenario may name a thousand of them.
pub const MAX_UNIT_BYTES: u64 = 64 << 10;

/// The text of a file of at most `max_bytes`, without a byte order mark. Every file is read by this function.
///
/// # Errors
/// [`Reported`] if it is no regular file, too large, not UTF-8, or cannot be opened.
pub fn read_text(path: &Path, max_bytes: u64, report: &Report) -> Result<String, Reported> {
    let unreadable = |reason: String| report.add_unreadable(shown_path(path), without_os_errors(&reason));
    let metadata = std::fs::metadata(path).map_err(|error| unreadable(error.to_string()))?;
    if !metadata.is_file() {
        return Err(unreadable(not_a_file(path)));
    }
    let file = os::without_waiting(path).map_err(|error| unreadable(error.to_string()))?;
    let mut bytes = Vec::new();
    // One byte over the limit detects a file that is larger, also one that grew after `metadata`.
    file.take(max_bytes + 1).read_to_end(&mut bytes).map_err(|error| unreadable(error.to_string()))?;
    if bytes.len() as u64 > max_bytes {
        let too_large = || format!("it is larger than {} KiB", max_bytes >> 10);
        return Err(unreadable(other_kind(path).unwrap_or_else(too_large)));
    }
    let not_text = |_| unreadable(other_kind(path).unwrap_or_else(|| "it is not UTF-8 text".into()));
    let text = String::from_utf8(bytes).map_err(not_text)?;
    let n_marked = text.len() - without_mark(&text).len();
    Ok(if n_marked > 0 { text[n_marked..].to_owned() } else { text })
}

/// What a file is that is not text. Files that this project writes are known by their names.
fn other_kind(path: &Path) -> Option<String> {
    let is = |what: &str, instead: &str| Some(format!("it is {what}, not a scenario; {instead}"));
    match path.extension().and_then(|suffix| suffix.to_str()) {
        Some("smdata") => is("a dataset", "open it by `smaclite_pool.Dataset`, or `smaclite-pool dataset`"),
        Some("smreplay") => is("a replay", "play it by `smaclite-pool replay`, and see its scenario there"),
        Some("snapshot") => is("a snapshot", "see it by `smaclite-pool show`, play on by `record --from`"),
        Some("safetensors") => is("the weights of a team", "load the folder by `smaclite_pool.load_team`"),
        _ => None,
    }
}

/// What a path is that is not a file.
fn not_a_file(path: &Path) -> String {
    let is_run = path.join("run.json").is_file();
    match path.is_dir() {
        true if is_run => "it is the folder of a run of `smaclite-pool train`, not a file".into(),
        true => "it is a folder, not a file".into(),
        false => "it is not a regular file".into(),
    }
}
