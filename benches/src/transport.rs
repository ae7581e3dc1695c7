//! What a batch costs apart from its environments: round trips of lanes whose battles are not stepped.

use crate::ping_pong::Endpoint;
use crate::second_process;
use smaclite_cli::bench::throughput::median;
use smaclite_cli::process::SecondProcess;
use smaclite_ipc::{Client, ConnectError, RuntimeDir, WaitOptions, WaitStrategy};
use std::error::Error;
use std::time::Instant;

const ROUND_TRIPS: usize = 20_000;

/// Prints microseconds per round trip for each wait strategy.
pub(crate) fn measure(rounds: usize) -> Result<(), Box<dyn Error>> {
    println!("microseconds per round trip, median of {rounds} rounds of {ROUND_TRIPS}");
    for wait in [WaitStrategy::Adaptive, WaitStrategy::Spin, WaitStrategy::Block] {
        let (mut bare, mut one, mut many, mut two_workers) = (vec![], vec![], vec![], vec![]);
        for _ in 0..rounds {
            bare.push(ping_pong(wait)?);
            one.push(lane(1, 1, wait)?);
            many.push(lane(64, 1, wait)?);
            two_workers.push(lane(64, 2, wait)?);
        }
        let [bare, one, many, two_workers] = [bare, one, many, two_workers].map(median);
        println!("{wait}:");
        println!("  bare iceoryx2 ping-pong              {bare:8.2}");
        println!("  lane of 1 environment, 1 worker      {one:8.2}   {:.2} x bare", one / bare);
        println!("  lane of 64 environments, 1 worker    {many:8.2}");
        println!(
            "  lane of 64 environments, 2 workers   {two_workers:8.2}   {:.2} x 1 worker",
            two_workers / many
        );
    }
    Ok(())
}

fn ping_pong(wait: WaitStrategy) -> Result<f64, Box<dyn Error>> {
    let name = format!("ping-{}", std::process::id());
    let _pong = SecondProcess::start(second_process(&["pong", &name, &wait.to_string()])?)?;
    let endpoint = Endpoint::open(&name, wait, "ping", "pong")?;
    microseconds(&mut || {
        endpoint.send()?;
        while !endpoint.receive()? {
            endpoint.send()?; // the other process had not started
        }
        Ok(())
    })
}

fn lane(num_envs: usize, threads: usize, wait: WaitStrategy) -> Result<f64, Box<dyn Error>> {
    let name = format!("null-{}", std::process::id());
    let numbers = [num_envs, threads].map(|number| number.to_string());
    let _pool =
        SecondProcess::start(second_process(&["null", &name, &numbers[0], &numbers[1], &wait.to_string()])?)?;
    let mut client = connect(&name, wait)?;
    client.reset(Some(0), None, WaitOptions::forever())?;
    let actions = vec![1; num_envs * client.description().sizes.n_agents];
    microseconds(&mut || {
        drop(client.step(&actions, None, WaitOptions::forever())?);
        Ok(())
    })
}

/// Connects as soon as the pool runs.
fn connect(name: &str, wait: WaitStrategy) -> Result<Client, ConnectError> {
    Client::connect(&RuntimeDir::for_current_user()?, name, None, wait, WaitOptions::for_response())
}

/// The average time of a round trip.
fn microseconds(round_trip: &mut dyn FnMut() -> Result<(), Box<dyn Error>>) -> Result<f64, Box<dyn Error>> {
    for _ in 0..ROUND_TRIPS / 20 {
        round_trip()?;
    }
    let begin = Instant::now();
    for _ in 0..ROUND_TRIPS {
        round_trip()?;
    }
    Ok(begin.elapsed().as_secs_f64() * 1e6 / ROUND_TRIPS as f64)
}
