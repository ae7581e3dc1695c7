//! The battles of a pool's environments on one thread, without a pool: each is played to its end before the
//! next begins.

use super::{Counts, Interrupt, MeasureError, Workload};
use crate::play::Player;
use crate::process::resident_bytes;
use smaclite_engine::{Arena, Rules};
use std::sync::Arc;
use std::time::Instant;

pub(super) fn measure(workload: &Workload, interrupt: Interrupt<'_>) -> Result<Counts, MeasureError> {
    let arena = Arc::new(Arena::new(&workload.scenario, Rules::default()));
    let recordings = workload.record(&arena);
    let mut player = Player::new(arena);
    let mut play_all = || recordings.iter().for_each(|recording| player.play(recording));
    play_all(); // warms up caches and scratch memory
    let begin = Instant::now();
    let mut passes = 0;
    while passes == 0 || begin.elapsed() < workload.time {
        play_all();
        passes += 1;
        interrupt.check()?;
    }
    Ok(Counts::of_recordings(&recordings, passes, begin.elapsed(), resident_bytes(std::process::id())))
}
