//! A whole pool, in this process or another, with a learner that replays actions.

use super::replay::{Policy, Replay, SEED, STEPS};
use super::{Measured, Mode, Task, resident_bytes};
use crate::cli::runtime_dir;
use crate::supervisor::{LaneConfig, Supervisor, SupervisorConfig};
use crate::{Batch, Client, ConnectError, ControlSocketError, RuntimeDir, WaitOptions};
use smaclite_engine::{Arena, Rules, TICKS_PER_STEP};
use smaclite_pool::fields::Field;
use std::error::Error;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// No batch of a healthy pool takes this long.
const PATIENCE: Duration = Duration::from_secs(60);

pub(super) fn measure(task: &Task<'_>) -> Result<Measured, Box<dyn Error>> {
    let runtime_dir = runtime_dir()?;
    let name = format!("bench-{}", std::process::id());
    let (server, mut client) = match task.mode {
        Mode::Attached => Server::another_process(task, &runtime_dir, &name)?,
        _ => Server::this_process(task, &runtime_dir, &name)?,
    };
    let mut measured = match task.policy {
        Policy::Sampled => sampled(task, &mut client)?,
        _ if task.batch_size == task.envs => replayed(task, &mut client)?,
        _ => return Err("asynchronous batches are measured with --policy sampled".into()),
    };
    measured.rss_bytes = resident_bytes(server.pid());
    Ok(measured)
}

/// Replays what the policy did in battles of the same seeds.
fn replayed(task: &Task<'_>, client: &mut Client) -> Result<Measured, Box<dyn Error>> {
    let arena = Arc::new(Arena::new(task.scenario, Rules::default()));
    let replays = Replay::of_pool(&arena, task.envs, task.policy);
    let n_agents = arena.sizes().n_agents;
    let actions_of = |batch: usize| -> Vec<i32> {
        replays.iter().flat_map(|r| &r.actions[batch * n_agents..(batch + 1) * n_agents]).copied().collect()
    };
    let batches: Vec<Vec<i32>> = (0..STEPS).map(actions_of).collect();
    let mut play = || -> Result<(), Box<dyn Error>> {
        client.reset(Some(SEED), None, patience(&mut || false))?;
        batches.iter().try_for_each(|actions| {
            drop(client.step(actions, None, patience(&mut || false))?);
            task.check_on()
        })
    };
    play()?; // warm-up
    let begin = Instant::now();
    let mut passes = 0;
    while passes == 0 || begin.elapsed() < task.time {
        play()?;
        passes += 1;
    }
    Ok(Measured {
        steps: passes * replays.iter().map(Replay::steps).sum::<u64>(),
        unit_ticks: passes * replays.iter().map(|r| r.unit_ticks).sum::<u64>(),
        time: begin.elapsed(),
        rss_bytes: 0,
    })
}

/// Random legal actions from the client's own sampler, as the order of results is not known before.
fn sampled(task: &Task<'_>, client: &mut Client) -> Result<Measured, Box<dyn Error>> {
    let sizes = client.layout().sizes();
    let mut actions = vec![0; task.batch_size * sizes.n_agents];
    let mut ids = vec![0; task.batch_size];
    let mut measured = Measured { steps: 0, unit_ticks: 0, time: Duration::ZERO, rss_bytes: 0 };
    client.send_reset(Some(SEED), None, patience(&mut || false))?;
    let begin = Instant::now();
    while measured.steps == 0 || begin.elapsed() < task.time {
        let batch = client.recv(patience(&mut || false))?;
        ids.copy_from_slice(batch.env_id());
        measured.steps += ids.len() as u64;
        measured.unit_ticks += (living(&batch) * TICKS_PER_STEP) as u64;
        drop(batch);
        client.sample_actions(Some(&ids), &mut actions)?;
        client.send(&actions, Some(&ids), patience(&mut || false))?;
        task.check_on()?;
    }
    measured.time = begin.elapsed();
    Ok(measured)
}

/// Living units in all environments of a batch.
fn living(batch: &Batch) -> usize {
    let dead = |field| batch.field::<i32>(field).unwrap_or(&[]).iter().sum::<i32>() as usize;
    batch.env_id().len() * batch.layout().sizes().n_units()
        - dead(Field::DeadAllies)
        - dead(Field::DeadEnemies)
}

fn patience(interrupted: &mut dyn FnMut() -> bool) -> WaitOptions<'_> {
    WaitOptions { timeout: Some(PATIENCE), interrupted }
}

/// The supervisor of a measurement, ended with it.
enum Server {
    Here { _supervisor: Supervisor },
    There(Child),
}

impl Server {
    fn this_process(
        task: &Task<'_>,
        runtime_dir: &RuntimeDir,
        name: &str,
    ) -> Result<(Server, Client), Box<dyn Error>> {
        let mut lane = LaneConfig::new("bench", task.scenario.clone(), task.envs);
        lane.settings.batch_size = task.batch_size;
        let runtime_dir = runtime_dir.clone();
        let config =
            SupervisorConfig { name: name.to_owned(), lanes: vec![lane], options: task.options, runtime_dir };
        let supervisor = Supervisor::start(config)?;
        let client = Client::connect(supervisor.runtime_dir(), name, None, task.options.wait)?;
        Ok((Server::Here { _supervisor: supervisor }, client))
    }

    fn another_process(
        task: &Task<'_>,
        runtime_dir: &RuntimeDir,
        name: &str,
    ) -> Result<(Server, Client), Box<dyn Error>> {
        let mut command = this_program()?;
        command.args(["serve", "--name", name, "--threads", &task.options.threads.to_string()]);
        command.args(["--batch-size", &task.batch_size.to_string(), "--wait", task.options.wait.name()]);
        command.arg(format!("bench={}:{}", task.word, task.envs));
        let server = Server::There(command.stdout(Stdio::null()).stdin(Stdio::null()).spawn()?);
        let begin = Instant::now();
        loop {
            match Client::connect(runtime_dir, name, None, task.options.wait) {
                Ok(client) => return Ok((server, client)),
                Err(ConnectError::Control(ControlSocketError::NoSuchPool { .. }))
                    if begin.elapsed() < PATIENCE =>
                {
                    std::thread::sleep(Duration::from_millis(10));
                }
                Err(error) => return Err(error.into()),
            }
        }
    }

    fn pid(&self) -> u32 {
        match self {
            Server::Here { .. } => std::process::id(),
            Server::There(child) => child.id(),
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        if let Server::There(child) = self {
            let pid = rustix::process::Pid::from_child(child);
            let _ = rustix::process::kill_process(pid, rustix::process::Signal::TERM);
            let _ = child.wait();
        }
    }
}

/// How to start this program again: from Python, the executable is the interpreter.
fn this_program() -> std::io::Result<Command> {
    let executable: PathBuf = std::env::current_exe()?;
    let is_python = executable.file_name().and_then(|n| n.to_str()).is_some_and(|n| n.starts_with("python"));
    let mut command = Command::new(executable);
    if is_python {
        command.args(["-m", "smaclite_pool"]);
    }
    Ok(command)
}
