//! `standard`: the scenarios, terrains, unit types and policies that are built in.

use crate::new::default_scenario;
use serde_json::{Value, json};
use smaclite_engine::Rules;
use smaclite_engine::policy::Scripted;
use smaclite_scenarios::{Scenario, ScenarioFiles, Terrain};
use smaclite_units::UnitType;

pub(super) fn standard() -> Value {
    let scenario = |name: &str| {
        let (_, files) = ScenarioFiles::resolve(name).ok()?;
        Some(json!({"name": name, "text": files.text}))
    };
    let preset = |name: &str| Some(json!({"name": name, "rows": rows(&Terrain::preset(name)?)}));
    let unit = |name: &str| Some(json!({"name": name, "text": UnitType::standard_file(name)?}));
    json!({
        "new": default_scenario("new_scenario"),
        "scenarios": Scenario::standard_names().filter_map(scenario).collect::<Vec<_>>(),
        "presets": Terrain::preset_names().filter_map(preset).collect::<Vec<_>>(),
        "units": UnitType::standard_names().filter_map(unit).collect::<Vec<_>>(),
        "policies": Scripted::NAMES,
        "rules": [Rules::Smaclite.to_string(), Rules::Paper.to_string()],
    })
}

/// The rows of a map as scenario files have them: the southernmost first.
fn rows(terrain: &Terrain) -> Vec<String> {
    let row = |y: u32| {
        let is_walkable = |x: u32| terrain.is_walkable(x.into(), y.into());
        (0..terrain.width()).map(|x| if is_walkable(x) { '_' } else { 'X' }).collect()
    };
    (0..terrain.height()).map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_preset_as_rows_is_the_same_map() {
        let (_, files) = ScenarioFiles::resolve("2s3z").unwrap();
        for preset in standard()["presets"].as_array().unwrap() {
            let text = files
                .text
                .replace("\"terrain_preset\": \"SIMPLE\"", &format!("\"terrain\": {}", preset["rows"]));
            let scenario = ScenarioFiles { text, ..files.clone() }.scenario().unwrap();
            assert_eq!(scenario.terrain, Terrain::preset(preset["name"].as_str().unwrap()).unwrap());
        }
        assert_eq!(standard()["scenarios"].as_array().unwrap().len(), 23);
        assert_eq!(standard()["units"].as_array().unwrap().len(), 10);
    }
}
