//! Everything that measures: how fast the engine and whole pools step battles. `smaclite-pool bench` shows
//! the results of this library for any scenario; the program of this crate, `smaclite-benches`, produces
//! those in `benches/README.md`.

#![forbid(unsafe_code)]

pub mod paper;
pub mod play;
pub mod process;
pub mod throughput;
