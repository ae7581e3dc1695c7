//! The two ways to get environments: `make` starts a pool in this process, `connect` attaches to a running
//! pool.

mod arguments;

use crate::convert::{IntArg, parse_option, string_list, timeout_seconds, to_duration, to_unsigned};
use crate::envs::{Embedded, Envs};
use crate::errors::{self, invalid_request, shown};
use crate::exit::PendingCall;
use crate::habits::{Place, refuse_keywords, required};
use crate::query::runtime_dir;
use crate::seeds::random_seed;
use crate::wait::{IsCancelled, run_on_thread};
pub use arguments::{LimitArg, MAX_THREADS, ModeArg, OpponentArg};
use arguments::{changed_keys, lane_count, thread_count, to_episode_limit};
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use smaclite_engine::{BattleSetup, Rules, Sides};
use smaclite_ipc::{Client, LaneConfig, Supervisor, SupervisorConfig, WaitOptions, WaitStrategy, check_name};
use smaclite_learn::TrainedTeam;
use smaclite_pool::fields::FieldSet;
use smaclite_pool::{LaneSettings, PoolOptions};
use smaclite_scenarios::ScenarioFiles;
use std::ffi::CString;
use std::hash::{BuildHasher, RandomState};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Start a pool in this process and attach to it.
///
/// Args:
///     scenario: the name of a standard scenario (see `scenarios()`) or the path of a scenario file (JSON).
///     num_envs: number of environments (N), 1 to 1,000,000.
///     batch_size: number of environments per batch (M), 1 to N. The default, N, steps all environments
///         together (synchronous mode). With fewer, stepping is asynchronous: `send` actions to some
///         environments, and `recv` the first M that finish.
///     seed: from 0 to `2**64 - 1`; environment i is seeded with seed + i. With the same seed and actions it
///         plays the same episodes as the published environment. None: a random one, which `Envs.spec` has.
///     threads: number of threads that step environments, 1 to 1024. While the learner waits for a batch, its
///         thread is one of them. The default is the number of cores available to this process.
///     autoreset_mode: what happens at the end of an episode, as in Gymnasium. "NextStep": the next step
///         ignores the actions, resets the environment and returns reward 0. "SameStep": the last step
///         already returns the first observation of the next episode, and `final_*` hold the last one.
///         "Disabled": the environment waits for a `reset`. Members of Gymnasium's `AutoresetMode` are
///         accepted, too.
///     episode_limit: number of steps after which an episode is truncated, at least 1; None for no limit;
///         "default" for the scenario's limit.
///     rules: "smaclite", the rules of the published environment; "paper", those in the text of its paper; or
///         "starcraft", nearer to the battles of StarCraft. See `docs/concepts/starcraft.md`.
///     opponent: who plays the enemies: a name of `OPPONENTS`; a trained team, as "zoo:3m" or by the folder
///         of its run; or a dictionary of such names and weights, of which each episode draws one from the
///         environment's generator. None: the scenario's own, or "learner" if actions play both sides. See
///         `docs/reference/policies.md`.
///     sides: which sides actions play: "allies"; "both"; or "mirrored", which is both, and what the enemies
///         see and do is reflected at the centre of the map, so that one network can play both sides of a
///         symmetric scenario. With both, joint actions have `n_agents + n_enemies` numbers, and batches have
///         the fields `enemy_*`. See `docs/reference/both-sides.md`.
///     fields: names of the batch fields to compute; None for all. `env_id`, `reward`, `terminated`,
///         `truncated` and `was_reset` are always included.
///     obs_last_actions: number of its own last actions that an agent observes, 0 to 16: one-hot vectors of
///         `n_actions` after the features of the scenario, the newest first; zeros where the episode is
///         younger. They are part of `obs`, `final_obs` and `obs_size`, and zeros for dead agents, as the
///         rest of `obs`.
///     obs_agent_id: whether an agent observes its own number, as a one-hot vector of `n_agents` at the end.
///     max_held_batches: number of batches that the learner may hold at the same time, 2 to 1024.
///     spectators: number of spectators at the same time, 0 to 64, such as `smaclite-pool watch`; each needs
///         shared memory for some more batches (docs/concepts/batches.md).
///     wait: how the learner and idle workers wait: "adaptive" (spin briefly, then block), "spin" or "block".
///     name: the pool's name; a unique one by default.
///     lanes: a number of lanes, 1 to 64: return a list of that many `Envs` that share the worker threads.
///         The environments are divided among them, to within one; the lane that begins with environment f
///         has the seed `seed` + f. With two, the policy can choose actions for one half while the workers
///         step the other. The pool ends when all of them are closed. None: return one `Envs`.
///     **battle: keys of scenario files with other values, such as `attack_point=[9, 16]`: lists, dicts,
///         strings and numbers as in a file; None leaves the scenario's own. Options of `rewards` (SMAC's,
///         see `docs/reference/observations.md`) and `smacv2` are added to the scenario's own; of `groups`
///         and `teams` (see `docs/concepts/generated-battles.md`), and of `terrain` and `terrain_preset`, one
///         replaces the other. All keys are in `docs/reference/scenario-files.md`; but `name`, `opponent` and
///         `episode_limit` are the arguments above, and `custom_unit_path` is for files.
///
/// Raises:
///     ScenarioError: the scenario is unknown, or a scenario or unit file, or a changed key, is invalid.
///     InvalidRequest: another argument is invalid.
///     TypeError: an argument has the wrong type.
///     TooLittleMemory: there is too little memory; on Linux in /dev/shm.
///     StartError: the pool could not start, for instance because its name is in use.
///     ConnectError: the folder of SMACLITE_POOL_ROOT cannot be used.
// PyO3 shows only literals as defaults, so their text is repeated here; a test compares the two.
#[pyfunction]
#[pyo3(signature = (scenario=None, num_envs=IntArg::Small(64), *, batch_size=None, seed=None,
    threads=None, autoreset_mode=ModeArg::default(), episode_limit=Some(LimitArg::Name("default".to_owned())),
    rules="smaclite", opponent=None, sides="allies", fields=None,
    obs_last_actions=IntArg::Small(0), obs_agent_id=false, max_held_batches=IntArg::Small(4),
    spectators=IntArg::Small(1), wait="adaptive", name=None, lanes=None, **battle))]
#[pyo3(text_signature = "(scenario, num_envs=64, *, batch_size=None, seed=None, threads=None, \
    autoreset_mode='NextStep', episode_limit='default', rules='smaclite', opponent=None, sides='allies', \
    fields=None, obs_last_actions=0, obs_agent_id=False, max_held_batches=4, \
    spectators=1, wait='adaptive', name=None, lanes=None, **battle)")]
#[allow(clippy::too_many_arguments)] // keyword arguments in Python
pub fn make(
    py: Python<'_>,
    scenario: Option<PathBuf>,
    num_envs: IntArg,
    batch_size: Option<IntArg>,
    seed: Option<IntArg>,
    threads: Option<IntArg>,
    autoreset_mode: ModeArg,
    episode_limit: Option<LimitArg>,
    rules: &str,
    opponent: Option<OpponentArg>,
    sides: &str,
    fields: Option<Bound<'_, PyAny>>,
    obs_last_actions: IntArg,
    obs_agent_id: bool,
    max_held_batches: IntArg,
    spectators: IntArg,
    wait: &str,
    name: Option<String>,
    lanes: Option<IntArg>,
    battle: Option<Bound<'_, PyDict>>,
) -> PyResult<Py<PyAny>> {
    let keys = battle.as_ref().map_or_else(|| Ok(Vec::new()), changed_keys)?;
    let scenario = required("make", "scenario", scenario)?;
    let wait = parse_option::<WaitStrategy>(wait)?;
    let options = PoolOptions { threads: thread_count(threads)?, wait };
    let num_envs: usize = to_unsigned("num_envs", num_envs)?;
    let batch_size = batch_size.map(|n| to_unsigned("batch_size", n)).transpose()?;
    let seed = seed.map(|seed| to_unsigned("seed", seed)).transpose()?;
    let obs_last_actions = to_unsigned("obs_last_actions", obs_last_actions)?;
    let max_held_batches = to_unsigned("max_held_batches", max_held_batches)?;
    let spectators = to_unsigned("spectators", spectators)?;
    let lanes = lanes.map(|lanes| lane_count(lanes, num_envs)).transpose()?;
    let (rules, autoreset) = (parse_option::<Rules>(rules)?, parse_option(&autoreset_mode.0)?);
    let episode_limit = to_episode_limit(episode_limit)?;
    let sides = parse_option::<Sides>(sides)?;
    let opponents = opponent.map(|opponent| opponent.opponents(sides)).transpose()?;
    let fields = match fields {
        Some(names) => {
            FieldSet::from_names(string_list("fields", r#"["obs"]"#, &names)?).map_err(invalid_request)?
        }
        None => FieldSet::DEFAULT,
    };
    let (name, runtime_dir) = (name.unwrap_or_else(unique_name), runtime_dir()?);
    let _pending = PendingCall::new()?;
    // Not before: when the interpreter exits, nothing can be imported.
    let seed: u64 = seed.map_or_else(|| random_seed(py), Ok)?;
    let start = move |is_cancelled: IsCancelled<'_>| {
        let resolved = ScenarioFiles::resolve(&scenario.to_string_lossy());
        let (mut scenario, mut files) =
            resolved.map_err(|e| errors::class::ScenarioError::new_err(e.to_string()))?;
        if !keys.is_empty() {
            files = files.with_keys(keys);
            scenario = files.scenario().map_err(|e| errors::class::ScenarioError::new_err(e.to_string()))?;
        }
        sides.check(&scenario).map_err(invalid_request)?;
        let setup = BattleSetup { rules, episode_limit, ..BattleSetup::new(files).with_sides(sides) };
        let warnings = setup.warnings().into_iter().map(|warning| warning.to_string());
        let mut warnings: Vec<String> = warnings.collect();
        let (setup, team) = match opponents {
            Some(opponents) => opponents.open(setup).map_err(|error| invalid_request(shown(&error)))?,
            None => (setup, None),
        };
        if let Some(team) = &team {
            let other = TrainedTeam::other_rules(Path::new(&team.name), rules);
            warnings.extend(other.map_err(|error| invalid_request(shown(&error)))?);
        }
        let settings =
            LaneSettings { autoreset, fields, obs_last_actions, obs_agent_id, ..LaneSettings::new(num_envs) };
        let count = lanes.unwrap_or(1);
        let (mut configs, mut names, mut first_env) = (Vec::new(), Vec::new(), 0);
        for index in 0..count {
            let suffix = if lanes.is_some() { format!("-{index}") } else { String::new() };
            let name = lane_name(&scenario.name, &suffix);
            let num_envs = num_envs / count + usize::from(index < num_envs % count);
            let (setup, team) = (setup.clone(), team.clone());
            let batch_size = batch_size.unwrap_or(num_envs);
            let seed = seed.wrapping_add(first_env as u64);
            let settings = LaneSettings { num_envs, batch_size, seed, ..settings };
            names.push(name.clone());
            configs.push(LaneConfig { name, setup, team, settings, max_held_batches, spectators });
            first_env += num_envs;
        }
        let config = SupervisorConfig { name, lanes: configs, options, runtime_dir };
        let prepared = config.prepare().map_err(errors::start_error)?;
        let supervisor = Supervisor::start_prepared(prepared, is_cancelled).map_err(errors::start_error)?;
        let supervisor = Arc::new(supervisor);
        let attached = names.iter().map(|lane| supervisor.connect(Some(lane), wait));
        let attached = attached.collect::<Result<Vec<_>, _>>().map_err(errors::connect_error)?;
        Ok::<_, PyErr>((attached, Embedded { supervisor, scenario }, warnings))
    };
    let (attached, embedded, warnings) = run_on_thread(py, start)??;
    let mut envs = attached
        .into_iter()
        .map(|client| Envs::new(py, client, Some(embedded.clone())))
        .collect::<PyResult<Vec<_>>>()?;
    for warning in warnings {
        let text = CString::new(warning)?;
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 1)?;
    }
    match lanes {
        None => Ok(Py::new(py, envs.remove(0))?.into_any()),
        Some(_) => envs.into_py_any(py),
    }
}

/// The scenario's name and a suffix, if a lane can have that name: custom scenarios may have others.
fn lane_name(scenario: &str, suffix: &str) -> String {
    let name = format!("{scenario}{suffix}");
    if check_name(&name).is_ok() { name } else { format!("lane{suffix}") }
}

fn unique_name() -> String {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let (count, mark) = (COUNT.fetch_add(1, Ordering::Relaxed), RandomState::new().hash_one(()) as u16);
    // Containers that share a folder of pools each have a process 1.
    format!("embedded-{}-{count}-{mark:04x}", std::process::id())
}

/// Attach to a lane of a running pool, as started by `smaclite-pool serve`. The lane belongs to this process
/// until `close`.
///
/// Args:
///     pool: the pool's name (the option `--name` of `serve`).
///     lane: the lane's name; it may be omitted if the pool has only one lane.
///     timeout: seconds to wait for the pool to start and answer; None for no limit. With 0, the default, the
///         pool must be running already, and has 10 seconds to answer.
///     wait: how to wait for batches: "adaptive" (spin briefly, then block), "spin" or "block".
///
/// Raises:
///     NoSuchPool: no pool of that name is running.
///     LaneTaken: the lane has another learner.
///     LaneFailed: the lane failed.
///     PoolDied: the pool ended during the call.
///     TooLittleMemory: there is too little memory; on Linux in /dev/shm.
///     ConnectError: the pool has no such lane, did not answer in time, or is of another release.
///     InvalidRequest: an argument is invalid.
#[pyfunction]
#[pyo3(signature = (pool=None, lane=None, *, timeout=0.0, wait="adaptive", **unknown))]
#[pyo3(text_signature = "(pool, lane=None, *, timeout=0.0, wait='adaptive')")]
pub fn connect(
    py: Python<'_>,
    pool: Option<String>,
    lane: Option<String>,
    #[pyo3(from_py_with = timeout_seconds)] timeout: Option<f64>,
    wait: &str,
    unknown: Option<Bound<'_, PyDict>>,
) -> PyResult<Envs> {
    let valid = ["pool", "lane", "timeout", "wait"];
    refuse_keywords(Place::Connect, "connect", unknown.as_ref(), &valid)?;
    let pool = required("connect", "pool", pool)?;
    let (wait, timeout, runtime_dir) = (parse_option(wait)?, to_duration(timeout)?, runtime_dir()?);
    let _pending = PendingCall::new()?;
    let client = run_on_thread(py, move |interrupted| {
        let options = WaitOptions { timeout, interrupted };
        Client::connect(&runtime_dir, &pool, lane.as_deref(), wait, options)
    })?;
    Envs::new(py, client.map_err(errors::connect_error)?, None)
}
