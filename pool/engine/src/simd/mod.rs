//! SIMD: computing several floats with one instruction.
//!
//! A register has [`WIDTH`](InstructionSet::WIDTH) *entries*: [`F32s`] has a float in each, [`Vec2s`] a
//! vector, [`Mask`] a condition; [`Column`] is a register in memory. Every entry is computed as a scalar
//! would be, in the same order and never fused, so results have the same bits whatever the width.
//!
//! There are two ways to use them:
//!
//! - A [`Kernel`] is compiled once per instruction set, and [`Level::run`] runs the code for the widest
//!   registers that the processor has. That is for work on many units, such as collision avoidance.
//! - [`x4`] has registers of four floats, which every processor has, and needs no kernel. That is for what
//!   comes in fours (the first features of a unit in an observation) and for searches that end after few
//!   units: wider registers would mostly be empty, or have to be transposed in memory.
//!
//! # How to write a kernel
//!
//! 1. Put what the code reads and writes into a struct, and implement [`Kernel`] for it.
//! 2. Write `run`, and all that it calls down to the arithmetic, as functions generic over the
//!    [`InstructionSet`] `S`, and pass the value `simd` of that type on.
//! 3. Mark each of these functions, and each closure in them, `#[inline(always)]`: what is not inlined is
//!    compiled for the oldest processor. `just instructions` shows if one was forgotten.
//! 4. Do not branch on an entry: compute all cases and [`select`](Mask::select). Skip what no entry needs,
//!    with [`any`](Mask::any).
//! 5. Test it at every level of [`Level::available`], against scalar code.

mod column;
mod floats;
mod instruction_set;
mod level;
mod vectors;
pub(crate) mod x4;

pub(crate) use column::{Column, MAX_WIDTH};
pub(crate) use floats::{F32s, Mask};
pub(crate) use instruction_set::InstructionSet;
pub(crate) use level::{Kernel, Level};
pub(crate) use vectors::Vec2s;
