//! An environment that does nothing and has the sizes of 2s3z: what remains is the cost of the pool and of
//! the transport.

use super::throughput::MeasureError;
use crate::process::wait_for_termination;
use smaclite_engine::{Scratch, Sizes, Step};
use smaclite_ipc::{
    Client, LaneConfig, LaneEnvs, RuntimeDir, StartError, Supervisor, SupervisorConfig, WaitOptions,
    WaitStrategy,
};
use smaclite_pool::environment::{Environment, JointAction};
use smaclite_pool::{LaneSettings, PoolOptions};
use std::error::Error;
use std::time::{Duration, Instant};

/// The sizes of 2s3z.
pub const SIZES: Sizes = Sizes {
    n_agents: 5,
    n_enemies: 5,
    n_actions: 11,
    obs_size: 80,
    state_size: 120,
    perception_size: 0,
    n_phases: 0,
    enemies: None,
};

struct Null;

impl Environment for Null {
    fn sizes(&self) -> Sizes {
        SIZES
    }
    fn reseed(&mut self, _: u64) {}
    fn reset(&mut self) {}
    fn step_checked(&mut self, _: JointAction<'_>, _: &mut Scratch) -> Step {
        Step::default()
    }
    fn write_obs(&self, _: &mut [f32], _: &mut Scratch) {}
    fn write_state(&self, _: &mut [f32]) {}
    fn write_avail_actions(&self, out: &mut [u8]) {
        out.fill(1); // the client refuses unavailable actions
    }
    fn write_available_bits(&self, out: &mut [u64]) {
        out.fill((1 << SIZES.n_actions) - 1);
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

/// Serves them until the process is terminated.
///
/// # Errors
/// If the pool cannot start.
pub fn serve(name: &str, num_envs: usize, threads: usize, wait: WaitStrategy) -> Result<(), Box<dyn Error>> {
    let _supervisor = start(name, &RuntimeDir::for_current_user()?, num_envs, PoolOptions { threads, wait })?;
    Ok(wait_for_termination()?)
}

/// Steps of single environments per second of an embedded, synchronous pool of them.
///
/// # Errors
/// If the pool cannot start or fails.
pub fn steps_per_s(num_envs: usize, options: PoolOptions, time: Duration) -> Result<f64, MeasureError> {
    let runtime_dir = RuntimeDir::for_current_user()?;
    let name = format!("null-{}", std::process::id());
    let _supervisor = start(&name, &runtime_dir, num_envs, options)?;
    let mut client = Client::connect(&runtime_dir, &name, None, options.wait)?;
    client.reset(Some(0), None, WaitOptions::forever())?;
    let actions = vec![1; num_envs * SIZES.n_agents];
    let begin = Instant::now();
    let mut steps = 0;
    while steps == 0 || begin.elapsed() < time {
        drop(client.step(&actions, None, WaitOptions::forever())?);
        steps += num_envs;
    }
    Ok(steps as f64 / begin.elapsed().as_secs_f64())
}

fn start(
    name: &str,
    runtime_dir: &RuntimeDir,
    num_envs: usize,
    options: PoolOptions,
) -> Result<Supervisor, StartError> {
    let lane = LaneConfig {
        name: "null".to_owned(),
        envs: LaneEnvs::Other { name: "null".to_owned(), sizes: SIZES, make: Box::new(|_| Box::new(Null)) },
        settings: LaneSettings::new(num_envs),
        max_held_batches: 4,
        spectators: 0,
    };
    Supervisor::start(SupervisorConfig {
        name: name.to_owned(),
        lanes: vec![lane],
        options,
        runtime_dir: runtime_dir.clone(),
    })
}
