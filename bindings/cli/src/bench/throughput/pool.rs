//! A whole pool, in this process or in another one, with a learner in this process.

use super::{Counts, Interrupt, MeasureError, Mode, SEED, Workload};
use crate::bench::policy::Policy;
use crate::process::{SecondProcess, resident_bytes};
use smaclite_engine::TICKS_PER_STEP;
use smaclite_ipc::{
    Batch, Client, ConnectError, ControlSocketError, LaneConfig, Order, RuntimeDir, StartError, Supervisor,
    SupervisorConfig, WaitOptions,
};
use smaclite_pool::fields::Field;
use std::process::Command;
use std::time::{Duration, Instant};

/// Far longer than a batch of a healthy pool or the start of one takes.
const TIMEOUT: Duration = Duration::from_secs(60);

pub(super) fn measure(
    workload: &Workload,
    second_process: &dyn Fn(&Workload, &str) -> std::io::Result<Command>,
    interrupt: Interrupt<'_>,
) -> Result<Counts, MeasureError> {
    let Workload { policy, num_envs, batch_size, .. } = *workload;
    if policy != Policy::Sampled && batch_size != num_envs {
        return Err(MeasureError::NotSynchronous { policy, num_envs, batch_size });
    }
    let runtime_dir = RuntimeDir::for_current_user()?;
    let name = format!("bench-{}", std::process::id());
    let mut server = if workload.mode == Mode::Attached {
        let process = second_process(workload, &name).and_then(SecondProcess::start);
        Server::SecondProcess(process.map_err(MeasureError::SecondProcess)?)
    } else {
        Server::ThisProcess(Box::new(workload.serve(&runtime_dir, &name)?))
    };
    let mut client = match &mut server {
        Server::ThisProcess(supervisor) => supervisor.connect(None, workload.options.wait)?,
        Server::SecondProcess(process) => connect(workload, &runtime_dir, &name, || {
            interrupt.check()?;
            check_running(process)
        })?,
    };
    let counts = match policy {
        Policy::Sampled if batch_size == num_envs => sample(workload, &mut client, interrupt)?,
        Policy::Sampled => sample_asynchronously(workload, &mut client, interrupt)?,
        Policy::Nearest | Policy::Random => replay(workload, &mut client, interrupt)?,
    };
    Ok(Counts { rss_bytes: resident_bytes(server.pid()), ..counts })
}

/// The supervisor of a measurement, which ends when this is dropped.
enum Server {
    ThisProcess(Box<Supervisor>),
    SecondProcess(SecondProcess),
}

impl Server {
    fn pid(&self) -> u32 {
        match self {
            Server::ThisProcess(_) => std::process::id(),
            Server::SecondProcess(process) => process.pid(),
        }
    }
}

fn check_running(process: &mut SecondProcess) -> Result<(), MeasureError> {
    match process.end().map_err(MeasureError::SecondProcess)? {
        Some((status, said)) => Err(MeasureError::SecondProcessEnded { status, said: said.to_owned() }),
        None => Ok(()),
    }
}

impl Workload {
    /// Starts a pool with one lane, `bench`, in this process.
    ///
    /// # Errors
    /// As [`Supervisor::start`].
    pub fn serve(&self, runtime_dir: &RuntimeDir, name: &str) -> Result<Supervisor, StartError> {
        let mut lane = LaneConfig::new("bench", self.setup(), self.num_envs);
        lane.settings.batch_size = self.batch_size;
        Supervisor::start(SupervisorConfig {
            name: name.to_owned(),
            lanes: vec![lane],
            options: self.options,
            runtime_dir: runtime_dir.clone(),
        })
    }
}

/// Connects as soon as the pool runs; `check` says whether to keep waiting for it.
fn connect(
    workload: &Workload,
    runtime_dir: &RuntimeDir,
    name: &str,
    mut check: impl FnMut() -> Result<(), MeasureError>,
) -> Result<Client, MeasureError> {
    let begin = Instant::now();
    loop {
        match Client::connect(runtime_dir, name, None, workload.options.wait, WaitOptions::no_wait()) {
            Err(ConnectError::Control(ControlSocketError::NoSuchPool { .. }))
                if begin.elapsed() < TIMEOUT =>
            {
                check()?;
                std::thread::sleep(Duration::from_millis(10));
            }
            result => return Ok(result?),
        }
    }
}

/// Replays the recorded actions of all environments.
fn replay(
    workload: &Workload,
    client: &mut Client,
    interrupt: Interrupt<'_>,
) -> Result<Counts, MeasureError> {
    let traces = workload.record(&workload.arena()?);
    let actions_of = |step| traces.iter().flat_map(|trace| trace.step(step)).copied().collect();
    let batches: Vec<Vec<i32>> = (0..super::RECORDED_STEPS).map(actions_of).collect();
    let mut play_all = || -> Result<(), MeasureError> {
        client.reset(Some(SEED), None, wait_options(&mut || false))?;
        batches.iter().try_for_each(|actions| {
            drop(client.step(actions, None, wait_options(&mut || false))?);
            interrupt.check()
        })
    };
    play_all()?; // warms up
    let begin = Instant::now();
    let mut passes = 0;
    while passes == 0 || begin.elapsed() < workload.time {
        play_all()?;
        passes += 1;
    }
    Ok(Counts::of_traces(&traces, passes, begin.elapsed(), 0))
}

/// Samples available actions of all environments.
fn sample(
    workload: &Workload,
    client: &mut Client,
    interrupt: Interrupt<'_>,
) -> Result<Counts, MeasureError> {
    let mut actions = vec![0; workload.num_envs * client.layout().sizes().n_agents];
    let mut counts = Counts { steps: 0, unit_ticks: 0, time: Duration::ZERO, rss_bytes: 0 };
    client.reset(Some(SEED), None, wait_options(&mut || false))?;
    let begin = Instant::now();
    while counts.steps == 0 || begin.elapsed() < workload.time {
        client.sample_actions(None, &mut actions)?;
        let batch = client.step(&actions, None, wait_options(&mut || false))?;
        counts.add(&batch);
        interrupt.check()?;
    }
    counts.time = begin.elapsed();
    Ok(counts)
}

/// Samples available actions of the environments in each batch. Nothing can be recorded for asynchronous
/// stepping, because the order of the results is not known in advance.
fn sample_asynchronously(
    workload: &Workload,
    client: &mut Client,
    interrupt: Interrupt<'_>,
) -> Result<Counts, MeasureError> {
    let mut actions = vec![0; workload.batch_size * client.layout().sizes().n_agents];
    let mut ids = vec![0; workload.batch_size];
    let mut counts = Counts { steps: 0, unit_ticks: 0, time: Duration::ZERO, rss_bytes: 0 };
    client.send(Order::reset(Some(SEED)), None, wait_options(&mut || false))?;
    let begin = Instant::now();
    while counts.steps == 0 || begin.elapsed() < workload.time {
        let batch = client.recv(wait_options(&mut || false))?;
        ids.copy_from_slice(batch.env_id());
        counts.add(&batch);
        drop(batch);
        client.sample_actions(Some(&ids), &mut actions)?;
        client.send(Order::Step(&actions), Some(&ids), wait_options(&mut || false))?;
        interrupt.check()?;
    }
    counts.time = begin.elapsed();
    Ok(counts)
}

impl Counts {
    /// Counts the steps of a batch.
    fn add(&mut self, batch: &Batch) {
        self.steps += batch.env_id().len() as u64;
        self.unit_ticks += (living_units(batch) * TICKS_PER_STEP) as u64;
    }
}

/// Living units in all environments of a batch.
fn living_units(batch: &Batch) -> usize {
    let dead = |field| batch.field::<i32>(field).unwrap_or(&[]).iter().sum::<i32>() as usize;
    batch.env_id().len() * batch.layout().sizes().n_units()
        - dead(Field::DeadAllies)
        - dead(Field::DeadEnemies)
}

fn wait_options(interrupted: &mut dyn FnMut() -> bool) -> WaitOptions<'_> {
    WaitOptions { timeout: Some(TIMEOUT), interrupted }
}
