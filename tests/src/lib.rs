//! Recorded battles of the published environment, and how the engine's battles are set beside them.
//!
//! The tests themselves are in the files next to this folder. Recordings are read from the folder that the
//! environment variable `SMACLITE_TRACES` names, else from `golden`; see `golden/README.md` for their format.
#![deny(unsafe_code)] // `pools::fork` says why it may

pub mod compare;
pub mod pools;
pub mod recording;

pub use recording::Recording;
