//! Pools over a transport on the heap: everything between a request and a frame, without shared memory, files
//! or other processes. So these tests also run under Miri and valgrind (`just miri`, `just valgrind`).

mod game;
mod harness;
mod lanes;
mod refusals;
mod rounds;
mod shortage;
mod stepping;
mod transport;

/// Less where every instruction is interpreted.
const STEPS: usize = if cfg!(miri) { 3 } else { 60 };
const MANY_THREADS: usize = if cfg!(miri) { 2 } else { 4 };
