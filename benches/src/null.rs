//! An environment that does nothing, of the size of 2s3z's: what is left is the pool's and the transport's
//! cost.

use smaclite_engine::{IllegalAction, Scratch, Sizes, Step};
use smaclite_ipc::{LaneConfig, LaneEnvs, RuntimeDir, Supervisor, SupervisorConfig, WaitStrategy};
use smaclite_pool::environment::Environment;
use smaclite_pool::{LaneSettings, PoolOptions};
use std::error::Error;

pub(crate) const SIZES: Sizes =
    Sizes { n_agents: 5, n_enemies: 5, n_actions: 11, obs_size: 80, state_size: 120 };

struct Null;

impl Environment for Null {
    fn sizes(&self) -> Sizes {
        SIZES
    }
    fn reseed(&mut self, _: u64) {}
    fn reset(&mut self) {}
    fn check(&self, _: &[i32]) -> Result<(), IllegalAction> {
        Ok(())
    }
    fn step(&mut self, _: &[i32], _: &mut Scratch) -> Result<Step, IllegalAction> {
        Ok(Step { reward: 0.0, terminated: false, truncated: false, battle_won: false })
    }
    fn write_obs(&self, _: &mut [f32], _: &mut Scratch) {}
    fn write_state(&self, _: &mut [f32]) {}
    fn write_avail_actions(&self, out: &mut [u8]) {
        out.fill(1); // the client checks actions by them
    }
    fn write_alive(&self, _: &mut [u8]) {}
    fn dead_allies(&self) -> usize {
        0
    }
    fn dead_enemies(&self) -> usize {
        0
    }
    fn episode_return(&self) -> f64 {
        0.0
    }
    fn episode_length(&self) -> u32 {
        0
    }
}

/// Serves `envs` of them until killed.
pub(crate) fn serve(
    name: &str,
    envs: usize,
    threads: usize,
    wait: WaitStrategy,
) -> Result<(), Box<dyn Error>> {
    let lane = LaneConfig {
        name: "null".to_owned(),
        envs: LaneEnvs::Other { name: "null".to_owned(), sizes: SIZES, make: Box::new(|_| Box::new(Null)) },
        settings: LaneSettings::new(envs),
        max_held_batches: 4,
        spectators: 0,
    };
    let options = PoolOptions { threads, wait };
    let runtime_dir = RuntimeDir::for_current_user()?;
    let _supervisor = Supervisor::start(SupervisorConfig {
        name: name.to_owned(),
        lanes: vec![lane],
        options,
        runtime_dir,
    })?;
    loop {
        std::thread::park();
    }
}
