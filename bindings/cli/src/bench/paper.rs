//! The speed table of the SMAClite paper ("Average seconds per timestep"), measured on this machine.

use smaclite_engine::{Arena, Rules, Scratch, policy};
use smaclite_lab::{AfterEpisode, TracePlayer};
use smaclite_scenarios::{Scenario, ScenarioError};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Episodes per scenario, as in the paper.
pub const EPISODES: usize = 20;

/// One row of the paper's table: seconds per timestep on an AMD Ryzen 3700X.
pub struct PaperRow {
    /// The scenario.
    pub scenario: &'static str,
    /// SMAC, with StarCraft II.
    pub smac: f64,
    /// SMAClite in Python.
    pub smaclite: f64,
    /// SMAClite with its C++ addon.
    pub smaclite_plus: f64,
}

const fn row(scenario: &'static str, smac: f64, smaclite: f64, smaclite_plus: f64) -> PaperRow {
    PaperRow { scenario, smac, smaclite, smaclite_plus }
}

/// The rows, in the paper's order.
pub const TABLE: [PaperRow; 6] = [
    row("2s_vs_1sc", 0.004, 0.007, 0.003),
    row("3s5z", 0.013, 0.018, 0.007),
    row("MMM2", 0.017, 0.028, 0.010),
    row("corridor", 0.014, 0.092, 0.010),
    row("3s_vs_5z", 0.006, 0.013, 0.005),
    row("bane_vs_bane", 0.049, 0.086, 0.024),
];

/// Average seconds per timestep over [`EPISODES`] episodes of random available actions, on one thread: the
/// step and all that a pool writes, without choosing the actions.
///
/// # Errors
/// If there is no such scenario.
pub fn seconds_per_step(scenario: &str) -> Result<f64, ScenarioError> {
    let arena = Arc::new(Arena::new(&Scenario::resolve(scenario)?, Rules::default()));
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
    Ok(time.as_secs_f64() / f64::from(steps))
}
