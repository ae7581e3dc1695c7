//! Recorded play: the actions that a policy takes, to be replayed while time is measured.

use clap::ValueEnum;
use serde::Serialize;
use smaclite_engine::{Arena, Battle, Scratch, TICKS_PER_STEP, policy};
use std::sync::Arc;

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
pub(in crate::cli) enum Policy {
    /// Walk to and attack the nearest enemy; healers heal.
    Nearest,
    /// Uniformly random legal actions, drawn before.
    Random,
    /// The same, drawn by the client as it goes (bare engines, which have none, replay them).
    Sampled,
}

/// What one environment did from its seed on, with next-step autoreset.
pub(super) struct Replay {
    /// `[steps, n_agents]`; a step after an episode's end only resets.
    pub(super) actions: Vec<i32>,
    /// Is the step such a reset?
    pub(super) resets: Vec<bool>,
    /// Living units at the begin of each step, times the ticks of a step, summed.
    pub(super) unit_ticks: u64,
}

/// Steps that are recorded of each environment.
pub(super) const STEPS: usize = 128;
/// The seed of the first environment.
pub(super) const SEED: u64 = 1;

impl Replay {
    /// What the environments of a pool do.
    pub(super) fn of_pool(arena: &Arc<Arena>, envs: usize, policy: Policy) -> Vec<Replay> {
        (0..envs as u64).map(|env| Replay::record(arena, SEED + env, STEPS, policy)).collect()
    }

    fn record(arena: &Arc<Arena>, seed: u64, steps: usize, policy: Policy) -> Replay {
        let sizes = arena.sizes();
        let mut battle = Battle::new(Arc::clone(arena), seed);
        let mut scratch = Scratch::new();
        let mut random = policy::Random::new(seed);
        let mut row = vec![0; sizes.n_agents];
        let mut replay = Replay { actions: Vec::new(), resets: Vec::new(), unit_ticks: 0 };
        for _ in 0..steps {
            let over = battle.is_over();
            if over {
                battle.reset();
            } else {
                match policy {
                    Policy::Nearest => policy::nearest(&battle, &mut row),
                    Policy::Random | Policy::Sampled => random.act(&battle, &mut row),
                }
                let living = sizes.n_units() - battle.dead_allies() - battle.dead_enemies();
                replay.unit_ticks += (living * TICKS_PER_STEP) as u64;
                battle.step(&row, &mut scratch).expect("policies choose legal actions");
            }
            replay.actions.extend_from_slice(&row);
            replay.resets.push(over);
        }
        replay
    }

    pub(super) fn steps(&self) -> u64 {
        self.resets.iter().filter(|reset| !**reset).count() as u64
    }
}
