//! Any JSON as a replay file: it is refused with a reason, or its episodes are reproduced, or the first step
//! that differs is named. Compression is a fuzzer's dead end, so the bytes are compressed here.

use std::io::Write;

use flate2::{Compression, write::GzEncoder};
use smaclite_view::{Replay, export_html};

/// More would only make fuzzing slow.
const MOST_UNITS: usize = 60;
const MOST_STEPS: u32 = 200;

pub fn run(json: &[u8]) {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(json).expect("a vector takes everything");
    let bytes = encoder.finish().expect("a vector takes everything");
    let Ok(replay) = Replay::from_bytes(&bytes, "fuzzed.smreplay") else { return };
    let is_small = replay.scenario().units.len() <= MOST_UNITS
        && replay.episodes().iter().map(|episode| episode.outcome.steps).sum::<u32>() <= MOST_STEPS;
    if is_small {
        let can_be_shown = replay.verify().is_ok() && !replay.episodes().is_empty();
        assert_eq!(can_be_shown, export_html(&replay).is_ok());
        let again =
            Replay::from_bytes(&replay.to_bytes().expect("a small replay"), "again").expect("our own");
        assert_eq!(again.episodes().len(), replay.episodes().len());
    }
}
