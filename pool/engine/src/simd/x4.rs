//! Registers of four floats, or of twice two doubles, which every processor has: code that uses them needs no
//! kernel. On x86-64 the whole program is compiled for SSE4.2 (`.cargo/config.toml`).

use pulp::{Simd, f32x4, f64x2};

use super::{F32s, InstructionSet, Mask, Vec2s};

/// The instruction set with registers of four floats.
#[cfg(target_arch = "x86_64")]
pub(crate) type Four = pulp::x86::V2;
/// The instruction set with registers of four floats.
#[cfg(target_arch = "aarch64")]
pub(crate) type Four = pulp::aarch64::Neon;
/// The instruction set with registers of four floats.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
pub(crate) type Four = pulp::Scalar128b;

/// Four floats.
pub(crate) type F32x4 = F32s<Four>;

/// Four vectors.
pub(crate) type Vec2x4 = Vec2s<Four>;

/// Four conditions.
pub(crate) type Mask4 = Mask<Four>;

/// The number of floats in a register.
pub(crate) const WIDTH: usize = Four::WIDTH;

/// The value of the instruction set, with which registers are made.
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
#[inline(always)]
pub(crate) fn four() -> Four {
    Four::try_new().expect("a processor with SSE4.2 or NEON, for which this program is compiled")
}

/// The value of the instruction set, with which registers are made.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
#[inline(always)]
pub(crate) fn four() -> Four {
    pulp::Scalar128b
}

impl F32x4 {
    /// Four floats.
    #[inline(always)]
    pub fn new(four: Four, floats: [f32; WIDTH]) -> F32x4 {
        F32s { value: bytemuck::cast(floats), simd: four }
    }

    /// The four floats.
    #[inline(always)]
    pub fn to_array(self) -> [f32; WIDTH] {
        bytemuck::cast(self.value)
    }

    /// Four columns as rows: row i has entry i of each.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub fn transpose(columns: [F32x4; WIDTH]) -> [[f32; WIDTH]; WIDTH] {
        // The compiler needs half as many instructions again for the portable version.
        let sse = columns[0].simd.sse;
        let [a, b, c, d] = columns.map(|column| bytemuck::cast(column.value));
        let [low, high] = [sse._mm_unpacklo_ps(a, b), sse._mm_unpackhi_ps(a, b)];
        let [next_low, next_high] = [sse._mm_unpacklo_ps(c, d), sse._mm_unpackhi_ps(c, d)];
        [
            bytemuck::cast(sse._mm_movelh_ps(low, next_low)),
            bytemuck::cast(sse._mm_movehl_ps(next_low, low)),
            bytemuck::cast(sse._mm_movelh_ps(high, next_high)),
            bytemuck::cast(sse._mm_movehl_ps(next_high, high)),
        ]
    }

    /// Four columns as rows: row i has entry i of each.
    #[cfg(not(target_arch = "x86_64"))]
    #[inline(always)]
    pub fn transpose(columns: [F32x4; WIDTH]) -> [[f32; WIDTH]; WIDTH] {
        let columns = columns.map(F32x4::to_array);
        std::array::from_fn(|row| columns.map(|column| column[row]))
    }
}

impl Mask4 {
    /// The condition of one entry, in all entries.
    #[inline(always)]
    pub fn splat_entry(self, entry: usize) -> Mask4 {
        let pulp::m32x4(a, b, c, d) = self.value;
        let value = [a, b, c, d][entry];
        Mask { value: pulp::m32x4(value, value, value, value), ..self }
    }
}

impl Vec2x4 {
    /// Four vectors.
    #[inline(always)]
    pub fn new(four: Four, vectors: [glam::Vec2; WIDTH]) -> Vec2x4 {
        Vec2s { x: F32x4::new(four, vectors.map(|v| v.x)), y: F32x4::new(four, vectors.map(|v| v.y)) }
    }
}

/// Four doubles, in two registers.
#[derive(Clone, Copy)]
pub(crate) struct F64x4 {
    halves: [f64x2; 2],
    four: Four,
}

impl F64x4 {
    /// One number in every entry.
    #[inline(always)]
    pub fn splat(four: Four, x: f64) -> F64x4 {
        F64x4 { halves: [four.splat_f64s(x); 2], four }
    }

    /// The exact values of floats.
    #[inline(always)]
    pub fn widened(four: Four, [a, b, c, d]: [f32; WIDTH]) -> F64x4 {
        F64x4 { halves: [f64x2(a.into(), b.into()), f64x2(c.into(), d.into())], four }
    }

    /// The value of the instruction set, for making further registers.
    #[inline(always)]
    pub fn four(self) -> Four {
        self.four
    }

    /// Rounded to floats.
    #[inline(always)]
    pub fn rounded(self) -> F32x4 {
        let [f64x2(a, b), f64x2(c, d)] = self.halves;
        F32s { value: f32x4(a as f32, b as f32, c as f32, d as f32), simd: self.four }
    }

    #[inline(always)]
    fn zip(self, other: F64x4, of: impl Fn(f64x2, f64x2) -> f64x2) -> F64x4 {
        let ([a, b], [c, d]) = (self.halves, other.halves);
        F64x4 { halves: [of(a, c), of(b, d)], ..self }
    }

    /// Subtraction, rounded.
    #[inline(always)]
    pub fn sub(self, other: F64x4) -> F64x4 {
        self.zip(other, |a, b| self.four.sub_f64s(a, b))
    }

    /// Division, rounded.
    #[inline(always)]
    pub fn div(self, other: F64x4) -> F64x4 {
        self.zip(other, |a, b| self.four.div_f64s(a, b))
    }

    /// The square root, correctly rounded.
    #[inline(always)]
    pub fn sqrt(self) -> F64x4 {
        F64x4 { halves: self.halves.map(|two| self.four.sqrt_f64s(two)), ..self }
    }

    /// x * x + y * y, never fused.
    #[inline(always)]
    pub fn sum_of_squares(self, y: F64x4) -> F64x4 {
        let four = self.four;
        self.zip(y, |x, y| four.add_f64s(four.mul_f64s(x, x), four.mul_f64s(y, y)))
    }

    /// Where it is less or equal.
    #[inline(always)]
    pub fn le(self, other: F64x4) -> Mask4 {
        // A comparison sets all bits of an entry or none, so the lower half of an entry has its result.
        let ([a, b], [c, d]) = (self.halves, other.halves);
        let half = |a, b| bytemuck::cast::<_, [u32; 4]>(self.four.less_than_or_equal_f64s(a, b));
        let ([a, _, b, _], [c, _, d, _]) = (half(a, c), half(b, d));
        let all_bits = self.four.splat_u32s(u32::MAX);
        Mask { value: self.four.equal_u32s(pulp::u32x4(a, b, c, d), all_bits), simd: self.four }
    }
}
