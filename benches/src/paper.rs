//! The time of a step as the paper measured it for SMAC and SMAClite: on average over episodes of random
//! available actions. It is that of the step and of all that a pool writes, without choosing the actions.

use smaclite_engine::{Arena, Rules, Scratch, policy};
use smaclite_lab::{AfterEpisode, TracePlayer};
use smaclite_scenarios::Scenario;
use std::error::Error;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Of the table of the paper, in its order.
const SCENARIOS: [&str; 6] = ["2s_vs_1sc", "3s5z", "MMM2", "corridor", "3s_vs_5z", "bane_vs_bane"];

/// Per scenario, as in the paper.
const EPISODES: usize = 20;

pub(crate) fn measure() -> Result<(), Box<dyn Error>> {
    println!("Microseconds per step, on one thread:");
    for name in SCENARIOS {
        println!("{name:<14}{:>6.1}", seconds_per_step(&Scenario::resolve(name)?) * 1e6);
    }
    Ok(())
}

fn seconds_per_step(scenario: &Scenario) -> f64 {
    let arena = Arc::new(Arena::new(scenario, Rules::default()));
    let mut actions = vec![0; arena.sizes().n_agents];
    let (mut player, mut random) = (TracePlayer::new(arena), policy::Random::new(0));
    let mut scratch = Scratch::new();
    let (mut steps, mut time) = (0u32, Duration::ZERO);
    for _ in 0..EPISODES {
        player.reset();
        while !player.battle().is_over() {
            random.act(player.battle(), &mut actions);
            let begin = Instant::now();
            player.step(&actions, AfterEpisode::Reset, &mut scratch);
            time += begin.elapsed();
            steps += 1;
        }
    }
    time.as_secs_f64() / f64::from(steps)
}
