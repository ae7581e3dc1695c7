//! Any text as a unit file: it is refused with a reason, or battles with such units, and with others, can be
//! stepped.

use smaclite_scenarios::Scenario;
use smaclite_units::UnitType;

pub fn run(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    match UnitType::from_json(text, "FUZZED", "fuzzed.json") {
        Ok(unit) => {
            // Near enough to fight in the first step: the stalkers of one side against the zealots of the
            // other, one of the two types fuzzed.
            let mut scenario = Scenario::standard("2s3z").expect("a standard scenario");
            scenario.unit_types[0] = unit;
            for (i, placement) in scenario.units.iter_mut().enumerate() {
                placement.position = [14.0 + (i % 3) as f64, 15.0 + (i / 3) as f64];
            }
            super::steps::run(&scenario);
        }
        Err(error) => {
            let text = error.to_string();
            assert!(text.lines().count() <= 101, "{text:?}");
            assert!(text.lines().all(|line| line.starts_with("fuzzed.json:")), "{text:?}");
        }
    }
}
