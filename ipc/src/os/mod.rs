//! What differs between operating systems, in modules with the same names and functions: `linux`, and
//! `portable`, which needs nothing of a system but files, locks of files and connections to this machine. A
//! pool on Linux that is built with `--cfg smaclite_portable` uses it too, for tests.

#[cfg(all(target_os = "linux", not(smaclite_portable)))]
mod linux;
#[cfg(all(target_os = "linux", not(smaclite_portable)))]
pub(crate) use linux::*;

#[cfg(any(not(target_os = "linux"), smaclite_portable))]
mod portable;
#[cfg(any(not(target_os = "linux"), smaclite_portable))]
pub(crate) use portable::*;

pub(crate) mod variant;

#[cfg(unix)]
pub(crate) mod unix;
#[cfg(unix)]
pub(crate) use unix as folders;

#[cfg(not(unix))]
pub(crate) mod windows;
#[cfg(not(unix))]
pub(crate) use windows as folders;

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
