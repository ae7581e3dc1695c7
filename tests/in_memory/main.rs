//! Pools with an in-memory transport: everything between a request and a frame, without shared memory, files
//! or other processes. So these tests also run under Miri and valgrind (`just miri`, `just valgrind`).

mod epochs;
mod frame_shortage;
mod harness;
mod lanes;
mod own_features;
mod rejections;
mod stepping;

/// Fewer under Miri, which is slow.
const STEPS: usize = if cfg!(miri) { 3 } else { 60 };
const MAX_THREADS: usize = if cfg!(miri) { 2 } else { 4 };
