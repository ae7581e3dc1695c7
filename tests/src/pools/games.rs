//! Battles that misbehave: they panic, or take their time.

use serde::{Deserialize, Serialize};
use smaclite_engine::{Battle, IllegalAction, Scratch, Sizes, Step};
use smaclite_pool::environment::Environment;
use std::time::Duration;

/// What is odd about a lane's environments.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub enum Oddity {
    /// Nothing.
    None,
    /// Environment `env` panics in its step number `step`.
    Panics {
        /// Which environment.
        env: usize,
        /// In which step, from 1.
        step: u64,
    },
    /// A step of environment `env` sleeps for `millis` milliseconds.
    Sleeps {
        /// Which environment.
        env: usize,
        /// For how long.
        millis: u64,
    },
}

/// A battle with an oddity.
pub struct Odd {
    battle: Battle,
    env: usize,
    oddity: Oddity,
    steps: u64,
}

impl Odd {
    /// Environment `env`.
    pub fn new(battle: Battle, env: usize, oddity: Oddity) -> Odd {
        Odd { battle, env, oddity, steps: 0 }
    }
}

impl Environment for Odd {
    fn step_checked(&mut self, actions: &[i32], scratch: &mut Scratch) -> Step {
        self.steps += 1;
        match self.oddity {
            Oddity::Panics { env, step } if env == self.env && step == self.steps => {
                panic!("environment {env} broke in step {step}")
            }
            Oddity::Sleeps { env, millis } if env == self.env => {
                std::thread::sleep(Duration::from_millis(millis))
            }
            _ => {}
        }
        self.battle.step_checked(actions, scratch)
    }

    fn sizes(&self) -> Sizes {
        self.battle.arena().sizes()
    }
    fn reseed(&mut self, seed: u64) {
        self.battle.reseed(seed);
    }
    fn reset(&mut self) {
        self.battle.reset();
    }
    fn check(&self, actions: &[i32]) -> Result<(), IllegalAction> {
        self.battle.check(actions)
    }
    fn write_obs(&self, out: &mut [f32], scratch: &mut Scratch) {
        self.battle.write_obs(out, scratch);
    }
    fn write_state(&self, out: &mut [f32]) {
        self.battle.write_state(out);
    }
    fn write_avail_actions(&self, out: &mut [u8]) {
        self.battle.write_avail_actions(out);
    }
    fn write_alive(&self, out: &mut [u8]) {
        self.battle.write_alive(out);
    }
    fn dead_allies(&self) -> usize {
        self.battle.dead_allies()
    }
    fn dead_enemies(&self) -> usize {
        self.battle.dead_enemies()
    }
    fn episode_return(&self) -> f64 {
        self.battle.episode_return()
    }
    fn episode_length(&self) -> u32 {
        self.battle.episode_length()
    }
}
