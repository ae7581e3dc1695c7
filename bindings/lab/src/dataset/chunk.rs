//! Arrays of some episodes that were played again, on their way to memory, files or hashes.

use super::Dataset;
use super::arrays::{ArrayName, N_ARRAYS, Rows};
use std::ops::Range;

/// Which arrays are wanted, by array.
pub(super) type Wanted = [bool; N_ARRAYS];

/// The arrays of some episodes that were played again.
pub(super) struct Chunk<'a> {
    pub episodes: Range<usize>,
    pub rows: &'a Rows<'a>,
}

impl Chunk<'_> {
    /// The rows of an array.
    pub fn bytes(&self, dataset: &Dataset, array: ArrayName) -> &[u8] {
        let steps = dataset.steps_of_all(&self.episodes).len();
        self.rows.bytes(array, 0..array.n_rows(steps, self.episodes.len()))
    }
}
