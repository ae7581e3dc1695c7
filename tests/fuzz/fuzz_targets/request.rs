//! The fuzzer of `tests/inputs/request.rs`, which says what it reads.
#![no_main]

#[path = "../../inputs/request.rs"]
mod request;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| request::run(bytes));
