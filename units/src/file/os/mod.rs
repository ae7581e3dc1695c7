//! What differs between operating systems when files are read and written.

#[cfg(unix)]
mod unix;
#[cfg(unix)]
pub use unix::*;

#[cfg(windows)]
mod windows;
#[cfg(windows)]
pub use windows::*;

#[cfg(not(any(unix, windows)))]
mod browser;
#[cfg(not(any(unix, windows)))]
pub(in crate::file) use browser::*;
