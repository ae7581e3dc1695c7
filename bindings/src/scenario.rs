//! A scenario as a dict: the stats of its units, its map, and the layout of observations and state; and the
//! numbers of the rules as constants of the module.

use crate::convert::dict_of;
use crate::errors::class;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Value, json};
use smaclite_engine::{
    FeatureBlock, KILL_REWARD, REWARD_SCALE, SIGHT_RANGE, TARGETING_RANGE, WIN_REWARD, action, obs_features,
    state_features,
};
use smaclite_scenarios::{Faction, Scenario, Terrain};
use smaclite_units::{Plane, Targeter, UnitType};
use std::path::{Path, PathBuf};

/// Everything about a scenario that never changes. `scenario` is a standard name or the path of a file.
///
/// Returns a dict with
///
/// - `name`, `episode_limit` (steps or None);
/// - `width` and `height` (squares), `walkable` (rows of booleans, the southern row first), `attack_point`
///   ([x, y]);
/// - `num_unit_types` (length of the type one-hot, 0 for none), `ally_has_shields` and `enemy_has_shields`
///   (whether observations and state contain them);
/// - `allies` and `enemies`: a list of dicts, by id, with `unit_type`, `type_id` (index in the one-hot),
///   `position` ([x, y] at the start), `radius` (squares), `hp`, `shield`, `energy` (maxima), `cooldown`
///   (s), `healer`, `plane`, `targets` (the planes that it can attack or heal) and `targeter`;
/// - `obs_layout` and `state_layout`: a list of dicts, the parts of an observation or state in order, with
///   `name`, `start` (index of the first feature), `shape` ([features], or [units, features]) and `features`
///   (their names).
///
/// Raises ScenarioError if a scenario or unit file is invalid.
#[pyfunction]
#[pyo3(signature = (scenario))]
pub fn scenario(py: Python<'_>, scenario: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    dict_of(py, &describe(&resolve(py, &scenario)?))
}

/// Adds action numbers, ranges and rewards to the module, so that Python does not repeat them.
pub fn add_constants(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let actions = [
        ("NO_OP", action::NO_OP),
        ("STOP", action::STOP),
        ("NORTH", action::NORTH),
        ("SOUTH", action::SOUTH),
        ("EAST", action::EAST),
        ("WEST", action::WEST),
        ("FIRST_TARGET", action::FIRST_TARGET),
    ];
    for (name, value) in actions {
        module.add(name, value)?;
    }
    let quantities = [
        ("SIGHT_RANGE", SIGHT_RANGE),
        ("TARGETING_RANGE", TARGETING_RANGE),
        ("KILL_REWARD", KILL_REWARD),
        ("WIN_REWARD", WIN_REWARD),
        ("REWARD_SCALE", REWARD_SCALE),
    ];
    for (name, value) in quantities {
        module.add(name, value)?;
    }
    Ok(())
}

/// The scenario of that name or in that file; other Python threads run while it is read.
pub fn resolve(py: Python<'_>, name_or_path: &Path) -> PyResult<Scenario> {
    py.detach(|| Scenario::resolve(&name_or_path.to_string_lossy()))
        .map_err(|error| class::ScenarioError::new_err(error.to_string()))
}

fn describe(scenario: &Scenario) -> Value {
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
        "allies": units(scenario, Faction::Ally),
        "enemies": units(scenario, Faction::Enemy),
        "obs_layout": layout(&obs_features(scenario)),
        "state_layout": layout(&state_features(scenario)),
    })
}

fn walkable(terrain: &Terrain) -> Vec<Vec<bool>> {
    let (width, height) = (i64::from(terrain.width()), i64::from(terrain.height()));
    (0..height).map(|y| (0..width).map(|x| terrain.is_walkable(x, y)).collect()).collect()
}

fn units(scenario: &Scenario, faction: Faction) -> Vec<Value> {
    let side = scenario.units.iter().filter(|unit| unit.faction == faction);
    side.map(|unit| {
        let stats = &scenario.unit_types[unit.unit_type];
        json!({
            "unit_type": stats.name,
            "type_id": scenario.type_ids[unit.unit_type],
            "position": unit.position,
            "radius": stats.radius(),
            "hp": stats.hp,
            "shield": stats.shield,
            "energy": stats.energy,
            "cooldown": stats.cooldown,
            "healer": stats.is_healer(),
            "plane": stats.plane.to_string(),
            "targets": targets(stats),
            "targeter": targeter(&stats.targeter),
        })
    })
    .collect()
}

/// The planes whose units this type can attack or heal.
fn targets(unit_type: &UnitType) -> Vec<String> {
    let planes = [Plane::Ground, Plane::Air, Plane::Colossus].into_iter();
    planes.filter(|plane| unit_type.can_attack(*plane)).map(|plane| plane.to_string()).collect()
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

fn layout(blocks: &[FeatureBlock]) -> Vec<Value> {
    let described = blocks.iter().map(|block| {
        let shape: Vec<usize> = [block.rows, Some(block.features.len())].into_iter().flatten().collect();
        json!({ "name": block.name, "start": block.start, "shape": shape, "features": block.features })
    });
    described.collect()
}
