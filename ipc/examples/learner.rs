//! A learner without learning: it attaches to a pool and plays. An agent attacks the first target that it can
//! and else waits for the enemy; one action in eight is random.
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
const STOP: usize = 1;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [pool, lane, steps_per_s] = arguments.as_slice() else {
        return Err("usage: learner POOL LANE STEPS_PER_SECOND".into());
    };
    let pause = Duration::from_secs_f64(1.0 / steps_per_s.parse::<f64>()?);
    let mut client = Client::connect(&RuntimeDir::for_current_user()?, pool, Some(lane), Default::default())?;
    let n_actions = client.description().sizes.n_actions;
    let mut batch = client.reset(Some(1), None, WaitOptions::forever())?;
    let mut random = vec![0; batch.env_id().len() * client.description().sizes.n_agents];
    println!("playing");
    for step in 0.. {
        let begin = Instant::now();
        client.sample_actions(None, &mut random)?;
        let actions = choose(&batch, n_actions).into_iter().zip(&random).enumerate();
        let mixed = actions.map(|(i, (chosen, random))| if (i + step) % 8 == 0 { *random } else { chosen });
        batch = client.step(&mixed.collect::<Vec<_>>(), None, WaitOptions::forever())?;
        std::thread::sleep(pause.saturating_sub(begin.elapsed()));
    }
    Ok(())
}

fn choose(batch: &Batch, n_actions: usize) -> Vec<i32> {
    let available = batch.field::<u8>(Field::AvailActions).expect("the lane has this field");
    let choose = |available: &[u8]| {
        let mut wanted = (FIRST_TARGET..n_actions).chain([STOP]);
        wanted.find(|&action| available[action] == 1).unwrap_or(0) as i32
    };
    available.chunks(n_actions).map(choose).collect()
}
