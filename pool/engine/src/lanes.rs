//! Four floats, or four vectors, at a time.
//!
//! Each lane is counted as a single float would be, in the same order and never fused, so nothing here changes a
//! bit; it is only that four neighbours or half-planes cost what one does.

use std::ops::{Add, Mul, Neg, Sub};

use glam::Vec2;
use wide::f32x4;

/// Four floats, or the outcome of four comparisons.
pub(crate) type Floats = f32x4;

/// How many lanes there are.
pub(crate) const LANES: usize = 4;

/// How many lanes one mask has bits for.
pub(crate) const PART: usize = u64::BITS as usize;

/// In which lanes of up to [`PART`] a comparison holds, lowest bit first.
#[inline]
pub(crate) fn mask<T>(fours: &[T], compare: impl Fn(&T) -> Floats) -> u64 {
    let bits = |four| u64::from(compare(four).to_bitmask());
    fours.iter().enumerate().fold(0, |mask, (i, four)| mask | bits(four) << (LANES * i))
}

/// Four vectors.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Vectors {
    pub x: Floats,
    pub y: Floats,
}

impl Vectors {
    pub fn new(vectors: [Vec2; LANES]) -> Vectors {
        Vectors { x: Floats::new(vectors.map(|v| v.x)), y: Floats::new(vectors.map(|v| v.y)) }
    }

    pub fn splat(vector: Vec2) -> Vectors {
        Vectors { x: Floats::splat(vector.x), y: Floats::splat(vector.y) }
    }

    /// One of them.
    pub fn lane(&self, lane: usize) -> Vec2 {
        Vec2::new(self.x.as_array()[lane], self.y.as_array()[lane])
    }

    pub fn dot(self, other: Vectors) -> Floats {
        self.x * other.x + self.y * other.y
    }

    pub fn perp_dot(self, other: Vectors) -> Floats {
        self.x * other.y - self.y * other.x
    }

    pub fn length_squared(self) -> Floats {
        self.dot(self)
    }

    /// Where the comparison holds the first, elsewhere the second.
    pub fn either(holds: Floats, this: Vectors, that: Vectors) -> Vectors {
        Vectors { x: holds.select(this.x, that.x), y: holds.select(this.y, that.y) }
    }
}

impl Add for Vectors {
    type Output = Vectors;
    fn add(self, other: Vectors) -> Vectors {
        Vectors { x: self.x + other.x, y: self.y + other.y }
    }
}

impl Sub for Vectors {
    type Output = Vectors;
    fn sub(self, other: Vectors) -> Vectors {
        Vectors { x: self.x - other.x, y: self.y - other.y }
    }
}

impl Mul<Floats> for Vectors {
    type Output = Vectors;
    fn mul(self, factor: Floats) -> Vectors {
        Vectors { x: self.x * factor, y: self.y * factor }
    }
}

impl Neg for Vectors {
    type Output = Vectors;
    fn neg(self) -> Vectors {
        Vectors { x: -self.x, y: -self.y }
    }
}
