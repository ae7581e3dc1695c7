//! Names of pools and lanes. They become parts of file names and of messages.

/// The longest name.
const MAX_LEN: usize = 40;

/// How much of a wrong name an error shows.
const SHOWN: usize = 60;

/// A text that cannot be the name of a pool or lane.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{}` cannot be a name: a name has 1 to {MAX_LEN} letters, digits, `-`, `_` or `.`, and no `.` at the \
     start",
    .0.chars().take(SHOWN).collect::<String>().escape_debug()
)]
pub struct NameError(String);

/// Checks that a pool or lane can have this name.
///
/// # Errors
/// If the name does not have 1 to 40 ASCII letters, digits, `-`, `_` or `.`, or begins with `.`.
pub fn check_name(name: &str) -> Result<(), NameError> {
    let is_allowed = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    if name.is_empty() || name.len() > MAX_LEN || !name.chars().all(is_allowed) || name.starts_with('.') {
        return Err(NameError(name.to_owned()));
    }
    Ok(())
}
