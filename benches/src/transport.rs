//! What a batch costs beside the environments: round trips of lanes that do nothing.

use crate::null::SIZES;
use crate::ping_pong::Side;
use crate::{PeerProcess, median};
use smaclite_ipc::{Client, RuntimeDir, WaitOptions, WaitStrategy};
use std::error::Error;
use std::time::{Duration, Instant};

const ROUND_TRIPS: usize = 20_000;

pub(crate) fn stats(rounds: usize) -> Result<(), Box<dyn Error>> {
    println!("round trips in microseconds, median of {rounds} rounds of {ROUND_TRIPS}");
    for wait in ["adaptive", "spin", "block"] {
        let (mut bare, mut one, mut many, mut crowded) = (vec![], vec![], vec![], vec![]);
        for _ in 0..rounds {
            bare.push(ping_pong(wait)?);
            one.push(lane(1, 1, wait)?);
            many.push(lane(64, 1, wait)?);
            crowded.push(lane(64, 2, wait)?);
        }
        let [bare, one, many, crowded] = [bare, one, many, crowded].map(median);
        println!("{wait}:");
        println!("  bare iceoryx2 ping-pong              {bare:8.2}");
        println!("  lane of 1 environment, 1 worker      {one:8.2}   {:.2} x bare", one / bare);
        println!("  lane of 64 environments, 1 worker    {many:8.2}");
        println!("  lane of 64 environments, 2 workers   {crowded:8.2}   {:.2} x 1 worker", crowded / many);
    }
    Ok(())
}

fn ping_pong(wait: &str) -> Result<f64, Box<dyn Error>> {
    let name = format!("ping-{}", std::process::id());
    let _peer = PeerProcess::start(&["pong", &name, wait])?;
    let side = Side::open(&name, wait.parse()?, "ping", "pong")?;
    let mut trip = || -> Result<(), Box<dyn Error>> {
        side.send()?;
        while !side.receive()? {
            side.send()?; // the peer was not there yet
        }
        Ok(())
    };
    timed(&mut trip)
}

fn lane(envs: usize, threads: usize, wait: &str) -> Result<f64, Box<dyn Error>> {
    let name = format!("null-{}", std::process::id());
    let _peer = PeerProcess::start(&["null", &name, &envs.to_string(), &threads.to_string(), wait])?;
    let mut client = connect(&name, wait.parse()?)?;
    client.reset(Some(0), None, WaitOptions::forever())?;
    let actions = vec![1; envs * SIZES.n_agents];
    timed(&mut || {
        let wait = WaitOptions::forever();
        client.step(&actions, None, wait).map(drop).map_err(Into::into)
    })
}

fn connect(name: &str, wait: WaitStrategy) -> Result<Client, Box<dyn Error>> {
    let begin = Instant::now();
    loop {
        match Client::connect(&RuntimeDir::for_current_user()?, name, None, wait) {
            Ok(client) => return Ok(client),
            Err(error) if begin.elapsed() > Duration::from_secs(10) => return Err(error.into()),
            Err(_) => std::thread::sleep(Duration::from_millis(10)),
        }
    }
}

/// Microseconds of a round trip.
fn timed(trip: &mut dyn FnMut() -> Result<(), Box<dyn Error>>) -> Result<f64, Box<dyn Error>> {
    for _ in 0..ROUND_TRIPS / 20 {
        trip()?;
    }
    let begin = Instant::now();
    for _ in 0..ROUND_TRIPS {
        trip()?;
    }
    Ok(begin.elapsed().as_secs_f64() * 1e6 / ROUND_TRIPS as f64)
}
