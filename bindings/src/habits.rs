//! What names of Gymnasium, EnvPool, PettingZoo, SMAC and PyMARL are called here: one table, from which the
//! errors of unknown keywords and attributes are made.

use crate::lane_spec::attributes;
use pyo3::exceptions::{PyAttributeError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyType};
use smaclite_scenarios::{Scenario, ScenarioFiles};
use smaclite_units::file::did_you_mean;

/// Where a name is looked for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// The keywords of `make`, and of the environments of `integrations` that pass theirs on to it.
    Make,
    Connect,
    Reset,
    Step,
    /// The attributes of `Envs`.
    Envs,
    /// The fields of a `Batch`.
    Batch,
    /// The attributes and arrays of a `Dataset`.
    Dataset,
}

/// A place, names that other packages use there, and what a user of them wants here.
type Row = (Place, &'static [&'static str], &'static str);

const SPACES: &str = "sizes are `spec.n_agents`, `spec.n_actions`, `spec.obs_size` and `spec.fields`; for \
     spaces use smaclite_pool.integrations.gymnasium.BattleVectorEnv(envs)";
const FIELDS_OF_BATCHES: &str = "`reset`, `step` and `recv` return a batch with it: `obs`, `state`, \
     `avail_actions`, `reward`, `terminated`, `truncated`";

#[rustfmt::skip]
const TABLE: &[Row] = &[
    (Place::Make, &["autoreset", "auto_reset"], "use `autoreset_mode`"),
    (Place::Make, &["num_threads", "n_threads", "num_workers", "n_workers", "workers", "n_rollout_threads",
        "num_cpus", "num_parallel"], "use `threads`"),
    (Place::Make, &["max_episode_steps", "max_steps", "max_cycles", "time_limit", "horizon"],
        "use `episode_limit`"),
    (Place::Make, &["map_name", "map", "map_file", "task_id", "task", "env_name", "id", "env", "env_id"],
        "use `scenario`, the first argument"),
    (Place::Make, &["nenvs", "num_env", "env_num", "batch_size_run", "num_environments"],
        "use `num_envs`"),
    (Place::Make, &["random_seed", "seeds", "env_seed"], "use `seed`"),
    (Place::Make, &["difficulty", "enemy_policy", "opponents", "heuristic_ai"],
        "use `opponent`, the script that plays the enemies"),
    (Place::Make, &["obs_last_action"], "use `obs_last_actions`, a number of actions"),
    (Place::Make, &["add_agent_id", "agent_id", "obs_agent_ids"], "use `obs_agent_id`"),
    (Place::Make, &["reward_sparse", "reward_only_positive", "reward_death_value", "reward_win",
        "reward_defeat", "reward_negative_scale", "reward_scale", "reward_scale_rate"],
        "use `rewards`, a dictionary of such options"),
    (Place::Make, &["capability_config", "team_gen", "unit_types", "n_units"],
        "use `teams` and `start_positions`, or smaclite_pool.marl.smacv2, which takes `capability_config`"),
    (Place::Make, &["record", "replay_dir", "replay_prefix"], "smaclite_pool.Recorder writes replays"),
    (Place::Make, &["render_mode"], "`envs.render()` returns pictures without one"),
    (Place::Make, &["env_type", "vectorization_mode", "gym_reset_return_info"],
        "leave it out; the modules of smaclite_pool.integrations have the interfaces of other packages"),
    (Place::Make, &["step_mul", "move_amount", "game_version"], "leave it out; the rules of the game fix it"),
    (Place::Make, &["thread_affinity_offset", "device"], "leave it out; there is no such choice"),

    (Place::Connect, &["name", "pool_name", "address", "host"], "use `pool`, the first argument"),
    (Place::Connect, &["lane_name", "lane_id"], "use `lane`, the second argument"),
    (Place::Connect, &["scenario", "map_name", "num_envs", "batch_size", "seed", "threads", "num_threads",
        "autoreset_mode", "fields", "rules", "opponent", "episode_limit"],
        "`smaclite-pool serve` sets it; `envs.spec` tells its value"),

    (Place::Reset, &["options", "reset_mask", "mask"],
        "use `env_id`, integers [K] or bool [N], to reset some environments"),
    (Place::Reset, &["env_ids", "ids", "indices", "env_idx"], "use `env_id`"),
    (Place::Reset, &["seeds"], "use `seed`, an integer or a list of one per environment"),
    (Place::Reset, &["return_info"], "leave it out; the batch has everything"),

    (Place::Step, &["action", "act"], "use `actions`, the first argument"),
    (Place::Step, &["env_ids", "ids", "indices", "env_idx"], "use `env_id`"),

    (Place::Envs, &["action_space", "observation_space", "single_action_space", "single_observation_space",
        "share_observation_space", "metadata", "action_shape", "observation_shape"], SPACES),
    (Place::Envs, &["save", "clone", "clone_state", "save_state", "get_state_snapshot", "snapshot"],
        "batches have the field `snapshot` with fields=[..., \"snapshot\"]; `reset(snapshots=...)` takes \
         it, and `fork` copies environments"),
    (Place::Envs, &["load", "load_state", "restore", "async_restore", "restore_state", "set_state"],
        "use `reset(snapshots=...)` or `fork`"),
    (Place::Envs, &["get_env_info"], "use `spec`, which has `n_agents`, `n_actions`, `obs_size`, \
        `state_size`, `episode_limit` and more"),
    (Place::Envs, &["get_obs", "get_state", "get_avail_actions", "get_avail_agent_actions", "get_obs_agent",
        "last"], FIELDS_OF_BATCHES),
    (Place::Envs, &["action_masks", "action_mask"], "use `avail_actions` of a batch"),
    (Place::Envs, &["get_obs_size", "get_state_size", "get_total_actions", "obs_shape", "state_shape"],
        "use `spec.obs_size`, `spec.state_size`, `spec.n_actions`"),
    (Place::Envs, &["n_envs", "nenvs", "num_environments"], "use `spec.num_envs`"),
    (Place::Envs, &["num_agents", "possible_agents", "agents", "max_num_agents"], "use `spec.n_agents`"),
    (Place::Envs, &["max_episode_steps", "max_steps", "time_limit"], "use `spec.episode_limit`"),
    (Place::Envs, &["map_name", "task_id"], "use `spec.scenario`"),
    (Place::Envs, &["autoreset"], "use `spec.autoreset_mode`"),
    (Place::Envs, &["name"], "use `spec.pool`"),
    (Place::Envs, &["num_threads", "config", "settings", "description"], "use `spec`"),
    (Place::Envs, &["step_async", "async_step"], "use `send`"),
    (Place::Envs, &["step_wait", "reset_wait"], "use `recv`"),
    (Place::Envs, &["reset_async"], "use `async_reset`"),
    (Place::Envs, &["xla"], "JAX reads batches in place: smaclite_pool.integrations.jax"),
    (Place::Envs, &["all_env_ids"], "ids are 0 to `spec.num_envs` - 1"),
    (Place::Envs, &["sample", "sample_action", "random_actions"], "use `sample_actions`"),
    (Place::Envs, &["is_async"], "compare `spec.batch_size` with `spec.num_envs`"),
    (Place::Envs, &["get_stats"], "sum `battle_won` of the batches in which an episode ended, or use \
        smaclite_pool.evaluate"),
    (Place::Envs, &["render_mode"], "`render()` returns pictures without one"),
    (Place::Envs, &["save_replay"], "use smaclite_pool.Recorder"),

    (Place::Batch, &["action_mask", "action_masks", "available_actions", "avail_action", "avail",
        "legal_actions", "legal_action_mask", "mask"], "use `avail_actions`"),
    (Place::Batch, &["rewards", "rew"], "use `reward`"),
    (Place::Batch, &["done", "dones"], "use `terminated` and `truncated`"),
    (Place::Batch, &["terminations", "terminal", "terminals", "terminates"], "use `terminated`"),
    (Place::Batch, &["truncations", "trunc", "truncates", "timeouts"], "use `truncated`"),
    (Place::Batch, &["observations", "observation", "obs_dict"], "use `obs`"),
    (Place::Batch, &["states", "share_obs", "global_state", "world_state"], "use `state`"),
    (Place::Batch, &["infos", "info"], "what others put there are fields, such as `battle_won`, \
        `episode_return` and `episode_length`"),
    (Place::Batch, &["env_ids", "ids"], "use `env_id`"),
    (Place::Batch, &["elapsed_step", "elapsed_steps", "step_count"], "use `episode_length`"),
    (Place::Batch, &["final_observation", "terminal_observation", "final_observations"], "use `final_obs`"),
    (Place::Batch, &["agent_mask", "active_masks", "alive_mask"], "use `alive`"),
    (Place::Batch, &["won", "win", "is_success"], "use `battle_won`"),
    (Place::Batch, &["numpy", "clone"], "use `copy()`"),
    (Place::Batch, &["to", "cuda"], "use `torch()`, and move its tensors"),

    (Place::Dataset, &["observations", "observation"], "use expand()[\"obs\"]"),
    (Place::Dataset, &["action_mask", "action_masks", "legals"], "use expand()[\"avail_actions\"]"),
    (Place::Dataset, &["rewards"], "use expand()[\"reward\"]"),
    (Place::Dataset, &["terminals", "terminations", "done", "dones"], "use expand()[\"terminated\"]"),
    (Place::Dataset, &["truncations"], "use expand()[\"truncated\"]"),
    (Place::Dataset, &["iterate_episodes", "sample_episodes"], "`episodes` has `start` and `length`, the \
        rows of each in the arrays of expand()"),
    (Place::Dataset, &["keys", "arrays", "values", "items"], "use expand(), a dict of arrays; \
        smaclite_pool.DATASET_ARRAYS lists them"),
    (Place::Dataset, &["n_episodes", "total_episodes", "num_episodes", "total_steps", "n_steps"],
        "use card[\"episodes\"] and card[\"steps\"]"),
];

/// The arguments of `make`. Its further keywords are keys of scenario files.
const ARGUMENTS: [&str; 18] = [
    "scenario",
    "num_envs",
    "batch_size",
    "seed",
    "threads",
    "autoreset_mode",
    "episode_limit",
    "rules",
    "opponent",
    "sides",
    "fields",
    "obs_last_actions",
    "obs_agent_id",
    "max_held_batches",
    "spectators",
    "wait",
    "name",
    "lanes",
];

/// The keywords of `make`: its arguments, and the keys of scenario files.
fn keywords<'a>() -> impl Iterator<Item = &'a str> {
    let keys = Scenario::keys().iter().map(|key| key.name());
    ARGUMENTS
        .into_iter()
        .chain(keys.filter(|key| !ARGUMENTS.contains(key) && !ScenarioFiles::ONLY_IN_FILES.contains(key)))
}

/// What this name of another package is called in this place.
pub fn translation(place: Place, name: &str) -> Option<&'static str> {
    let lower = name.to_ascii_lowercase();
    let row = TABLE.iter().find(|(at, names, _)| *at == place && names.contains(&lower.as_str()));
    row.map(|(_, _, here)| *here)
}

/// The translation as a part of a sentence, or nothing.
pub fn prefix(place: Place, name: &str) -> String {
    translation(place, name).map_or_else(String::new, |here| format!("{here}; "))
}

/// The end of an error about a name that does not exist: its translation, or the most similar of `valid`.
pub fn hint<'a>(place: Place, name: &str, valid: impl IntoIterator<Item = &'a str>) -> String {
    translation(place, name).map_or_else(|| did_you_mean(name, valid), str::to_owned)
}

/// Refuses keywords that a function does not have, as Python does, with a hint.
pub fn refuse_keywords(
    place: Place,
    function: &str,
    unknown: Option<&Bound<'_, PyDict>>,
    valid: &[&str],
) -> PyResult<()> {
    let Some(name) = unknown.and_then(|unknown| unknown.keys().iter().next()) else { return Ok(()) };
    let name: String = name.extract()?;
    let hint = hint(place, &name, valid.iter().copied());
    Err(PyTypeError::new_err(format!("{function}() got an unexpected keyword argument '{name}'; {hint}")))
}

/// An argument without a default. Python would report that it is missing before its other name is refused.
pub fn required<T>(function: &str, name: &str, argument: Option<T>) -> PyResult<T> {
    argument
        .ok_or_else(|| PyTypeError::new_err(format!("{function}() needs the argument '{name}', got none")))
}

/// The AttributeError of an object that has no such attribute.
pub fn no_attribute(class: &Bound<'_, PyType>, place: Place, name: &str) -> PyErr {
    let class_name = class.name().map_or_else(|_| "object".to_owned(), |name| name.to_string());
    // `copy`, NumPy and others ask for such names and expect no help.
    let hint = if name.starts_with('_') {
        None
    } else {
        let names = class.dir().and_then(|names| names.extract::<Vec<String>>()).unwrap_or_default();
        let names: Vec<String> = names.into_iter().filter(|name| !name.starts_with('_')).collect();
        let of_spec = match place {
            Place::Envs => attributes(class.py()).unwrap_or_default(),
            _ => Vec::new(),
        };
        let in_spec = || of_spec.iter().any(|of_spec| of_spec == name).then(|| format!("use `spec.{name}`"));
        let similar = |names: &[String]| {
            let similar = did_you_mean(name, names.iter().map(String::as_str));
            similar.starts_with("did you mean").then_some(similar)
        };
        let similar_in_spec = || similar(&of_spec).map(|similar| similar.replacen('`', "`spec.", 1));
        let translated = translation(place, name).map(str::to_owned);
        translated.or_else(in_spec).or_else(|| similar(&names)).or_else(similar_in_spec)
    };
    let hint = hint.map_or_else(String::new, |hint| format!("; {hint}"));
    PyAttributeError::new_err(format!("'{class_name}' object has no attribute '{name}'{hint}"))
}

/// The error of environments that are copied or pickled.
pub fn cannot_be_copied() -> PyErr {
    PyTypeError::new_err(
        "environments of a pool cannot be copied or pickled: `fork` copies battles between environments, the \
         field `snapshot` and `reset` carry them to other environments, and another process makes its own \
         or uses connect",
    )
}

/// Refuse settings that `make` does not have, for environments that hand theirs on to it.
///
/// Args:
///     function: what the user called.
///     settings: its further keywords.
///     own: the keywords that it has itself.
///     refused: keywords of `make` that it refuses with an error of its own, which is better than this one.
///
/// Raises:
///     TypeError: a keyword is neither one of `make` nor of `own`.
#[pyfunction]
#[pyo3(signature = (function, settings, own, refused))]
pub fn check_settings(
    function: &str,
    settings: &Bound<'_, PyDict>,
    own: Vec<String>,
    refused: Vec<String>,
) -> PyResult<()> {
    let of_make = keywords().filter(|name| !own.iter().chain(&refused).any(|other| other == name));
    let valid: Vec<&str> = own.iter().map(String::as_str).chain(of_make).collect();
    let unknown = settings.copy()?;
    for name in valid.iter().copied().chain(refused.iter().map(String::as_str)) {
        if unknown.contains(name)? {
            unknown.del_item(name)?;
        }
    }
    refuse_keywords(Place::Make, function, Some(&unknown), &valid)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_has_one_translation() {
        for (index, (place, names, _)) in TABLE.iter().enumerate() {
            let others = TABLE.iter().enumerate().filter(|(other, row)| *other != index && row.0 == *place);
            let double = others.flat_map(|(_, row)| row.1).find(|name| names.contains(name));
            assert_eq!(double, None);
        }
    }

    #[test]
    fn no_keyword_of_make_is_translated() {
        for keyword in keywords() {
            assert_eq!(translation(Place::Make, keyword), None, "{keyword}");
        }
    }
}
