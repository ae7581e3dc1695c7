//! How long a step takes in each scenario: in battles that are played for the first time, as users play them,
//! and in a battle that is played again and again, which the branch predictor learns.

use crate::engine::{Plays, record};
use smaclite_cli::bench::throughput::median;
use smaclite_engine::Scratch;
use smaclite_lab::{ActionTrace, AfterEpisode, TracePlayer};
use std::error::Error;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Plays each scenario on one thread, and prints the time per living unit and tick.
pub(crate) fn measure(plays: &Plays, seconds: f64) -> Result<(), Box<dyn Error>> {
    let time = Duration::try_from_secs_f64(seconds)
        .map_err(|error| format!("--seconds must be a number of at least 0, got {seconds} ({error})"))?;
    let policy = plays.policy.name();
    println!("policy {policy}, one thread; observations, state and available actions are written");
    println!("ns per living unit and tick, and steps/s");
    println!("{:16} {:>8} {:>10} {:>10} {:>10}", "scenario", "fresh", "steps/s", "replayed", "steps/s");
    let mut logarithms = [Vec::new(), Vec::new()];
    for scenario in plays.scenarios() {
        let (mut player, trace) = record(&scenario, plays.rules, plays.policy, plays.steps)?;
        let fresh = fresh(&mut player, plays, time);
        let replayed = replayed(&mut player, &trace, time);
        println!(
            "{scenario:16} {:8.1} {:10.0} {:10.1} {:10.0}",
            fresh.per_unit_tick,
            1e9 / fresh.per_step,
            replayed.per_unit_tick,
            1e9 / replayed.per_step
        );
        logarithms[0].push(fresh.per_unit_tick.ln());
        logarithms[1].push(replayed.per_unit_tick.ln());
    }
    let mean = |logarithms: &Vec<f64>| (logarithms.iter().sum::<f64>() / logarithms.len() as f64).exp();
    let [fresh, replayed] = logarithms.each_ref().map(mean);
    println!("{:16} {fresh:8.1} {:>10} {replayed:10.1}", "geometric mean", "");
    Ok(())
}

/// Nanoseconds.
struct Times {
    /// Per living unit and tick.
    per_unit_tick: f64,
    per_step: f64,
}

/// The times of battles that are played for the first time: medians over battles from seed 2 on.
fn fresh(player: &mut TracePlayer, plays: &Plays, time: Duration) -> Times {
    // A trace is made by playing. Until the battle is measured, so many others are played that the branch
    // predictor has forgotten it.
    const GROUP: u64 = 16;
    let arena = Arc::clone(player.battle().arena());
    let (mut per_unit_tick, mut per_step) = (Vec::new(), Vec::new());
    let (mut scratch, mut seed) = (Scratch::new(), 2);
    let begin = Instant::now();
    while per_step.is_empty() || begin.elapsed() < time {
        let new = |seed| plays.policy.record(&arena, seed, plays.steps, AfterEpisode::ResetAndPlay);
        let traces: Vec<ActionTrace> = (seed..seed + GROUP).map(new).collect();
        seed += GROUP;
        for trace in &traces {
            let begin = Instant::now();
            player.play(trace, &mut scratch);
            let total = begin.elapsed().as_nanos() as f64;
            per_unit_tick.push(total / trace.unit_ticks() as f64);
            per_step.push(total / plays.steps as f64);
        }
    }
    Times { per_unit_tick: median(per_unit_tick), per_step: median(per_step) }
}

/// The times of a battle that is played again and again, from the shortest time of each step.
fn replayed(player: &mut TracePlayer, trace: &ActionTrace, time: Duration) -> Times {
    let mut shortest = vec![u64::MAX; trace.steps().count()];
    let mut scratch = Scratch::new();
    let begin = Instant::now();
    while shortest.first() == Some(&u64::MAX) || begin.elapsed() < time {
        play_timed(player, trace, &mut scratch, &mut shortest);
    }
    let total = shortest.iter().sum::<u64>() as f64;
    Times { per_unit_tick: total / trace.unit_ticks() as f64, per_step: total / shortest.len() as f64 }
}

/// Plays a trace and keeps the shortest time in nanoseconds that each of its steps has taken so far:
/// other programs share the processor, and a step usually ends before they interrupt it.
fn play_timed(player: &mut TracePlayer, trace: &ActionTrace, scratch: &mut Scratch, shortest: &mut [u64]) {
    player.rewind(trace);
    for (actions, shortest) in trace.steps().zip(shortest) {
        let begin = Instant::now();
        player.step(actions, AfterEpisode::ResetAndPlay, scratch);
        *shortest = (*shortest).min(begin.elapsed().as_nanos() as u64);
    }
}
