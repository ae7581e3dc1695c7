//! What the system is short of: the errors of systems other than Linux say it themselves.

use std::fmt::Display;
use std::io::Error;

/// Notes what the operating system refused to a storage of iceoryx2.
pub(crate) fn note(_error: &Error) {}

/// The likely cause of an error of iceoryx2 that just happened on this thread.
pub(crate) fn likely() -> Option<String> {
    None
}

/// What is short if that is why the operating system refused something.
pub(crate) fn of(_error: &Error) -> Option<String> {
    None
}

/// Whether a folder has no room.
pub(crate) fn full(_folder: impl Display, _remedy: &str) -> Option<String> {
    None
}
