//! What it costs to branch: forks and restores of 64 environments, compared with their steps.

use smaclite_cli::bench::throughput::median;
use smaclite_engine::BattleSetup;
use smaclite_ipc::{
    Client, LaneConfig, Order, RuntimeDir, Seeds, Supervisor, SupervisorConfig, WaitOptions, WaitStrategy,
};
use smaclite_pool::fields::{Field, FieldSet};
use smaclite_pool::{LaneSettings, PoolOptions};
use smaclite_scenarios::ScenarioFiles;
use std::error::Error;
use std::time::{Duration, Instant};

const NUM_ENVS: usize = 64;

/// How long each of them is repeated in a round.
const TIME: Duration = Duration::from_millis(300);

/// A pool of this process and its learner.
struct Lane {
    client: Client,
    actions: Vec<i32>,
    /// Of all environments, if the lane has the field.
    snapshots: Vec<u8>,
    _supervisor: Supervisor,
}

impl Lane {
    fn start(scenario: &str, has_snapshots: bool) -> Result<Lane, Box<dyn Error>> {
        let (_, files) = ScenarioFiles::resolve(scenario)?;
        let mut fields = FieldSet::without_final();
        if has_snapshots {
            fields.insert(Field::Snapshot);
        }
        let settings = LaneSettings { fields, ..LaneSettings::new(NUM_ENVS) };
        let lane = LaneConfig { settings, ..LaneConfig::new(scenario, BattleSetup::new(files), NUM_ENVS) };
        let name = format!("bench-{}", std::process::id());
        let runtime_dir = RuntimeDir::for_current_user()?;
        let options = PoolOptions { threads: 2, ..PoolOptions::default() };
        let supervisor =
            Supervisor::start(SupervisorConfig { name, lanes: vec![lane], options, runtime_dir })?;
        let mut client = supervisor.connect(None, WaitStrategy::default())?;
        client.reset(Some(1), None, WaitOptions::forever())?;
        let actions = vec![0; NUM_ENVS * client.description().sizes.n_agents];
        let mut lane = Lane { client, actions, snapshots: Vec::new(), _supervisor: supervisor };
        (0..8).try_for_each(|_| lane.step())?;
        let newest = lane.client.newest().and_then(|batch| batch.field::<u8>(Field::Snapshot));
        lane.snapshots = newest.map(<[u8]>::to_vec).unwrap_or_default();
        Ok(lane)
    }

    fn step(&mut self) -> Result<(), Box<dyn Error>> {
        self.client.sample_actions(None, &mut self.actions)?;
        self.client.step(&self.actions, None, WaitOptions::forever())?;
        Ok(())
    }

    /// Environment 0 becomes all of them.
    fn fork(&mut self) -> Result<(), Box<dyn Error>> {
        let all: Vec<i32> = (0..NUM_ENVS as i32).collect();
        let fork = Order::Fork { from: &[0; NUM_ENVS], seeds: Seeds::Continue };
        self.client.request(fork, Some(&all), WaitOptions::forever())?;
        Ok(())
    }

    fn restore(&mut self) -> Result<(), Box<dyn Error>> {
        let restore = Order::Restore { snapshots: &self.snapshots, seeds: Seeds::Continue };
        self.client.request(restore, None, WaitOptions::forever())?;
        Ok(())
    }
}

/// Microseconds per call.
fn time(mut call: impl FnMut() -> Result<(), Box<dyn Error>>) -> Result<f64, Box<dyn Error>> {
    let (begin, mut calls) = (Instant::now(), 0);
    while begin.elapsed() < TIME {
        call()?;
        calls += 1;
    }
    Ok(begin.elapsed().as_secs_f64() * 1e6 / f64::from(calls))
}

/// Prints the time of a step, a fork and a restore of 64 environments, and branches per second.
pub(crate) fn measure(rounds: usize) -> Result<(), Box<dyn Error>> {
    println!("{NUM_ENVS} environments, 2 threads, sampled actions, median of {rounds} rounds");
    for scenario in ["2s3z", "27m_vs_30m"] {
        let mut results = [const { Vec::new() }; 5];
        for _ in 0..rounds {
            let mut plain = Lane::start(scenario, false)?;
            results[0].push(time(|| plain.step())?);
            results[1].push(time(|| plain.fork().and_then(|()| plain.step()))?);
            results[2].push(time(|| plain.fork())?);
            drop(plain);
            let mut lane = Lane::start(scenario, true)?;
            results[3].push(time(|| lane.step())?);
            results[4].push(time(|| lane.restore())?);
        }
        let [step, branch, fork, step_with, restore] = results.map(median);
        println!("{scenario}: step {step:.1} us, with snapshots {:.3} x", step_with / step);
        println!("  fork {fork:.1} us, {:.2} us per environment", fork / NUM_ENVS as f64);
        println!("  restore {restore:.1} us, {:.2} us per environment", restore / NUM_ENVS as f64);
        println!("  fork and step {branch:.1} us: {:.0} branches/s", NUM_ENVS as f64 * 1e6 / branch);
    }
    Ok(())
}
