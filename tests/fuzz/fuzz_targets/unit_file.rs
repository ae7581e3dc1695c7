//! The fuzzer of `tests/inputs/unit_file.rs`, which says what it reads.
#![no_main]

#[path = "../../inputs/unit_file.rs"]
mod unit_file;
#[path = "../../inputs/steps.rs"]
mod steps;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| unit_file::run(bytes));
