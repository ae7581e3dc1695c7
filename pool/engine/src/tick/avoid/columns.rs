//! The vectors of many units, one column per coordinate.

use glam::Vec2;

use crate::simd::{F32s, InstructionSet, Vec2s};

/// Units whose search results are one word: bit i is unit `WORD * word + i`.
pub(super) const WORD: usize = u64::BITS as usize;

/// The coordinates of one vector per unit.
#[derive(Debug, Default)]
pub(super) struct Columns {
    pub x: Vec<f32>,
    pub y: Vec<f32>,
}

impl Columns {
    /// Makes both columns `n` long; new entries are 0.
    pub fn resize(&mut self, n: usize) {
        self.x.resize(n, 0.0);
        self.y.resize(n, 0.0);
    }

    /// A register of vectors, from this one on.
    #[inline(always)]
    pub fn load<S: InstructionSet>(&self, simd: S, begin: usize) -> Vec2s<S> {
        Vec2s { x: F32s::from_slice(simd, &self.x[begin..]), y: F32s::from_slice(simd, &self.y[begin..]) }
    }

    /// One vector.
    pub fn get(&self, index: usize) -> Vec2 {
        Vec2::new(self.x[index], self.y[index])
    }

    /// Exchanges two vectors.
    pub fn swap(&mut self, one: usize, other: usize) {
        self.x.swap(one, other);
        self.y.swap(one, other);
    }
}
