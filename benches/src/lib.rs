//! Everything that measures: how fast the engine and whole pools step battles. `smaclite-pool bench` shows
//! the results of this library for any scenario; the program of this crate, `smaclite-benches`, produces
//! those in `benches/README.md`.

#![forbid(unsafe_code)]

pub mod null;
pub mod paper;
pub mod peers;
pub mod play;
pub mod process;
pub mod throughput;

/// The median; of an even number of values the upper of the two in the middle.
///
/// # Panics
/// If there are no values.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
