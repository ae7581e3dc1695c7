//! The fuzzer of `tests/inputs/replay_file.rs`, which says what it reads.
#![no_main]

#[path = "../../inputs/replay_file.rs"]
mod replay_file;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| replay_file::run(bytes));
