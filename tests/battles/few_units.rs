//! Battles of a few units on open ground, for tests of single rules.

use std::path::Path;
use std::sync::Arc;

use smaclite_engine::{Arena, Battle, Rules};
use smaclite_scenarios::Scenario;

/// Units are given as in a scenario file: `"MARINE": 2`.
pub fn few_units(rules: Rules, agents: &str, enemies: &str) -> Battle {
    let count = |units: &str| -> u32 {
        units.split(',').filter_map(|unit| unit.rsplit(':').next()?.trim().parse::<u32>().ok()).sum()
    };
    let json = format!(
        r#"{{ "name": "few", "num_allied_units": {}, "num_enemy_units": {}, "groups": [
            {{ "x": 9, "y": 16, "faction": "ALLY", "units": {{ {agents} }} }},
            {{ "x": 23, "y": 16, "faction": "ENEMY", "units": {{ {enemies} }} }} ],
            "terrain_preset": "SIMPLE", "attack_point": [9, 16], "num_unit_types": 0,
            "ally_has_shields": false, "enemy_has_shields": false }}"#,
        count(agents),
        count(enemies),
    );
    let scenario = Scenario::from_json(&json, "few", Path::new(".")).expect("a valid scenario");
    Battle::new(Arc::new(Arena::new(&scenario, rules)), 1)
}
