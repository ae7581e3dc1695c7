//! SIMD: as many floats at a time as a register of this processor holds.
//!
//! A *lane* is one entry of a register. Every lane is computed as a scalar would be, in the same order and
//! never fused, so results have the same bits whatever the width. Code is generic over [`Lanes`], and
//! [`Level::run`] compiles it once per instruction set and chooses the widest that the processor has.
//!
//! Functions from `run` down to the arithmetic must be `#[inline(always)]`: what is not inlined is compiled
//! for the oldest processor.

use std::ops::{Add, BitAnd, BitOr, Deref, DerefMut, Mul, Neg, Not, Sub};

use glam::Vec2;
use pulp::Simd;
#[cfg(target_arch = "x86_64")]
use pulp::x86::{V2, V3, V4};

/// The largest number of lanes of all levels.
pub(crate) const MAX_LANES: usize = 16;

/// The sign bit of a float.
const SIGN: u32 = 1 << 31;

/// One float per lane, as it is kept in memory: in one cache line, so that no register is loaded from two.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub(crate) struct Column([f32; MAX_LANES]);

impl Column {
    pub const ZERO: Column = Column([0.0; MAX_LANES]);

    /// The number of each lane.
    pub const NUMBERS: Column = {
        let mut numbers = [0.0; MAX_LANES];
        let mut lane = 0;
        while lane < MAX_LANES {
            numbers[lane] = lane as f32;
            lane += 1;
        }
        Column(numbers)
    };
}

impl Deref for Column {
    type Target = [f32; MAX_LANES];
    #[inline(always)]
    fn deref(&self) -> &[f32; MAX_LANES] {
        &self.0
    }
}

impl DerefMut for Column {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f32; MAX_LANES] {
        &mut self.0
    }
}

/// An instruction set.
pub(crate) trait Lanes: Simd {
    /// One with fewer lanes, if its operations take less time; else this one.
    type Narrower: Lanes;

    /// The narrower one.
    fn narrower(self) -> Self::Narrower;

    /// The results of a comparison as bits, lowest lane first.
    fn bits(self, mask: Self::m32s) -> u32;

    /// The greatest integers that are at most these numbers.
    fn floor(self, x: Self::f32s) -> Self::f32s;
}

/// Code for any instruction set.
pub(crate) trait Kernel {
    /// Must be `#[inline(always)]`.
    fn run<S: Lanes>(self, simd: S);
}

/// The instruction sets that code is compiled for.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Level {
    #[cfg(target_arch = "x86_64")]
    Avx512(V4),
    #[cfg(target_arch = "x86_64")]
    Avx2(V3),
    #[cfg(target_arch = "x86_64")]
    Sse(V2),
    #[cfg(target_arch = "aarch64")]
    Neon(pulp::aarch64::Neon),
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    Scalar(pulp::Scalar),
}

impl Level {
    /// Those of this processor, widest first.
    pub fn available() -> Vec<Level> {
        let levels = [
            #[cfg(target_arch = "x86_64")]
            V4::try_new().map(Level::Avx512),
            #[cfg(target_arch = "x86_64")]
            V3::try_new().map(Level::Avx2),
            #[cfg(target_arch = "x86_64")]
            V2::try_new().map(Level::Sse),
            #[cfg(target_arch = "aarch64")]
            pulp::aarch64::Neon::try_new().map(Level::Neon),
            #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
            Some(Level::Scalar(pulp::Scalar)),
        ];
        levels.into_iter().flatten().collect()
    }

    /// Its usual name.
    pub fn name(self) -> &'static str {
        match self {
            #[cfg(target_arch = "x86_64")]
            Level::Avx512(_) => "AVX-512",
            #[cfg(target_arch = "x86_64")]
            Level::Avx2(_) => "AVX2",
            #[cfg(target_arch = "x86_64")]
            Level::Sse(_) => "SSE4.2",
            #[cfg(target_arch = "aarch64")]
            Level::Neon(_) => "NEON",
            #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
            Level::Scalar(_) => "none",
        }
    }

    /// Runs code that was compiled for this instruction set.
    #[inline(always)]
    pub fn run(self, kernel: impl Kernel) {
        match self {
            #[cfg(target_arch = "x86_64")]
            Level::Avx512(simd) => simd.vectorize(Inlined(kernel, simd)),
            #[cfg(target_arch = "x86_64")]
            Level::Avx2(simd) => simd.vectorize(Inlined(kernel, simd)),
            #[cfg(target_arch = "x86_64")]
            Level::Sse(simd) => simd.vectorize(Inlined(kernel, simd)),
            #[cfg(target_arch = "aarch64")]
            Level::Neon(simd) => simd.vectorize(Inlined(kernel, simd)),
            #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
            Level::Scalar(simd) => kernel.run(simd),
        }
    }
}

impl Default for Level {
    fn default() -> Level {
        Level::available()[0]
    }
}

/// A kernel for one instruction set. A closure would do, but a closure is not always inlined.
struct Inlined<K, S>(K, S);

impl<K: Kernel, S: Lanes> pulp::NullaryFnOnce for Inlined<K, S> {
    type Output = ();
    #[inline(always)]
    fn call(self) {
        self.0.run(self.1);
    }
}

#[cfg(target_arch = "x86_64")]
impl Lanes for V4 {
    type Narrower = V3;

    #[inline(always)]
    fn narrower(self) -> V3 {
        *self
    }

    #[inline(always)]
    fn bits(self, mask: pulp::b16) -> u32 {
        u32::from(mask.0)
    }

    #[inline(always)]
    fn floor(self, x: pulp::f32x16) -> pulp::f32x16 {
        // Down, without exceptions.
        const DOWN: i32 = 0x09;
        bytemuck::cast(self.avx512f._mm512_roundscale_ps::<DOWN>(bytemuck::cast(x)))
    }
}

#[cfg(target_arch = "x86_64")]
impl Lanes for V3 {
    type Narrower = V3;

    #[inline(always)]
    fn narrower(self) -> V3 {
        self
    }

    #[inline(always)]
    fn bits(self, mask: pulp::m32x8) -> u32 {
        self.avx._mm256_movemask_ps(bytemuck::cast(mask)) as u32
    }

    #[inline(always)]
    fn floor(self, x: pulp::f32x8) -> pulp::f32x8 {
        bytemuck::cast(self.avx._mm256_floor_ps(bytemuck::cast(x)))
    }
}

#[cfg(target_arch = "x86_64")]
impl Lanes for V2 {
    type Narrower = V2;

    #[inline(always)]
    fn narrower(self) -> V2 {
        self
    }

    #[inline(always)]
    fn bits(self, mask: pulp::m32x4) -> u32 {
        self.sse._mm_movemask_ps(bytemuck::cast(mask)) as u32
    }

    #[inline(always)]
    fn floor(self, x: pulp::f32x4) -> pulp::f32x4 {
        bytemuck::cast(self.sse4_1._mm_floor_ps(bytemuck::cast(x)))
    }
}

#[cfg(target_arch = "aarch64")]
impl Lanes for pulp::aarch64::Neon {
    type Narrower = Self;

    #[inline(always)]
    fn narrower(self) -> Self {
        self
    }

    #[inline(always)]
    fn bits(self, mask: pulp::m32x4) -> u32 {
        let [a, b, c, d]: [u32; 4] = bytemuck::cast(mask);
        a & 1 | b & 2 | c & 4 | d & 8
    }

    #[inline(always)]
    fn floor(self, x: pulp::f32x4) -> pulp::f32x4 {
        bytemuck::cast(bytemuck::cast::<_, [f32; 4]>(x).map(f32::floor))
    }
}

impl Lanes for pulp::Scalar {
    type Narrower = Self;

    #[inline(always)]
    fn narrower(self) -> Self {
        self
    }

    #[inline(always)]
    fn bits(self, mask: bool) -> u32 {
        u32::from(mask)
    }

    #[inline(always)]
    fn floor(self, x: f32) -> f32 {
        x.floor()
    }
}

/// One float per lane.
#[derive(Clone, Copy)]
pub(crate) struct Floats<S: Lanes> {
    value: S::f32s,
    simd: S,
}

/// One condition per lane.
#[derive(Clone, Copy)]
pub(crate) struct Mask<S: Lanes> {
    value: S::m32s,
    simd: S,
}

impl<S: Lanes> Floats<S> {
    #[inline(always)]
    pub fn splat(simd: S, x: f32) -> Floats<S> {
        Floats { value: simd.splat_f32s(x), simd }
    }

    /// The first lanes of a column.
    #[inline(always)]
    pub fn load(simd: S, column: &Column) -> Floats<S> {
        Floats { value: S::as_simd_f32s(&column.0).0[0], simd }
    }

    #[inline(always)]
    pub fn store(self, column: &mut Column) {
        S::as_mut_simd_f32s(&mut column.0).0[0] = self.value;
    }

    /// The floats of a slice, one register after the other; its length must be a multiple of their size.
    #[inline(always)]
    pub fn all(simd: S, slice: &[f32]) -> impl ExactSizeIterator<Item = Floats<S>> {
        S::as_simd_f32s(slice).0.iter().map(
            #[inline(always)]
            move |&value| Floats { value, simd },
        )
    }

    /// The first floats of a slice.
    #[inline(always)]
    pub fn from_slice(simd: S, slice: &[f32]) -> Floats<S> {
        Floats { value: S::as_simd_f32s(slice).0[0], simd }
    }

    /// Overwrites the first floats of a slice.
    #[inline(always)]
    pub fn to_slice(self, slice: &mut [f32]) {
        S::as_mut_simd_f32s(slice).0[0] = self.value;
    }

    /// The floats one by one.
    #[cfg(test)]
    pub fn each(&self) -> &[f32] {
        bytemuck::cast_slice(std::slice::from_ref(&self.value))
    }

    #[inline(always)]
    pub fn simd(self) -> S {
        self.simd
    }

    #[inline(always)]
    fn with(self, value: S::f32s) -> Floats<S> {
        Floats { value, simd: self.simd }
    }

    #[inline(always)]
    fn mask(self, value: S::m32s) -> Mask<S> {
        Mask { value, simd: self.simd }
    }

    #[inline(always)]
    pub fn sqrt(self) -> Floats<S> {
        self.with(self.simd.sqrt_f32s(self.value))
    }

    #[inline(always)]
    pub fn abs(self) -> Floats<S> {
        // Not `abs_f32s` nor `neg_f32s`: these are not always inlined.
        let without_sign = self.simd.splat_f32s(f32::from_bits(!SIGN));
        self.with(self.simd.and_f32s(without_sign, self.value))
    }

    /// 1 / x, rounded.
    #[inline(always)]
    pub fn recip(self) -> Floats<S> {
        self.with(self.simd.div_f32s(self.simd.splat_f32s(1.0), self.value))
    }

    #[inline(always)]
    pub fn div(self, other: Floats<S>) -> Floats<S> {
        self.with(self.simd.div_f32s(self.value, other.value))
    }

    /// The greatest integers that are at most these numbers.
    #[inline(always)]
    pub fn floor(self) -> Floats<S> {
        self.with(self.simd.floor(self.value))
    }

    /// The lesser of two numbers that are no NaN.
    #[inline(always)]
    pub fn min(self, other: Floats<S>) -> Floats<S> {
        self.with(self.simd.min_f32s(self.value, other.value))
    }

    /// The greater of two numbers that are no NaN.
    #[inline(always)]
    pub fn max(self, other: Floats<S>) -> Floats<S> {
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

    #[inline(always)]
    pub fn lt(self, other: Floats<S>) -> Mask<S> {
        self.mask(self.simd.less_than_f32s(self.value, other.value))
    }

    #[inline(always)]
    pub fn le(self, other: Floats<S>) -> Mask<S> {
        self.mask(self.simd.less_than_or_equal_f32s(self.value, other.value))
    }

    #[inline(always)]
    pub fn gt(self, other: Floats<S>) -> Mask<S> {
        other.lt(self)
    }

    #[inline(always)]
    pub fn ge(self, other: Floats<S>) -> Mask<S> {
        other.le(self)
    }

    #[inline(always)]
    pub fn eq(self, other: Floats<S>) -> Mask<S> {
        self.mask(self.simd.equal_f32s(self.value, other.value))
    }
}

impl<S: Lanes> Mask<S> {
    #[inline(always)]
    pub fn bits(self) -> u32 {
        self.simd.bits(self.value)
    }

    #[inline(always)]
    pub fn simd(self) -> S {
        self.simd
    }

    /// Exchanges two columns where the condition holds.
    #[inline(always)]
    pub fn swap(self, a: &mut Column, b: &mut Column) {
        let (x, y) = (Floats::load(self.simd, a), Floats::load(self.simd, b));
        self.select(y, x).store(a);
        self.select(x, y).store(b);
    }

    #[inline(always)]
    pub fn any(self) -> bool {
        self.bits() != 0
    }

    /// The first where the condition holds, elsewhere the second.
    #[inline(always)]
    pub fn select(self, this: Floats<S>, that: Floats<S>) -> Floats<S> {
        this.with(self.simd.select_f32s(self.value, this.value, that.value))
    }

    /// The first where the condition holds, elsewhere the second.
    #[inline(always)]
    pub fn either(self, this: Vectors<S>, that: Vectors<S>) -> Vectors<S> {
        Vectors { x: self.select(this.x, that.x), y: self.select(this.y, that.y) }
    }
}

impl<S: Lanes> Add for Floats<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.with(self.simd.add_f32s(self.value, other.value))
    }
}

impl<S: Lanes> Sub for Floats<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.with(self.simd.sub_f32s(self.value, other.value))
    }
}

impl<S: Lanes> Mul for Floats<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.with(self.simd.mul_f32s(self.value, other.value))
    }
}

impl<S: Lanes> Neg for Floats<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        let sign = self.simd.splat_f32s(f32::from_bits(SIGN));
        self.with(self.simd.xor_f32s(sign, self.value))
    }
}

impl<S: Lanes> BitAnd for Mask<S> {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Mask { value: self.simd.and_m32s(self.value, other.value), ..self }
    }
}

impl<S: Lanes> BitOr for Mask<S> {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Mask { value: self.simd.or_m32s(self.value, other.value), ..self }
    }
}

impl<S: Lanes> Not for Mask<S> {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Mask { value: self.simd.not_m32s(self.value), ..self }
    }
}

/// One vector per lane.
#[derive(Clone, Copy)]
pub(crate) struct Vectors<S: Lanes> {
    pub x: Floats<S>,
    pub y: Floats<S>,
}

impl<S: Lanes> Vectors<S> {
    #[inline(always)]
    pub fn splat(simd: S, vector: Vec2) -> Vectors<S> {
        Vectors { x: Floats::splat(simd, vector.x), y: Floats::splat(simd, vector.y) }
    }

    #[inline(always)]
    pub fn load(simd: S, [x, y]: &[Column; 2]) -> Vectors<S> {
        Vectors { x: Floats::load(simd, x), y: Floats::load(simd, y) }
    }

    /// The lanes of columns from `first` on, a multiple of the number of lanes.
    #[inline(always)]
    pub fn load_from(simd: S, [x, y]: &[Column; 2], first: usize) -> Vectors<S> {
        Vectors { x: Floats::from_slice(simd, &x.0[first..]), y: Floats::from_slice(simd, &y.0[first..]) }
    }

    /// The vectors whose coordinates are in two slices, as [`Floats::all`].
    #[inline(always)]
    pub fn all(simd: S, x: &[f32], y: &[f32]) -> impl Iterator<Item = Vectors<S>> {
        let (x, y) = (S::as_simd_f32s(x).0, S::as_simd_f32s(y).0);
        x.iter().zip(y).map(
            #[inline(always)]
            move |(&x, &y)| Vectors { x: Floats { value: x, simd }, y: Floats { value: y, simd } },
        )
    }

    #[inline(always)]
    pub fn store(self, [x, y]: &mut [Column; 2]) {
        self.x.store(x);
        self.y.store(y);
    }

    #[inline(always)]
    pub fn dot(self, other: Vectors<S>) -> Floats<S> {
        self.x * other.x + self.y * other.y
    }

    #[inline(always)]
    pub fn perp_dot(self, other: Vectors<S>) -> Floats<S> {
        self.x * other.y - self.y * other.x
    }

    #[inline(always)]
    pub fn length_squared(self) -> Floats<S> {
        self.dot(self)
    }

    /// Scaled to length 1, by the rounded reciprocal of the length.
    #[inline(always)]
    pub fn normalize(self) -> Vectors<S> {
        self * self.length_squared().sqrt().recip()
    }

    /// Zero where a coordinate is infinite or NaN.
    #[inline(always)]
    pub fn finite_or_zero(self) -> Vectors<S> {
        let zero = Vectors::splat(self.x.simd, Vec2::ZERO);
        // NaN is less than nothing.
        let infinity = Floats::splat(self.x.simd, f32::INFINITY);
        let is_finite = self.x.abs().lt(infinity) & self.y.abs().lt(infinity);
        is_finite.either(self, zero)
    }
}

impl<S: Lanes> Add for Vectors<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Vectors { x: self.x + other.x, y: self.y + other.y }
    }
}

impl<S: Lanes> Sub for Vectors<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Vectors { x: self.x - other.x, y: self.y - other.y }
    }
}

impl<S: Lanes> Mul<Floats<S>> for Vectors<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: Floats<S>) -> Self {
        Vectors { x: self.x * factor, y: self.y * factor }
    }
}

impl<S: Lanes> Neg for Vectors<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Vectors { x: -self.x, y: -self.y }
    }
}
