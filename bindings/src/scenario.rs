//! A scenario as a dict: the stats of its units, its map, and the layout of observations and state.

use crate::convert::to_dict;
use crate::envs::arg::ScenarioArg;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Map, Value, json};
use smaclite_engine::{
    Arena, FeatureBlock, Rules, action_names, agent_ranges, feature_bounds, obs_features, state_features,
};
use smaclite_scenarios::{Faction, Scenario, Terrain};
use smaclite_units::{Plane, Targeter, UnitType};

/// Return everything about a scenario that never changes.
///
/// Args:
///     scenario: name of a standard scenario, path of a scenario file, or environments, for their scenario
///         and its figures under their rules; those of a name are SMAClite's.
///
/// Returns:
///     A dict with `name`, `hash` (16 hexadecimal digits, equal for scenarios and unit types that are equal
///         in all that files say), `width` and `height` (squares), `walkable` (rows of booleans, the southern
///         row first), `attack_point` ([x, y]), `num_unit_types` (length of the type one-hot, 0 for none),
///         `ally_has_shields` and `enemy_has_shields` (whether observations and state contain them),
///         `episode_limit` (steps or None), `teams_are_drawn` (whether each episode draws the types of the
///         units; then `allies` and `enemies` are one sample), `smacv2` (all options of SMACv2's interface,
///         or None without that key), `unit_types`, `actions` (the names of an
///         agent's actions), `allies`, `enemies`, `obs_layout` and `state_layout`. `unit_types` is a list of
///         dicts, each with `unit_type`, `type_id` (index in the one-hot), `sight_range` (squares, by which
///         agents of the type see distances divided), `targeting_range` (squares, within which they can
///         choose targets), `radius` (squares), `hp`, `shield`, `energy` (maxima),
///         `cooldown` and `max_cooldown` (s; the state has cooldowns divided by the second), `healer`,
///         `plane`, `targets` (planes that it can attack or heal) and `targeter`. `allies` and `enemies` are
///         lists of dicts, by id, with the same keys and `position` ([x, y] at the start). `obs_layout` and
///         `state_layout` are lists of dicts, the parts of an observation and of the state in order, each
///         with `name`, `start` (index of its first feature), `shape` ([features], or [units, features]),
///         `features` (their names), and `low` and `high` (bounds of their values).
///
/// Raises:
///     ScenarioError: the scenario is unknown, or its file or a unit file is invalid.
#[pyfunction]
#[pyo3(signature = (scenario))]
pub fn scenario<'py>(py: Python<'py>, scenario: ScenarioArg<'py>) -> PyResult<Bound<'py, PyDict>> {
    let rules = scenario.rules()?;
    to_dict(py, &described(&scenario.resolve(py)?, rules))
}

fn described(scenario: &Scenario, rules: Rules) -> Value {
    let arena = Arena::new(scenario, rules);
    let scenario = &*rules.figures(scenario);
    json!({
        "name": scenario.name,
        "hash": format!("{:016x}", arena.scenario_hash()),
        "width": scenario.terrain.width(),
        "height": scenario.terrain.height(),
        "walkable": walkable(&scenario.terrain),
        "attack_point": scenario.attack_point,
        "num_unit_types": scenario.num_unit_types,
        "ally_has_shields": scenario.ally_has_shields,
        "enemy_has_shields": scenario.enemy_has_shields,
        "episode_limit": scenario.episode_limit,
        "teams_are_drawn": scenario.draws_teams(),
        "smacv2": scenario.smacv2,
        "unit_types": unit_types(scenario),
        "actions": action_names(scenario),
        "allies": units(scenario, &arena, Faction::Ally),
        "enemies": units(scenario, &arena, Faction::Enemy),
        "obs_layout": layout(scenario, &obs_features(scenario)),
        "state_layout": layout(scenario, &state_features(scenario)),
    })
}

fn walkable(terrain: &Terrain) -> Vec<Vec<bool>> {
    let (width, height) = (i64::from(terrain.width()), i64::from(terrain.height()));
    (0..height).map(|y| (0..width).map(|x| terrain.is_walkable(x, y)).collect()).collect()
}

fn unit_types(scenario: &Scenario) -> Vec<Value> {
    (0..scenario.unit_types.len()).map(|index| Value::Object(figures(scenario, index))).collect()
}

fn units(scenario: &Scenario, arena: &Arena, faction: Faction) -> Vec<Value> {
    let side = scenario.units.iter().enumerate().filter(|(_, unit)| unit.faction == faction);
    side.map(|(id, unit)| {
        let is_starcraft = arena.rules() == Rules::Starcraft;
        let position = if is_starcraft { arena.start(id) } else { unit.position };
        let mut figures = figures(scenario, unit.unit_type);
        figures.insert("position".to_owned(), json!(position));
        Value::Object(figures)
    })
    .collect()
}

/// What is true of all units of a type.
fn figures(scenario: &Scenario, unit_type: usize) -> Map<String, Value> {
    let stats = &scenario.unit_types[unit_type];
    let [sight_range, targeting_range] = agent_ranges(scenario.smacv2.as_ref(), stats);
    // SMACv2's interface leaves the random delay out.
    let is_whole = scenario.smacv2.is_none();
    let max_cooldown = if is_whole { stats.greatest_cooldown() } else { stats.cooldown };
    let figures = [
        ("unit_type", json!(stats.name)),
        ("type_id", json!(scenario.type_ids[unit_type])),
        ("sight_range", json!(sight_range)),
        ("targeting_range", json!(targeting_range)),
        ("radius", json!(stats.radius())),
        ("hp", json!(stats.hp)),
        ("shield", json!(stats.shield)),
        ("energy", json!(stats.energy)),
        ("cooldown", json!(stats.cooldown)),
        ("max_cooldown", json!(max_cooldown)),
        ("healer", json!(stats.is_healer())),
        ("plane", json!(stats.plane.to_string())),
        ("targets", json!(targets(stats))),
        ("targeter", json!(targeter(&stats.targeter))),
    ];
    figures.map(|(key, value)| (key.to_owned(), value)).into_iter().collect()
}

/// The planes whose units this type can act on.
fn targets(stats: &UnitType) -> Vec<String> {
    let planes = [Plane::Ground, Plane::Air, Plane::Colossus].into_iter();
    planes.filter(|plane| stats.can_attack(*plane)).map(|plane| plane.to_string()).collect()
}

/// The targeter's name in a unit file.
fn targeter(targeter: &Targeter) -> &'static str {
    match targeter {
        Targeter::Standard => "STANDARD",
        Targeter::Kamikaze { .. } => "KAMIKAZE",
        Targeter::LaserBeam { .. } => "LASER_BEAM",
        Targeter::Heal => "HEAL",
    }
}

fn layout(scenario: &Scenario, blocks: &[FeatureBlock]) -> Vec<Value> {
    let entries = blocks.iter().map(|block| {
        let shape: Vec<usize> = [block.rows, Some(block.features.len())].into_iter().flatten().collect();
        let (low, high): (Vec<f32>, Vec<f32>) =
            feature_bounds(scenario, block).into_iter().map(|[low, high]| (low, high)).unzip();
        json!({
            "name": block.name,
            "start": block.start,
            "shape": shape,
            "features": block.features,
            "low": low,
            "high": high,
        })
    });
    entries.collect()
}
