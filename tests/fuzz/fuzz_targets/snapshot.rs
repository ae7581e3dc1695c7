//! The fuzzer of `tests/inputs/snapshot.rs`, which says what it reads.
#![no_main]

#[path = "../../inputs/snapshot.rs"]
mod snapshot;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| snapshot::run(bytes));
