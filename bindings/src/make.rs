//! The two ways to get environments: of a pool within this process, and of a pool that runs already.

use crate::convert::{seconds, whole, word};
use crate::envs::Envs;
use crate::errors::{self, invalid};
use crate::exit::{Beginning, cut_short, is_exiting};
use crate::query::place;
use pyo3::prelude::*;
use smaclite_engine::Rules;
use smaclite_ipc::{
    Client, ConnectError, ControlError, Game, LaneConfig, Supervisor, SupervisorConfig, Wait, check_name,
};
use smaclite_pool::PoolOptions;
use smaclite_pool::fields::FieldSet;
use smaclite_scenarios::Scenario;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// More threads than any machine has cores are a mistake.
const MAX_THREADS: usize = 1024;

/// How often `connect` looks for a pool that is not there yet.
const LOOK_AGAIN: Duration = Duration::from_millis(20);

/// Start a pool within this process and attach to it.
///
/// Args:
///     scenario: a standard scenario (see `scenarios()`) or the path of a scenario file (JSON).
///     num_envs: environments (N), 1 to 1,000,000.
///     batch_size: environments in a batch (M). N, the default, steps all at once; fewer makes stepping asynchronous:
///         `send` actions to some, `recv` the first M that are done.
///     seed: environment i is seeded with seed + i and then plays, given the same actions, the very episodes of the
///         published environment.
///     threads: worker threads; by default the cores this process may use, less one for the learner.
///     autoreset: at an episode's end, "next_step" (the next step ignores the action, resets, and returns reward 0),
///         "same_step" (the last observation is in `final_*`) or "disabled" (`reset` with a mask).
///     episode_limit: steps after which an episode is truncated; None for no limit; "default" for the scenario's own.
///     rules: "smaclite" (as the published environment plays) or "paper" (as its paper says).
///     fields: names of the fields that batches have; None for all. `env_id`, `reward`, `terminated` and `truncated`
///         are always there.
///     frames_held: batches that may be held at once, 2 to 1024.
///     wait: how learner and idle workers wait: "adaptive" (spin a little, then block), "spin" or "block".
///     name: the pool's name; by default a unique one.
///
/// Raises ScenarioError for a wrong scenario or unit file, InvalidRequest for a setting that cannot be, TooLittleMemory
/// if /dev/shm is too small, and StartError.
#[pyfunction]
#[pyo3(signature = (scenario, num_envs=64, *, batch_size=None, seed=0, threads=None, autoreset="next_step",
    episode_limit=Some(Limit::Word("default".to_owned())), rules="smaclite", fields=None, frames_held=4,
    wait="adaptive", name=None))]
#[pyo3(
    text_signature = "(scenario, num_envs=64, *, batch_size=None, seed=0, threads=None, autoreset='next_step', \
    episode_limit='default', rules='smaclite', fields=None, frames_held=4, wait='adaptive', name=None)"
)]
#[allow(clippy::too_many_arguments)] // keyword arguments in Python
pub fn make(
    py: Python<'_>,
    scenario: PathBuf,
    num_envs: i128,
    batch_size: Option<i128>,
    seed: i128,
    threads: Option<i128>,
    autoreset: &str,
    episode_limit: Option<Limit>,
    rules: &str,
    fields: Option<Vec<String>>,
    frames_held: i128,
    wait: &str,
    name: Option<String>,
) -> PyResult<Envs> {
    let wait = word::<Wait>(wait)?;
    let threads = threads.map_or(Ok(PoolOptions::default().threads), |n| whole("threads", n))?;
    if !(1..=MAX_THREADS).contains(&threads) {
        return Err(invalid(format!("threads={threads}: 1 to {MAX_THREADS} are possible")));
    }
    let scenario = scenario.to_string_lossy();
    let scenario =
        Scenario::resolve(&scenario).map_err(|e| errors::class::ScenarioError::new_err(e.to_string()))?;
    let num_envs = whole("num_envs", num_envs)?;
    let mut lane = LaneConfig::new(lane_name(&scenario.name).to_owned(), scenario, num_envs);
    if let Game::Battle { rules: played, episode_limit: limit, .. } = &mut lane.game {
        *played = word::<Rules>(rules)?;
        *limit = limit_of(episode_limit)?;
    }
    lane.batch_size = batch_size.map_or(Ok(num_envs), |n| whole("batch_size", n))?;
    lane.seed = whole("seed", seed)?;
    lane.autoreset = word(autoreset)?;
    lane.frames_held = whole("frames_held", frames_held)?;
    lane.spectators = 0; // nobody knows of it
    if let Some(names) = fields {
        lane.fields = FieldSet::from_names(names).map_err(invalid)?;
    }
    let options = PoolOptions { threads, wait };
    let name = name.unwrap_or_else(unique_name);
    let config = SupervisorConfig { name: name.clone(), lanes: vec![lane], options, place: place()? };
    let _beginning = Beginning::new()?;
    py.detach(|| {
        let supervisor = Supervisor::start(config).map_err(errors::of_start)?;
        let client = Client::connect(supervisor.place(), &name, None, wait).map_err(errors::of_connect)?;
        Ok((client, supervisor))
    })
    .map(|(client, supervisor)| Envs::new(client, Some(supervisor)))
}

/// Steps, or the word that stands for the scenario's own limit.
#[derive(FromPyObject)]
pub enum Limit {
    #[pyo3(annotation = "int")]
    Steps(i128),
    #[pyo3(annotation = "str")]
    Word(String),
}

/// As [`Game::Battle`] has it.
fn limit_of(limit: Option<Limit>) -> PyResult<Option<Option<u32>>> {
    match limit {
        None => Ok(Some(None)),
        Some(Limit::Word(word)) if word == "default" => Ok(None),
        Some(Limit::Word(word)) => {
            Err(invalid(format!("episode_limit is a number of steps, None or \"default\", not `{word}`")))
        }
        Some(Limit::Steps(0)) => {
            Err(invalid("episode_limit=0: an episode takes at least one step; None is no limit"))
        }
        Some(Limit::Steps(steps)) => Ok(Some(Some(whole("episode_limit", steps)?))),
    }
}

/// A custom scenario may have any name; a lane may not.
fn lane_name(scenario: &str) -> &str {
    if check_name(scenario).is_ok() { scenario } else { "lane" }
}

fn unique_name() -> String {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    format!("embedded-{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed))
}

/// Attach to a lane of a running pool, as started by `smaclite-pool serve`.
///
/// Args:
///     pool: the pool's name (`--name`).
///     lane: the lane's name; a pool's only lane needs none.
///     timeout: seconds to wait for the pool to appear.
///     wait: how to wait for batches: "adaptive" (spin a little, then block), "spin" or "block".
///
/// The lane is this process's until `close`. Raises NoSuchPool, LaneTaken if the lane has a learner, ConnectError.
#[pyfunction]
#[pyo3(signature = (pool, lane=None, *, timeout=0.0, wait="adaptive"))]
pub fn connect(py: Python<'_>, pool: &str, lane: Option<&str>, timeout: f64, wait: &str) -> PyResult<Envs> {
    let (wait, timeout, place) = (word(wait)?, seconds(Some(timeout))?, place()?);
    let _beginning = Beginning::new()?;
    let begin = Instant::now();
    loop {
        match py.detach(|| Client::connect(&place, pool, lane, wait)) {
            Ok(client) => return Ok(Envs::new(client, None)),
            Err(ConnectError::Control(ControlError::NoSuchPool { .. }))
                if timeout.is_none_or(|timeout| begin.elapsed() < timeout) =>
            {
                py.check_signals()?;
                if is_exiting() {
                    return Err(cut_short());
                }
                py.detach(|| std::thread::sleep(LOOK_AGAIN));
            }
            Err(error) => return Err(errors::of_connect(error)),
        }
    }
}
