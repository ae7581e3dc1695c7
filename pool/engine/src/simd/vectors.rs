//! Registers of vectors.

use std::ops::{Add, Mul, Neg, Sub};

use glam::Vec2;

use super::{Column, F32s, InstructionSet, Mask};

/// One vector per entry.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Vec2s<S: InstructionSet> {
    pub x: F32s<S>,
    pub y: F32s<S>,
}

impl<S: InstructionSet> Vec2s<S> {
    /// One vector in every entry.
    #[inline(always)]
    pub fn splat(simd: S, vector: Vec2) -> Vec2s<S> {
        Vec2s { x: F32s::splat(simd, vector.x), y: F32s::splat(simd, vector.y) }
    }

    /// The first entries of two columns.
    #[inline(always)]
    pub fn load(simd: S, [x, y]: &[Column; 2]) -> Vec2s<S> {
        Vec2s { x: F32s::load(simd, x), y: F32s::load(simd, y) }
    }

    /// The entries of columns from `first` on, a multiple of the number of entries.
    #[inline(always)]
    pub fn load_from(simd: S, [x, y]: &[Column; 2], first: usize) -> Vec2s<S> {
        Vec2s { x: F32s::from_slice(simd, &x[first..]), y: F32s::from_slice(simd, &y[first..]) }
    }

    /// The vectors whose coordinates are in two slices, as [`F32s::all`].
    #[inline(always)]
    pub fn all(simd: S, x: &[f32], y: &[f32]) -> impl Iterator<Item = Vec2s<S>> {
        let (x, y) = (S::as_simd_f32s(x).0, S::as_simd_f32s(y).0);
        x.iter().zip(y).map(
            #[inline(always)]
            move |(&x, &y)| Vec2s { x: F32s { value: x, simd }, y: F32s { value: y, simd } },
        )
    }

    /// Overwrites the first entries of two columns.
    #[inline(always)]
    pub fn store(self, [x, y]: &mut [Column; 2]) {
        self.x.store(x);
        self.y.store(y);
    }

    /// The dot product.
    #[inline(always)]
    pub fn dot(self, other: Vec2s<S>) -> F32s<S> {
        self.x * other.x + self.y * other.y
    }

    /// The z of the cross product: positive if the other vector is to the left.
    #[inline(always)]
    pub fn perp_dot(self, other: Vec2s<S>) -> F32s<S> {
        self.x * other.y - self.y * other.x
    }

    /// The square of the length.
    #[inline(always)]
    pub fn length_squared(self) -> F32s<S> {
        self.dot(self)
    }

    /// Scaled to length 1, by the rounded reciprocal of the length.
    #[inline(always)]
    pub fn normalize(self) -> Vec2s<S> {
        self * self.length_squared().sqrt().recip()
    }

    /// Zero where a coordinate is infinite or NaN.
    #[inline(always)]
    pub fn finite_or_zero(self) -> Vec2s<S> {
        let zero = Vec2s::splat(self.x.simd, Vec2::ZERO);
        // NaN is less than nothing.
        let infinity = F32s::splat(self.x.simd, f32::INFINITY);
        let is_finite = self.x.abs().lt(infinity) & self.y.abs().lt(infinity);
        is_finite.either(self, zero)
    }
}

impl<S: InstructionSet> Mask<S> {
    /// The first where the condition holds, elsewhere the second.
    #[inline(always)]
    pub fn either(self, this: Vec2s<S>, that: Vec2s<S>) -> Vec2s<S> {
        Vec2s { x: self.select(this.x, that.x), y: self.select(this.y, that.y) }
    }
}

impl<S: InstructionSet> Add for Vec2s<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Vec2s { x: self.x + other.x, y: self.y + other.y }
    }
}

impl<S: InstructionSet> Sub for Vec2s<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Vec2s { x: self.x - other.x, y: self.y - other.y }
    }
}

impl<S: InstructionSet> Mul<F32s<S>> for Vec2s<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: F32s<S>) -> Self {
        Vec2s { x: self.x * factor, y: self.y * factor }
    }
}

impl<S: InstructionSet> Neg for Vec2s<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Vec2s { x: -self.x, y: -self.y }
    }
}
