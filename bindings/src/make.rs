//! The two ways to get environments: of a pool within this process, and of a pool that runs already.

use crate::convert::{Int, Seconds, names, seconds, whole, word};
use crate::envs::Envs;
use crate::errors::{self, invalid};
use crate::exit::Beginning;
use crate::query::runtime_dir;
use crate::wait::{GivenUp, apart};
use pyo3::prelude::*;
use smaclite_engine::Rules;
use smaclite_ipc::{
    Client, LaneConfig, LaneEnvs, Supervisor, SupervisorConfig, WaitOptions, WaitStrategy, check_name,
};
use smaclite_pool::fields::FieldSet;
use smaclite_pool::{LaneSettings, PoolOptions};
use smaclite_scenarios::Scenario;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};

/// More threads than any machine has cores are a mistake.
const MAX_THREADS: usize = 1024;

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
///     max_held_batches: batches that may be held at once, 2 to 1024.
///     wait: how learner and idle workers wait: "adaptive" (spin a little, then block), "spin" or "block".
///     name: the pool's name; by default a unique one.
///
/// Raises ScenarioError for a wrong scenario or unit file, InvalidRequest for a setting that cannot be, TooLittleMemory
/// if /dev/shm is too small, and StartError.
#[pyfunction]
#[pyo3(signature = (scenario, num_envs=Int::Small(64), *, batch_size=None, seed=Int::Small(0), threads=None, autoreset="next_step",
    episode_limit=Some(Limit::Word("default".to_owned())), rules="smaclite", fields=None,
    max_held_batches=Int::Small(4), wait="adaptive", name=None))]
#[pyo3(
    text_signature = "(scenario, num_envs=64, *, batch_size=None, seed=0, threads=None, autoreset='next_step', \
    episode_limit='default', rules='smaclite', fields=None, max_held_batches=4, wait='adaptive', name=None)"
)]
#[allow(clippy::too_many_arguments)] // keyword arguments in Python
pub fn make(
    py: Python<'_>,
    scenario: PathBuf,
    num_envs: Int,
    batch_size: Option<Int>,
    seed: Int,
    threads: Option<Int>,
    autoreset: &str,
    episode_limit: Option<Limit>,
    rules: &str,
    fields: Option<Bound<'_, PyAny>>,
    max_held_batches: Int,
    wait: &str,
    name: Option<String>,
) -> PyResult<Envs> {
    let wait = word::<WaitStrategy>(wait)?;
    let threads = threads.map_or(Ok(PoolOptions::default().threads), |n| whole("threads", n))?;
    if !(1..=MAX_THREADS).contains(&threads) {
        return Err(invalid(format!("threads must be between 1 and {MAX_THREADS}, got {threads}")));
    }
    let num_envs = whole("num_envs", num_envs)?;
    let batch_size = batch_size.map_or(Ok(num_envs), |n| whole("batch_size", n))?;
    let (seed, max_held_batches) = (whole("seed", seed)?, whole("max_held_batches", max_held_batches)?);
    let (rules, autoreset, limit) = (word::<Rules>(rules)?, word(autoreset)?, limit_of(episode_limit)?);
    let fields = match fields {
        Some(given) => FieldSet::from_names(names("fields", &given)?).map_err(invalid)?,
        None => FieldSet::ALL,
    };
    let options = PoolOptions { threads, wait };
    let (name, runtime_dir) = (name.unwrap_or_else(unique_name), runtime_dir()?);
    let _beginning = Beginning::new()?;
    let start = move |given_up: GivenUp<'_>| {
        let scenario = Scenario::resolve(&scenario.to_string_lossy());
        let scenario = scenario.map_err(|e| errors::class::ScenarioError::new_err(e.to_string()))?;
        let mut lane = LaneConfig::new(lane_name(&scenario.name).to_owned(), scenario, num_envs);
        if let LaneEnvs::Battle { rules: played, episode_limit, .. } = &mut lane.envs {
            (*played, *episode_limit) = (rules, limit);
        }
        lane.spectators = 0; // its name is not told to others
        let settings = LaneSettings { num_envs, batch_size, seed, autoreset, fields };
        let lane = LaneConfig { settings, max_held_batches, ..lane };
        let config = SupervisorConfig { name: name.clone(), lanes: vec![lane], options, runtime_dir };
        let prepared = config.prepare().map_err(errors::of_start)?;
        let supervisor = Supervisor::start_prepared(prepared, given_up).map_err(errors::of_start)?;
        let client =
            Client::connect(supervisor.runtime_dir(), &name, None, wait).map_err(errors::of_connect)?;
        Ok((client, supervisor))
    };
    apart(py, start)?.map(|(client, supervisor)| Envs::new(client, Some(supervisor)))
}

/// Steps, or the word that stands for the scenario's own limit.
#[derive(FromPyObject)]
pub enum Limit {
    #[pyo3(annotation = "str")]
    Word(String),
    #[pyo3(annotation = "int")]
    Steps(Int),
}

/// As [`LaneEnvs::Battle`] has it.
fn limit_of(limit: Option<Limit>) -> PyResult<Option<Option<u32>>> {
    match limit {
        None => Ok(Some(None)),
        Some(Limit::Word(word)) if word == "default" => Ok(None),
        Some(Limit::Word(word)) => Err(invalid(format!(
            "episode_limit must be a number of steps, None or \"default\", got `{word}`"
        ))),
        Some(Limit::Steps(Int::Small(0))) => {
            Err(invalid("episode_limit must be at least 1, got 0; None is no limit"))
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
///     timeout: seconds to wait for the pool to appear and to answer; None for no limit. With 0, the default, it must run
///         already, and has 10 seconds to answer.
///     wait: how to wait for batches: "adaptive" (spin a little, then block), "spin" or "block".
///
/// The lane is this process's until `close`. Raises NoSuchPool, LaneTaken if the lane has a learner, PoolDied
/// if the pool ends meanwhile, and ConnectError.
#[pyfunction]
#[pyo3(
    signature = (pool, lane=None, *, timeout=Some(Seconds(0.0)), wait="adaptive"),
    text_signature = "(pool, lane=None, *, timeout=0.0, wait='adaptive')"
)]
pub fn connect(
    py: Python<'_>,
    pool: String,
    lane: Option<String>,
    timeout: Option<Seconds>,
    wait: &str,
) -> PyResult<Envs> {
    let (wait, timeout, runtime_dir) = (word(wait)?, seconds(timeout)?, runtime_dir()?);
    let _beginning = Beginning::new()?;
    let client = apart(py, move |interrupted| {
        Client::connect_within(
            &runtime_dir,
            &pool,
            lane.as_deref(),
            wait,
            WaitOptions { timeout, interrupted },
        )
    })?;
    Ok(Envs::new(client.map_err(errors::of_connect)?, None))
}
