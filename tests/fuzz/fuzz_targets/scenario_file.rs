//! Any text as a scenario file: it is refused with a reason, or it is a scenario that can be played.
#![no_main]

#[path = "play.rs"]
mod play;

use libfuzzer_sys::{Corpus, fuzz_target};
use smaclite_scenarios::Scenario;
use std::path::Path;

/// A large battle is played by the tests; here it only makes fuzzing slow.
const LARGE: usize = 60;

fuzz_target!(|bytes: &[u8]| -> Corpus {
    let Ok(text) = std::str::from_utf8(bytes) else { return Corpus::Reject };
    // No folder: unit types are the standard ones.
    match Scenario::from_json(text, "fuzzed.json", Path::new("/nonexistent")) {
        Ok(scenario) if scenario.units.len() > LARGE => {}
        Ok(scenario) => play::a_while(&scenario),
        Err(error) => {
            let text = error.to_string();
            assert!(text.contains("fuzzed.json") && !text.contains('\n'), "{text:?}");
        }
    }
    Corpus::Keep
});
