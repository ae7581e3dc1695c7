//! How long a step takes in each scenario.

use crate::engine::{Plays, record};
use smaclite_cli::bench::play::{AfterEpisode, Player, Recording};
use smaclite_engine::Scratch;
use std::error::Error;
use std::time::{Duration, Instant};

/// Plays each scenario again and again for some seconds on one thread, and prints the time per living unit
/// and tick.
pub(crate) fn measure(plays: &Plays, seconds: f64) -> Result<(), Box<dyn Error>> {
    let time = Duration::try_from_secs_f64(seconds)
        .map_err(|error| format!("--seconds must be a number of at least 0, got {seconds} ({error})"))?;
    let policy = plays.policy.name();
    println!("policy {policy}, one thread; observations, state and available actions are written");
    println!("{:16} {:>14} {:>10} {:>12}", "scenario", "ns/unit/tick", "steps/s", "ns/step");
    let mut logarithms = Vec::new();
    for scenario in plays.scenarios() {
        let (mut player, recording) = record(&scenario, plays.policy, plays.steps)?;
        let mut shortest = vec![u64::MAX; plays.steps];
        let mut scratch = Scratch::new();
        let begin = Instant::now();
        while shortest.first() == Some(&u64::MAX) || begin.elapsed() < time {
            play_timed(&mut player, &recording, &mut scratch, &mut shortest);
        }
        let total = shortest.iter().sum::<u64>() as f64;
        let per_unit_tick = total / recording.unit_ticks() as f64;
        let per_step = total / plays.steps as f64;
        println!("{scenario:16} {per_unit_tick:14.1} {:10.0} {per_step:12.0}", 1e9 / per_step);
        logarithms.push(per_unit_tick.ln());
    }
    let mean = (logarithms.iter().sum::<f64>() / logarithms.len() as f64).exp();
    println!("{:16} {mean:14.1}", "geometric mean");
    Ok(())
}

/// Plays a recording and keeps the shortest time in nanoseconds that each of its steps has taken so far:
/// other programs share the processor, and a step usually ends before they interrupt it.
fn play_timed(player: &mut Player, recording: &Recording, scratch: &mut Scratch, shortest: &mut [u64]) {
    player.rewind(recording);
    for (actions, shortest) in recording.steps().zip(shortest) {
        let begin = Instant::now();
        player.step(actions, AfterEpisode::ResetAndPlay, scratch);
        *shortest = (*shortest).min(begin.elapsed().as_nanos() as u64);
    }
}
