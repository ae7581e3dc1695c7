//! The fuzzer of `tests/inputs/frame.rs`, which says what it reads.
#![no_main]

#[path = "../../inputs/frame.rs"]
mod frame;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| frame::run(bytes));
