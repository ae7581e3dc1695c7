//! A learner without learning: it attaches to a pool and plays. An agent attacks the first target that it
//! can, else it walks east, where the enemies of the standard scenarios are.
//!
//! ```sh
//! smaclite-pool serve 2s3z:16 --name train &
//! cargo run --release -p smaclite-ipc --example learner -- train 2s3z 20
//! ```
//!
//! The arguments are the pool, the lane, and the number of steps of the whole lane per second.

use smaclite_ipc::{Batch, Client, RuntimeDir, WaitOptions};
use smaclite_pool::fields::Field;
use std::time::{Duration, Instant};

/// The first action that has a target; the actions before it are no-op, stop and four moves.
const FIRST_TARGET: usize = 6;
const EAST: usize = 4;
const STOP: usize = 1;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [pool, lane, steps_per_s] = arguments.as_slice() else {
        return Err("usage: learner POOL LANE STEPS_PER_SECOND".into());
    };
    let pause = Duration::from_secs_f64(1.0 / steps_per_s.parse::<f64>()?);
    let mut client = Client::connect(&RuntimeDir::for_current_user()?, pool, Some(lane), Default::default())?;
    let n_actions = client.description().sizes.n_actions;
    let mut actions = choose(&client.reset(Some(1), None, WaitOptions::forever())?, n_actions);
    println!("playing");
    loop {
        let begin = Instant::now();
        actions = choose(&client.step(&actions, None, WaitOptions::forever())?, n_actions);
        std::thread::sleep(pause.saturating_sub(begin.elapsed()));
    }
}

fn choose(batch: &Batch, n_actions: usize) -> Vec<i32> {
    let available = batch.field::<u8>(Field::AvailActions).expect("the lane has this field");
    let choose = |available: &[u8]| {
        let targets = (FIRST_TARGET..n_actions).chain([EAST, STOP]);
        targets.into_iter().find(|&action| available[action] == 1).unwrap_or(0) as i32
    };
    available.chunks(n_actions).map(choose).collect()
}
