//! The time of a step, for every scenario.

use std::error::Error;
use std::time::{Duration, Instant};

use super::Plays;
use super::play::Play;

/// Plays each scenario repeatedly for `seconds`, on one thread, and prints the time per living unit and tick.
pub(crate) fn times(plays: &Plays, seconds: f64) -> Result<(), Box<dyn Error>> {
    println!("{} player, one thread, observation, state and availability written in each step", plays.policy);
    println!("{:16} {:>14} {:>10} {:>12}", "scenario", "ns/unit/tick", "steps/s", "ns/step");
    let mut logarithms = Vec::new();
    for scenario in plays.scenarios() {
        let mut play = Play::record(&scenario, &plays.policy, plays.steps)?;
        let mut shortest = vec![u64::MAX; play.steps()];
        let begin = Instant::now();
        while shortest[0] == u64::MAX || begin.elapsed() < Duration::from_secs_f64(seconds) {
            play.play_timed(&mut shortest);
        }
        let total = shortest.iter().sum::<u64>() as f64;
        let (of_unit, of_step) = (total / play.unit_ticks as f64, total / play.steps() as f64);
        println!("{scenario:16} {of_unit:14.1} {:10.0} {of_step:12.0}", 1e9 / of_step);
        logarithms.push(of_unit.ln());
    }
    let mean = (logarithms.iter().sum::<f64>() / logarithms.len() as f64).exp();
    println!("{:16} {mean:14.1}", "geometric mean");
    Ok(())
}
