//! Why a folder cannot be the runtime folder.

use std::path::PathBuf;

/// The environment variable that overrides the folder, for tests and for containers that share one. It must
/// be the same in all processes of a pool.
pub const ROOT_VARIABLE: &str = "SMACLITE_POOL_ROOT";

/// Linux limits paths of sockets to 108 bytes with the zero at their end; the longest is `ROOT/NAME.sock`.
pub(crate) const MAX_ROOT_LEN: usize = 60;

/// Why a folder cannot be the runtime folder.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum RuntimeDirError {
    #[error("the path of the runtime folder is empty; set {ROOT_VARIABLE} to a private folder or unset it")]
    Empty,
    #[error(
        "{root}: expected a folder; {found}; set {ROOT_VARIABLE} to a private folder",
        root = root.display()
    )]
    NotAFolder { root: PathBuf, found: String },
    #[error(
        "{root}: cannot be created: {source}; set {ROOT_VARIABLE} to a folder that this user may make or \
         write to, for example `{ROOT_VARIABLE}=/dev/shm/pools`",
        root = root.display()
    )]
    Create { root: PathBuf, source: std::io::Error },
    #[error(
        "{root}: belongs to user {owner}, not to user {user}; set {ROOT_VARIABLE} to a private folder",
        root = root.display()
    )]
    NotOurs { root: PathBuf, owner: u32, user: u32 },
    #[error(
        "{root}: is a link that user {owner} made, not user {user}; set {ROOT_VARIABLE} to a private folder",
        root = root.display()
    )]
    LinkNotOurs { root: PathBuf, owner: u32, user: u32 },
    #[error(
        "{root}: other users can write to it (mode {mode:o}); {}set {ROOT_VARIABLE} to a private folder",
        chmod(*mode), root = root.display()
    )]
    Open { root: PathBuf, mode: u32 },
    #[error(
        "{root}: must be at most {MAX_ROOT_LEN} bytes long; set {ROOT_VARIABLE} to a shorter path",
        root = root.display()
    )]
    TooLong { root: PathBuf },
}

/// A folder for all users, as /tmp, stays one.
fn chmod(mode: u32) -> &'static str {
    let is_for_all = mode & 0o1000 != 0;
    if is_for_all { "" } else { "`chmod 700` it or " }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The advice for /tmp was to close it to all other users.
    #[test]
    fn a_folder_for_all_users_is_not_to_be_closed() {
        let text = |mode| RuntimeDirError::Open { root: "/tmp".into(), mode }.to_string();
        assert!(text(0o777).ends_with("; `chmod 700` it or set SMACLITE_POOL_ROOT to a private folder"));
        assert!(text(0o1777).ends_with("; set SMACLITE_POOL_ROOT to a private folder"));
    }
}
