//! The battles of a pool's environments on one thread, without a pool: each is played to its end before the
//! next begins, or they are stepped in turn.

use super::{Counts, Interrupt, MeasureError, Mode, Workload};
use crate::process::resident_bytes;
use smaclite_engine::Scratch;
use smaclite_lab::{ActionTrace, AfterEpisode, TracePlayer};
use std::sync::Arc;
use std::time::Instant;

pub(super) fn measure(workload: &Workload, interrupt: Interrupt<'_>) -> Result<Counts, MeasureError> {
    let arena = workload.arena()?;
    let traces = workload.record(&arena);
    let mut scratch = Scratch::new();
    let mut players: Vec<TracePlayer> = match workload.mode {
        Mode::InTurn => traces.iter().map(|_| TracePlayer::new(Arc::clone(&arena))).collect(),
        _ => vec![TracePlayer::new(arena)],
    };
    let mut play_all = || match &mut players[..] {
        [player] => traces.iter().for_each(|trace| player.play(trace, &mut scratch)),
        players => play_in_turn(players, &traces, &mut scratch),
    };
    play_all(); // warms up caches and scratch memory
    let begin = Instant::now();
    let mut passes = 0;
    while passes == 0 || begin.elapsed() < workload.time {
        play_all();
        passes += 1;
        interrupt.check()?;
    }
    Ok(Counts::of_traces(&traces, passes, begin.elapsed(), resident_bytes(std::process::id())))
}

/// Plays one step of each trace, then the next of each.
fn play_in_turn(players: &mut [TracePlayer], traces: &[ActionTrace], scratch: &mut Scratch) {
    players.iter_mut().zip(traces).for_each(|(player, trace)| player.rewind(trace));
    for step in 0..super::RECORDED_STEPS {
        for (player, trace) in players.iter_mut().zip(traces) {
            player.step(trace.step(step), AfterEpisode::Reset, scratch);
        }
    }
}
