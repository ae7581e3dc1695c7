//! What is built in (scenarios, terrains, unit types, rules), and the keys of files as their crates
//! declare them.

use super::protocol::{Builtins, FileFormat, KeyFormat, NamedText, Preset, StandardUnit, TargeterFormat};
use serde_json::json;
use smaclite_engine::Rules;
use smaclite_scenarios::{Scenario, ScenarioFiles, Terrain, is_replaceable};
use smaclite_units::UnitType;
use smaclite_units::file::AnyKey;

/// A scenario to begin with: three marines on each side.
pub fn new_scenario(name: &str) -> String {
    let marines = ScenarioFiles::resolve("3m").map(|(_, files)| files.text).unwrap_or_default();
    marines.replacen("\"3m\"", &json!(name).to_string(), 1)
}

pub(crate) fn builtins() -> Builtins {
    let scenario = |name| Some(NamedText { name, text: ScenarioFiles::resolve(name).ok()?.1.text });
    let preset = |name| Some(Preset { name, rows: rows(&Terrain::preset(name)?) });
    let unit = |name| {
        let text = UnitType::standard_file(name)?;
        Some(StandardUnit { name, text, is_replaceable: is_replaceable(name) })
    };
    let targeter = |(name, keys)| TargeterFormat { name, parameters: formats(keys) };
    Builtins {
        new: new_scenario("new_scenario"),
        scenarios: Scenario::standard_names()
            .chain(Scenario::generated_names())
            .filter_map(scenario)
            .collect(),
        presets: Terrain::preset_names().filter_map(preset).collect(),
        units: UnitType::standard_names().filter_map(unit).collect(),
        rules: Rules::ALL.map(|rules| rules.to_string()).to_vec(),
        scenario_format: FileFormat { keys: formats(Scenario::keys()) },
        unit_format: FileFormat { keys: formats(UnitType::keys()) },
        targeters: UnitType::targeters().map(targeter).collect(),
    }
}

fn formats(keys: &[&dyn AnyKey]) -> Vec<KeyFormat> {
    let format = |key: &&dyn AnyKey| KeyFormat { name: key.name(), schema: key.schema() };
    keys.iter().map(format).collect()
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
        let builtins = builtins();
        for preset in &builtins.presets {
            let rows = format!("\"terrain\": {}", serde_json::json!(preset.rows));
            let text = files.text.replace("\"terrain_preset\": \"SIMPLE\"", &rows);
            let scenario = ScenarioFiles { text, ..files.clone() }.scenario().unwrap();
            assert_eq!(scenario.terrain, Terrain::preset(preset.name).unwrap());
        }
        assert_eq!((builtins.scenarios.len(), builtins.units.len()), (38, 10));
        let replaceable = builtins.units.iter().filter(|unit| unit.is_replaceable);
        assert_eq!(replaceable.map(|unit| unit.name).collect::<Vec<_>>(), ["HYDRALISK"]);
    }

    /// The tests of the scripts read the file that this one writes.
    #[test]
    fn generated_types_for_the_tests_of_the_scripts() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/page/editor/builtins.json");
        let mut builtins = builtins();
        builtins.scenarios.retain(|scenario| scenario.name == "2s3z");
        builtins.presets.retain(|preset| preset.name == "SIMPLE");
        // A line per key of a file.
        let text = json!(builtins).to_string().replace("},{\"name\"", "},\n{\"name\"") + "\n";
        if std::env::var_os("SMACLITE_WRITE").is_some() {
            std::fs::write(file, &text).unwrap();
        }
        let written = std::fs::read_to_string(file).unwrap_or_default();
        assert!(written == text, "it has changed: run `just generate`");
    }
}
