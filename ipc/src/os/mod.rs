//! What differs between operating systems, in modules with the same names and functions. On Linux other
//! processes attach to a pool. Elsewhere a pool serves the process that it runs in, and has no file and no
//! socket; so does one on Linux that is built with `--cfg smaclite_portable`, for tests.

#[cfg(all(target_os = "linux", not(smaclite_portable)))]
mod linux;
#[cfg(all(target_os = "linux", not(smaclite_portable)))]
pub use linux::*;

#[cfg(any(not(target_os = "linux"), smaclite_portable))]
mod portable;
#[cfg(any(not(target_os = "linux"), smaclite_portable))]
pub use portable::*;

/// What a wait for a control connection is for.
#[derive(Clone, Copy)]
pub(crate) enum Direction {
    Read,
    Write,
}

/// What a wait for control connections found.
pub(crate) struct Ready {
    pub(crate) stop: bool,
    pub(crate) listener: bool,
    /// By their order, ascending.
    pub(crate) connections: Vec<usize>,
}

/// Its tests run on every system.
#[cfg(all(test, target_os = "linux", not(smaclite_portable)))]
#[allow(dead_code)]
#[path = "portable/socket.rs"]
mod portable_socket;
