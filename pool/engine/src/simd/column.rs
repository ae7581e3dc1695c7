//! Floats in memory, one per entry of a register.

use std::ops::{Deref, DerefMut};

/// The largest number of entries of a register, of all instruction sets.
pub(crate) const MAX_WIDTH: usize = 16;

/// One float per entry, as it is kept in memory: in one cache line, so that no register is loaded from two.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub(crate) struct Column([f32; MAX_WIDTH]);

impl Column {
    /// 0 in every entry.
    pub const ZERO: Column = Column([0.0; MAX_WIDTH]);

    /// The number of each entry.
    pub const NUMBERS: Column = {
        let mut numbers = [0.0; MAX_WIDTH];
        let mut entry = 0;
        while entry < MAX_WIDTH {
            numbers[entry] = entry as f32;
            entry += 1;
        }
        Column(numbers)
    };
}

impl Deref for Column {
    type Target = [f32; MAX_WIDTH];
    #[inline(always)]
    fn deref(&self) -> &[f32; MAX_WIDTH] {
        &self.0
    }
}

impl DerefMut for Column {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f32; MAX_WIDTH] {
        &mut self.0
    }
}
