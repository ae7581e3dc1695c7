//! The battles of a pool's environments on one thread, without a pool: each is played to its end before the
//! next begins, or they are stepped in turn.

use super::{Counts, Interrupt, MeasureError, Mode, Workload};
use crate::bench::play::{AfterEpisode, Player, Recording};
use crate::process::resident_bytes;
use smaclite_engine::{Arena, Scratch};
use std::sync::Arc;
use std::time::Instant;

pub(super) fn measure(workload: &Workload, interrupt: Interrupt<'_>) -> Result<Counts, MeasureError> {
    let arena = Arc::new(Arena::new(&workload.scenario, workload.rules));
    let recordings = workload.record(&arena);
    let mut scratch = Scratch::new();
    let mut players: Vec<Player> = match workload.mode {
        Mode::InTurn => recordings.iter().map(|_| Player::new(Arc::clone(&arena))).collect(),
        _ => vec![Player::new(arena)],
    };
    let mut play_all = || match &mut players[..] {
        [player] => recordings.iter().for_each(|recording| player.play(recording, &mut scratch)),
        players => play_in_turn(players, &recordings, &mut scratch),
    };
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

/// Plays one step of each recording, then the next of each.
fn play_in_turn(players: &mut [Player], recordings: &[Recording], scratch: &mut Scratch) {
    players.iter_mut().zip(recordings).for_each(|(player, recording)| player.rewind(recording));
    for step in 0..super::RECORDED_STEPS {
        for (player, recording) in players.iter_mut().zip(recordings) {
            player.step(recording.step(step), AfterEpisode::Reset, scratch);
        }
    }
}
