//! SIMD: four floats, or four vectors, at a time.
//!
//! Every entry is computed as a scalar would be, in the same order and never fused. So results have the same
//! bits as scalar code, and four neighbours or half-planes cost what one does.

use std::ops::{Add, Mul, Neg, Sub};

use glam::Vec2;
use wide::f32x4;

/// Four floats.
pub(crate) type F32x4 = f32x4;

/// The results of four comparisons: all bits of an entry set, or none.
pub(crate) type Mask = f32x4;

/// Number of values in a register.
pub(crate) const WIDTH: usize = 4;

/// Number of comparisons in one bit mask.
pub(crate) const MASK_BITS: usize = u64::BITS as usize;

/// Four vectors.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Vec2x4 {
    pub x: F32x4,
    pub y: F32x4,
}

impl Vec2x4 {
    pub fn new(vectors: [Vec2; WIDTH]) -> Vec2x4 {
        Vec2x4 { x: F32x4::new(vectors.map(|v| v.x)), y: F32x4::new(vectors.map(|v| v.y)) }
    }

    pub fn splat(vector: Vec2) -> Vec2x4 {
        Vec2x4 { x: F32x4::splat(vector.x), y: F32x4::splat(vector.y) }
    }

    pub fn dot(self, other: Vec2x4) -> F32x4 {
        self.x * other.x + self.y * other.y
    }

    pub fn length_squared(self) -> F32x4 {
        self.dot(self)
    }
}

impl Add for Vec2x4 {
    type Output = Vec2x4;
    fn add(self, other: Vec2x4) -> Vec2x4 {
        Vec2x4 { x: self.x + other.x, y: self.y + other.y }
    }
}

impl Sub for Vec2x4 {
    type Output = Vec2x4;
    fn sub(self, other: Vec2x4) -> Vec2x4 {
        Vec2x4 { x: self.x - other.x, y: self.y - other.y }
    }
}

impl Mul<F32x4> for Vec2x4 {
    type Output = Vec2x4;
    fn mul(self, factor: F32x4) -> Vec2x4 {
        Vec2x4 { x: self.x * factor, y: self.y * factor }
    }
}

impl Neg for Vec2x4 {
    type Output = Vec2x4;
    fn neg(self) -> Vec2x4 {
        Vec2x4 { x: -self.x, y: -self.y }
    }
}
