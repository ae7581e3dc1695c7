//! A scenario as a dict: the stats of its units, its map, and the layout of observations and state.

use crate::convert::to_dict;
use crate::errors::class;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Value, json};
use smaclite_engine::{FeatureBlock, obs_features, state_features};
use smaclite_scenarios::{Faction, Scenario, Terrain};
use smaclite_units::{Plane, Targeter, UnitType};
use std::path::{Path, PathBuf};

/// Return everything about a scenario that never changes.
///
/// Args:
///     scenario: name of a standard scenario, or path of a scenario file.
///
/// Returns:
///     A dict with `name`, `width` and `height` (squares), `walkable` (rows of booleans, the southern row
///         first), `attack_point` ([x, y]), `num_unit_types` (length of the type one-hot, 0 for none),
///         `ally_has_shields` and `enemy_has_shields` (whether observations and state contain them),
///         `episode_limit` (steps or None), `allies`, `enemies`, `obs_layout` and `state_layout`.
///         `allies` and `enemies` are lists of dicts, by id, each with `unit_type`, `type_id` (index in the
///         one-hot), `position` ([x, y] at the start), `radius` (squares), `hp`, `shield`, `energy` (maxima),
///         `cooldown` (s), `healer`, `plane`, `targets` (planes that it can attack or heal) and `targeter`.
///         `obs_layout` and `state_layout` are lists of dicts, the parts of an observation and of the state
///         in order, each with `name`, `start` (index of its first feature), `shape` ([features], or [units,
///         features]) and `features` (their names).
///
/// Raises:
///     ScenarioError: the scenario is unknown, or its file or a unit file is invalid.
#[pyfunction]
#[pyo3(signature = (scenario))]
pub fn scenario(py: Python<'_>, scenario: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    to_dict(py, &described(&resolve(py, &scenario)?))
}

/// A standard scenario, or the one in a file; other Python threads run while it is read.
pub fn resolve(py: Python<'_>, name_or_path: &Path) -> PyResult<Scenario> {
    py.detach(|| Scenario::resolve(&name_or_path.to_string_lossy()))
        .map_err(|error| class::ScenarioError::new_err(error.to_string()))
}

fn described(scenario: &Scenario) -> Value {
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

fn layout(blocks: &[FeatureBlock]) -> Vec<Value> {
    let entries = blocks.iter().map(|block| {
        let shape: Vec<usize> = [block.rows, Some(block.features.len())].into_iter().flatten().collect();
        json!({ "name": block.name, "start": block.start, "shape": shape, "features": block.features })
    });
    entries.collect()
}
