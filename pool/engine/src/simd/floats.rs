//! Registers of floats and of conditions.

use std::ops::{Add, BitAnd, BitOr, Mul, Neg, Not, Sub};

use super::{Column, InstructionSet};

/// The sign bit of a float.
const SIGN: u32 = 1 << 31;

/// One float per entry.
#[derive(Clone, Copy, Debug)]
pub(crate) struct F32s<S: InstructionSet> {
    pub(super) value: S::f32s,
    pub(super) simd: S,
}

/// One condition per entry.
#[derive(Clone, Copy)]
pub(crate) struct Mask<S: InstructionSet> {
    pub(super) value: S::m32s,
    pub(super) simd: S,
}

impl<S: InstructionSet> F32s<S> {
    /// One number in every entry.
    #[inline(always)]
    pub fn splat(simd: S, x: f32) -> F32s<S> {
        F32s { value: simd.splat_f32s(x), simd }
    }

    /// The first entries of a column.
    #[inline(always)]
    pub fn load(simd: S, column: &Column) -> F32s<S> {
        F32s { value: S::as_simd_f32s(&column[..]).0[0], simd }
    }

    /// Overwrites the first entries of a column.
    #[inline(always)]
    pub fn store(self, column: &mut Column) {
        S::as_mut_simd_f32s(&mut column[..]).0[0] = self.value;
    }

    /// The floats of a slice, one register after the other; its length must be a multiple of their size.
    #[inline(always)]
    pub fn all(simd: S, slice: &[f32]) -> impl ExactSizeIterator<Item = F32s<S>> {
        S::as_simd_f32s(slice).0.iter().map(
            #[inline(always)]
            move |&value| F32s { value, simd },
        )
    }

    /// The first floats of a slice.
    #[inline(always)]
    pub fn from_slice(simd: S, slice: &[f32]) -> F32s<S> {
        F32s { value: S::as_simd_f32s(slice).0[0], simd }
    }

    /// Overwrites the first floats of a slice.
    #[inline(always)]
    pub fn to_slice(self, slice: &mut [f32]) {
        S::as_mut_simd_f32s(slice).0[0] = self.value;
    }

    /// The value of the instruction set, for making further registers.
    #[inline(always)]
    pub fn simd(self) -> S {
        self.simd
    }

    #[inline(always)]
    fn with(self, value: S::f32s) -> F32s<S> {
        F32s { value, simd: self.simd }
    }

    #[inline(always)]
    fn mask(self, value: S::m32s) -> Mask<S> {
        Mask { value, simd: self.simd }
    }

    /// The square root, correctly rounded.
    #[inline(always)]
    pub fn sqrt(self) -> F32s<S> {
        self.with(self.simd.sqrt_f32s(self.value))
    }

    /// The absolute value.
    #[inline(always)]
    pub fn abs(self) -> F32s<S> {
        // Not `abs_f32s` nor `neg_f32s`: these are not always inlined.
        let without_sign = self.simd.splat_f32s(f32::from_bits(!SIGN));
        self.with(self.simd.and_f32s(without_sign, self.value))
    }

    /// 1 / x, rounded.
    #[inline(always)]
    pub fn recip(self) -> F32s<S> {
        self.with(self.simd.div_f32s(self.simd.splat_f32s(1.0), self.value))
    }

    /// Division, rounded.
    #[inline(always)]
    pub fn div(self, other: F32s<S>) -> F32s<S> {
        self.with(self.simd.div_f32s(self.value, other.value))
    }

    /// The greatest integers that are at most these numbers.
    #[inline(always)]
    pub fn floor(self) -> F32s<S> {
        self.with(self.simd.floor(self.value))
    }

    /// The lesser of two numbers that are no NaN.
    #[inline(always)]
    pub fn min(self, other: F32s<S>) -> F32s<S> {
        self.with(self.simd.min_f32s(self.value, other.value))
    }

    /// The greater of two numbers that are no NaN.
    #[inline(always)]
    pub fn max(self, other: F32s<S>) -> F32s<S> {
        self.with(self.simd.max_f32s(self.value, other.value))
    }

    /// The least of numbers that are no NaN.
    #[inline(always)]
    pub fn least(self) -> f32 {
        self.simd.reduce_min_f32s(self.value)
    }

    /// The greatest of numbers that are no NaN.
    #[inline(always)]
    pub fn greatest(self) -> f32 {
        self.simd.reduce_max_f32s(self.value)
    }

    /// Where it is less; false for NaN, as all comparisons.
    #[inline(always)]
    pub fn lt(self, other: F32s<S>) -> Mask<S> {
        self.mask(self.simd.less_than_f32s(self.value, other.value))
    }

    /// Where it is less or equal.
    #[inline(always)]
    pub fn le(self, other: F32s<S>) -> Mask<S> {
        self.mask(self.simd.less_than_or_equal_f32s(self.value, other.value))
    }

    /// Where it is greater.
    #[inline(always)]
    pub fn gt(self, other: F32s<S>) -> Mask<S> {
        other.lt(self)
    }

    /// Where it is greater or equal.
    #[inline(always)]
    pub fn ge(self, other: F32s<S>) -> Mask<S> {
        other.le(self)
    }

    /// Where it is equal.
    #[inline(always)]
    pub fn eq(self, other: F32s<S>) -> Mask<S> {
        self.mask(self.simd.equal_f32s(self.value, other.value))
    }
}

impl<S: InstructionSet> Mask<S> {
    /// The conditions as bits, lowest entry first.
    #[inline(always)]
    pub fn bits(self) -> u32 {
        self.simd.bits(self.value)
    }

    /// The value of the instruction set, for making further registers.
    #[inline(always)]
    pub fn simd(self) -> S {
        self.simd
    }

    /// Exchanges two columns where the condition holds.
    #[inline(always)]
    pub fn swap(self, a: &mut Column, b: &mut Column) {
        let (x, y) = (F32s::load(self.simd, a), F32s::load(self.simd, b));
        self.select(y, x).store(a);
        self.select(x, y).store(b);
    }

    /// Whether the condition holds in any entry.
    #[inline(always)]
    pub fn any(self) -> bool {
        self.bits() != 0
    }

    /// The floats where the condition holds, elsewhere 0.
    #[inline(always)]
    pub fn keep(self, x: F32s<S>) -> F32s<S> {
        self.select(x, F32s::splat(self.simd, 0.0))
    }

    /// The first where the condition holds, elsewhere the second.
    #[inline(always)]
    pub fn select(self, this: F32s<S>, that: F32s<S>) -> F32s<S> {
        this.with(self.simd.select_f32s(self.value, this.value, that.value))
    }
}

impl<S: InstructionSet> Add for F32s<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.with(self.simd.add_f32s(self.value, other.value))
    }
}

impl<S: InstructionSet> Sub for F32s<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.with(self.simd.sub_f32s(self.value, other.value))
    }
}

impl<S: InstructionSet> Mul for F32s<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.with(self.simd.mul_f32s(self.value, other.value))
    }
}

impl<S: InstructionSet> Neg for F32s<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        let sign = self.simd.splat_f32s(f32::from_bits(SIGN));
        self.with(self.simd.xor_f32s(sign, self.value))
    }
}

impl<S: InstructionSet> BitAnd for Mask<S> {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Mask { value: self.simd.and_m32s(self.value, other.value), ..self }
    }
}

impl<S: InstructionSet> BitOr for Mask<S> {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Mask { value: self.simd.or_m32s(self.value, other.value), ..self }
    }
}

impl<S: InstructionSet> Not for Mask<S> {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Mask { value: self.simd.not_m32s(self.value), ..self }
    }
}
