//! Any text as a scenario file: it is refused with a reason, or it is a scenario whose battles can be
//! stepped.

use smaclite_scenarios::Scenario;
use std::path::Path;

/// Most units in a battle that is stepped: larger ones make fuzzing slow, and other tests step them.
const LARGE: usize = 60;

pub fn run(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    // No folder: unit types are the standard ones.
    match Scenario::from_json(text, "fuzzed.json", Path::new("/nonexistent")) {
        Ok(scenario) if scenario.units.len() > LARGE => {}
        Ok(scenario) => super::steps::run(&scenario),
        Err(error) => {
            let text = error.to_string();
            assert!(text.lines().count() <= 101, "{text:?}");
            assert!(text.lines().all(|line| line.starts_with("fuzzed.json:")), "{text:?}");
        }
    }
}
