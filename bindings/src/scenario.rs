//! A scenario as a dict: the stats of its units, its map, and the layout of observations and state.

use crate::convert::to_dict;
use crate::envs::arg::ScenarioArg;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Value, json};
use smaclite_engine::{
    Arena, FeatureBlock, Rules, SIGHT_RANGE, action_names, feature_bounds, obs_features, state_features,
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
///     A dict with `name`, `width` and `height` (squares), `walkable` (rows of booleans, the southern row
///         first), `attack_point` ([x, y]), `num_unit_types` (length of the type one-hot, 0 for none),
///         `ally_has_shields` and `enemy_has_shields` (whether observations and state contain them),
///         `episode_limit` (steps or None), `teams_are_drawn` (whether each episode draws the types of the
///         units; then `allies` and `enemies` are one sample), `unit_types` (a list of dicts with
///         `unit_type`, `type_id`, `healer` and `sight_range`, by which agents of the type see distances
///         divided), `actions` (the names of an agent's actions), `allies`, `enemies`, `obs_layout` and
///         `state_layout`. `allies` and `enemies` are lists of dicts, by id, each with `unit_type`, `type_id`
///         (index in the one-hot), `position` ([x, y] at the start), `radius` (squares), `hp`, `shield`,
///         `energy` (maxima), `cooldown` and `max_cooldown` (s; the state has cooldowns divided by the
///         second), `healer`, `plane`, `targets` (planes that it can attack or heal) and `targeter`.
///         `obs_layout` and `state_layout` are lists of dicts, the parts of an observation and of the state
///         in order, each with `name`, `start` (index of its first feature), `shape` ([features], or [units,
///         features]), `features` (their names), and `low` and `high` (their least and greatest values).
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
        "width": scenario.terrain.width(),
        "height": scenario.terrain.height(),
        "walkable": walkable(&scenario.terrain),
        "attack_point": scenario.attack_point,
        "num_unit_types": scenario.num_unit_types,
        "ally_has_shields": scenario.ally_has_shields,
        "enemy_has_shields": scenario.enemy_has_shields,
        "episode_limit": scenario.episode_limit,
        "teams_are_drawn": scenario.draws_teams(),
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
    let ranges_differ = scenario.smacv2.as_ref().is_some_and(|options| options.use_unit_ranges);
    let types = scenario.unit_types.iter().zip(&scenario.type_ids);
    types
        .map(|(stats, type_id)| {
            json!({
                "unit_type": stats.name,
                "type_id": type_id,
                "healer": stats.is_healer(),
                "sight_range": if ranges_differ { stats.sight_range } else { SIGHT_RANGE },
            })
        })
        .collect()
}

fn units(scenario: &Scenario, arena: &Arena, faction: Faction) -> Vec<Value> {
    let side = scenario.units.iter().enumerate().filter(|(_, unit)| unit.faction == faction);
    side.map(|(id, unit)| {
        let stats = &scenario.unit_types[unit.unit_type];
        // SMACv2's interface leaves the random delay out.
        let is_whole = scenario.smacv2.is_none();
        let max_cooldown = if is_whole { stats.greatest_cooldown() } else { stats.cooldown };
        json!({
            "unit_type": stats.name,
            "type_id": scenario.type_ids[unit.unit_type],
            "position": if arena.rules() == Rules::Starcraft { arena.start(id) } else { unit.position },
            "radius": stats.radius(),
            "hp": stats.hp,
            "shield": stats.shield,
            "energy": stats.energy,
            "cooldown": stats.cooldown,
            "max_cooldown": max_cooldown,
            "healer": stats.is_healer(),
            "plane": stats.plane.to_string(),
            "targets": targets(stats),
            "targeter": targeter(&stats.targeter),
        })
    })
    .collect()
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
