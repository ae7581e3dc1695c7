//! What the system is short of. Most errors of systems other than Linux say it themselves.

use std::fmt::Display;
use std::io::Error;

/// Notes what the operating system refused to a storage of iceoryx2.
pub(crate) fn note(_error: &Error) {}

/// The likely cause of an error of iceoryx2 that just happened on this thread.
pub(crate) fn likely() -> Option<String> {
    None
}

/// What is short if that is why the operating system refused something.
pub(crate) fn of(error: &Error) -> Option<String> {
    let is_files = error.to_string().contains("Too many open files");
    is_files.then(|| "the limit on file descriptors is reached: raise it (`ulimit -n`)".to_owned())
}

/// Whether a folder has no room.
pub(crate) fn full(_folder: impl Display, _remedy: &str) -> Option<String> {
    None
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use rustix::io::Errno;

    /// "Too many open files" alone said nothing of a limit, which is 256 by default on macOS.
    #[test]
    fn a_limit_on_files_says_how_to_raise_it() {
        let remedy = of(&Errno::MFILE.into()).expect("a remedy");
        assert!(remedy.contains("`ulimit -n`"), "{remedy}");
        assert_eq!(of(&Errno::NOENT.into()), None);
    }
}
