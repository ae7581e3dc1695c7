//! A pool whose battles are never stepped, and not observed but for the available actions: what remains is
//! the cost of the pool and of the transport.

use smaclite_cli::bench::throughput::MeasureError;
use smaclite_cli::process::wait_for_termination;
use smaclite_engine::{BattleSetup, Step};
use smaclite_ipc::{
    Client, LaneConfig, RuntimeDir, StartError, Supervisor, SupervisorConfig, WaitOptions, WaitStrategy,
};
use smaclite_pool::fields::FieldSet;
use smaclite_pool::{LaneSettings, PoolOptions};
use smaclite_scenarios::ScenarioFiles;
use std::error::Error;
use std::time::{Duration, Instant};

/// Serves them until the process is terminated.
pub(crate) fn serve(
    name: &str,
    num_envs: usize,
    threads: usize,
    wait: WaitStrategy,
) -> Result<(), Box<dyn Error>> {
    let _supervisor = start(name, &RuntimeDir::for_current_user()?, num_envs, PoolOptions { threads, wait })?;
    Ok(wait_for_termination()?)
}

/// Steps of single environments per second of an embedded, synchronous pool of them.
pub(crate) fn steps_per_s(
    num_envs: usize,
    options: PoolOptions,
    time: Duration,
) -> Result<f64, MeasureError> {
    let runtime_dir = RuntimeDir::for_current_user()?;
    let name = format!("null-{}", std::process::id());
    let _supervisor = start(&name, &runtime_dir, num_envs, options)?;
    let mut client = Client::connect(&runtime_dir, &name, None, options.wait, WaitOptions::no_wait())?;
    client.reset(Some(0), None, WaitOptions::forever())?;
    let actions = vec![1; num_envs * client.description().sizes.n_agents]; // all stop
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
    let (_, files) = ScenarioFiles::resolve("2s3z").expect("a standard scenario");
    let fields = FieldSet::from_names(["avail_actions"]).expect("a field");
    let settings = LaneSettings { fields, ..LaneSettings::new(num_envs) };
    let lane = LaneConfig { settings, ..LaneConfig::new("null", BattleSetup::new(files), num_envs) };
    let (name, runtime_dir) = (name.to_owned(), runtime_dir.clone());
    let mut pool = SupervisorConfig { name, lanes: vec![lane], options, runtime_dir }.prepare()?;
    pool.hook_steps(0, Box::new(|_| Some(Box::new(|_, _, _| Step::default()))));
    Supervisor::start_prepared(pool, &mut || false)
}
