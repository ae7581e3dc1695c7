//! The fuzzer of `tests/inputs/scenario_file.rs`, which says what it reads.
#![no_main]

#[path = "../../inputs/scenario_file.rs"]
mod scenario_file;
#[path = "../../inputs/steps.rs"]
mod steps;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| scenario_file::run(bytes));
