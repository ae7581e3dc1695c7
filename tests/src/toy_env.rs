//! A small environment for tests that need no battle. Each of its outputs depends on its whole history: seed,
//! resets, actions, and their order. So one that is lost, repeated or swapped shows in the next frame.

use smaclite_engine::{Scratch, Sizes, Step};
use smaclite_pool::environment::{Environment, JointAction};
use std::hash::{DefaultHasher, Hash, Hasher};

/// The name that stands for this environment where a plan names a scenario.
pub const TOY: &str = "toy";

/// The sizes of every toy environment.
pub const SIZES: Sizes = Sizes {
    n_agents: 2,
    n_enemies: 1,
    n_actions: 5,
    obs_size: 3,
    state_size: 4,
    perception_size: 0,
    n_phases: 0,
    enemies: None,
};

/// Episodes that reach this length are truncated.
const EPISODE_LIMIT: u32 = 9;

/// The same number for the same value in every run of one build.
pub(crate) fn hash(value: impl Hash) -> u64 {
    let mut hasher = DefaultHasher::new();
    value.hash(&mut hasher);
    hasher.finish()
}

/// The environment.
pub struct ToyEnv {
    /// Hash of everything that happened.
    history: u64,
    episode_length: u32,
    episode_return: f64,
}

impl ToyEnv {
    /// Seeded and reset.
    pub fn new(seed: u64) -> ToyEnv {
        let mut env = ToyEnv { history: 0, episode_length: 0, episode_return: 0.0 };
        env.reseed(seed);
        env.reset();
        env
    }

    /// One action of each agent is never available; which one changes with every step.
    fn is_available(&self, agent: usize, action: usize) -> bool {
        (self.history as usize / 7 + agent) % SIZES.n_actions != action
    }

    /// Writes values in 0..1, others for another `salt`.
    fn write_floats(&self, salt: &str, out: &mut [f32]) {
        for (i, x) in out.iter_mut().enumerate() {
            *x = (hash((self.history, salt, i)) % 4096) as f32 / 4096.0;
        }
    }
}

impl Environment for ToyEnv {
    fn sizes(&self) -> Sizes {
        SIZES
    }

    fn reseed(&mut self, seed: u64) {
        self.history = hash(seed);
    }

    fn reset(&mut self) {
        self.history = hash((self.history, "reset"));
        (self.episode_length, self.episode_return) = (0, 0.0);
    }

    fn step_checked(&mut self, actions: JointAction<'_>, _scratch: &mut Scratch) -> Step {
        self.history = hash((self.history, actions.iter().collect::<Vec<_>>()));
        self.episode_length += 1;
        let reward = (self.history % 16) as f64 / 16.0;
        self.episode_return += reward;
        let terminated = self.history.is_multiple_of(11);
        let truncated = !terminated && self.episode_length == EPISODE_LIMIT;
        let battle_won = terminated && self.history.is_multiple_of(2);
        Step { reward, terminated, truncated, battle_won, ..Step::default() }
    }

    fn write_obs(&self, out: &mut [f32], _scratch: &mut Scratch) {
        for (agent, row) in out.chunks_exact_mut(out.len() / SIZES.n_agents).enumerate() {
            let (features, rest) = row.split_at_mut(SIZES.obs_size);
            self.write_floats(["obs of 0", "obs of 1"][agent], features);
            rest.fill(0.0);
        }
    }

    fn write_state(&self, out: &mut [f32]) {
        assert_eq!(out.len(), SIZES.state_size);
        self.write_floats("state", out);
    }

    fn write_avail_actions(&self, out: &mut [u8]) {
        for (i, cell) in out.iter_mut().enumerate() {
            *cell = u8::from(self.is_available(i / SIZES.n_actions, i % SIZES.n_actions));
        }
    }

    fn write_available_bits(&self, out: &mut [u64]) {
        for (agent, row) in out.iter_mut().enumerate() {
            let bit = |action| u64::from(self.is_available(agent, action)) << action;
            *row = (0..SIZES.n_actions).map(bit).sum();
        }
    }

    fn write_alive(&self, out: &mut [u8]) {
        out.iter_mut().zip(0..).for_each(|(x, agent)| *x = (self.history >> agent & 1) as u8);
    }

    fn dead_allies(&self) -> usize {
        self.history as usize % 3
    }

    fn dead_enemies(&self) -> usize {
        self.history as usize % 2
    }

    fn episode_return(&self) -> f64 {
        self.episode_return
    }

    fn episode_length(&self) -> u32 {
        self.episode_length
    }
}
