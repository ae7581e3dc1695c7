//! What the code needs of an instruction set beyond what `pulp` has, and the instruction sets themselves.

use pulp::Simd;
#[cfg(target_arch = "x86_64")]
use pulp::x86::{V2, V3, V4};

/// An instruction set.
pub(crate) trait InstructionSet: Simd {
    /// The number of floats in a register.
    const WIDTH: usize = Self::F32_LANES;

    /// The instruction set for few units: one with narrower registers, if its operations take less time.
    type Narrower: InstructionSet;

    /// The narrower one.
    fn narrower(self) -> Self::Narrower;

    /// The results of a comparison as bits, lowest entry first.
    fn bits(self, mask: Self::m32s) -> u32;

    /// The greatest integers that are at most these numbers.
    fn floor(self, x: Self::f32s) -> Self::f32s;
}

#[cfg(target_arch = "x86_64")]
impl InstructionSet for V4 {
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
impl InstructionSet for V3 {
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
impl InstructionSet for V2 {
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
impl InstructionSet for pulp::aarch64::Neon {
    type Narrower = Self;

    #[inline(always)]
    fn narrower(self) -> Self {
        self
    }

    #[inline(always)]
    fn bits(self, mask: pulp::m32x4) -> u32 {
        four_bits(mask)
    }

    #[inline(always)]
    fn floor(self, x: pulp::f32x4) -> pulp::f32x4 {
        bytemuck::cast(bytemuck::cast::<_, [f32; 4]>(x).map(f32::floor))
    }
}

/// Code for processors that are not named above: the compiler chooses the instructions.
impl InstructionSet for pulp::Scalar128b {
    type Narrower = Self;

    #[inline(always)]
    fn narrower(self) -> Self {
        self
    }

    #[inline(always)]
    fn bits(self, mask: pulp::m32x4) -> u32 {
        four_bits(mask)
    }

    #[inline(always)]
    fn floor(self, x: pulp::f32x4) -> pulp::f32x4 {
        bytemuck::cast(bytemuck::cast::<_, [f32; 4]>(x).map(f32::floor))
    }
}

/// The bits of a mask, where no instruction has them.
#[inline(always)]
fn four_bits(mask: pulp::m32x4) -> u32 {
    let [a, b, c, d]: [u32; 4] = bytemuck::cast(mask);
    a & 1 | b & 2 | c & 4 | d & 8
}
