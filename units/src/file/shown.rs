//! Text of files and paths as error messages show it: on one line, and shortened.

use std::path::Path;

/// The largest number of characters that a message shows of a key, a name or a string.
const MAX_TEXT: usize = 60;

/// The largest number of characters that a message shows of a path. Of a longer path the end is shown,
/// because it identifies the file.
const MAX_PATH: usize = 400;

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
    let start: String = characters.by_ref().take(MAX_TEXT).map(printable).collect();
    if characters.next().is_some() { start + "..." } else { start }
}

/// A reason that may repeat a value of a file, on one line: its beginning and, if it is long, its end, where
/// parsers say the place.
///
/// ```
/// use smaclite_units::file::shown_reason;
///
/// let reason = format!("invalid type: string \"{}\" at line 1 column 9", "x".repeat(3000));
/// assert_eq!(shown_reason(&reason).len(), 303);
/// assert!(shown_reason(&reason).ends_with("xxx\" at line 1 column 9"));
/// ```
pub fn shown_reason(reason: &str) -> String {
    const START: usize = 200;
    const END: usize = 100;
    let characters: Vec<char> = reason.chars().map(printable).collect();
    if characters.len() <= START + END {
        return characters.into_iter().collect();
    }
    let (start, end) = (&characters[..START], &characters[characters.len() - END..]);
    start.iter().chain(&['.'; 3]).chain(end).collect()
}

/// The path, or its end if it is long, on one line.
pub fn shown_path(path: &Path) -> String {
    let path = path.to_string_lossy();
    let cut = path.char_indices().rev().nth(MAX_PATH - 1).map_or(0, |(start, _)| start);
    let end: String = path[cut..].chars().map(printable).collect();
    if cut > 0 { format!("...{end}") } else { end }
}

/// The text without what would change a terminal or the order of what it shows: control characters but line
/// feeds, and the controls of writing directions. Everything that comes from files and arguments is printed
/// by way of this.
///
/// ```
/// use smaclite_units::file::printable_text;
///
/// assert_eq!(printable_text("\u{1b}[31mred\nnext\u{202e}"), "?[31mred\nnext?");
/// ```
pub fn printable_text(text: &str) -> String {
    text.chars().map(|c| if c == '\n' { c } else { printable(c) }).collect()
}

/// The message without the numbers of the system's errors, which say nothing that the words before them do
/// not.
///
/// ```
/// use smaclite_units::file::without_os_errors;
///
/// let error = std::io::Error::from_raw_os_error(2);
/// assert_eq!(without_os_errors(&format!("{error}; try again")), "No such file or directory; try again");
/// ```
pub fn without_os_errors(message: &str) -> String {
    let mut pieces = message.split(" (os error ");
    let first = pieces.next().unwrap_or_default().to_owned();
    let after = |piece: &str| piece.split_once(')').map_or(String::new(), |(_, after)| after.to_owned());
    pieces.fold(first, |text, piece| text + &after(piece))
}

fn printable(c: char) -> char {
    const DIRECTIONS: [char; 3] = ['\u{200e}', '\u{200f}', '\u{61c}'];
    let is_direction = DIRECTIONS.contains(&c)
        || ('\u{202a}'..='\u{202e}').contains(&c)
        || ('\u{2066}'..='\u{2069}').contains(&c);
    if c.is_control() || is_direction { '?' } else { c }
}
