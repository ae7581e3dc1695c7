//! Text from files and paths as messages show it: on one line, and not much of what is long.

use std::path::Path;

/// The most characters of a key, a name or a string that a message shows.
const TEXT: usize = 60;

/// The most characters of a path: of a longer one the end says more than the beginning.
const PATH: usize = 400;

/// The beginning of `text`, on one line.
///
/// ```
/// use smaclite_units::file::shortened;
///
/// assert_eq!(shortened("hp"), "hp");
/// assert_eq!(shortened("two\nlines"), "two?lines");
/// assert_eq!(shortened(&"x".repeat(1_000_000)), format!("{}...", "x".repeat(60)));
/// ```
pub fn shortened(text: &str) -> String {
    let mut characters = text.chars();
    let start: String = characters.by_ref().take(TEXT).map(printable).collect();
    if characters.next().is_some() { start + "..." } else { start }
}

/// The path, or its end if it is long, on one line.
pub fn shown_path(path: &Path) -> String {
    let path = path.to_string_lossy();
    let cut = path.char_indices().rev().nth(PATH - 1).map_or(0, |(start, _)| start);
    let end: String = path[cut..].chars().map(printable).collect();
    if cut > 0 { format!("...{end}") } else { end }
}

fn printable(c: char) -> char {
    if c.is_control() { '?' } else { c }
}
