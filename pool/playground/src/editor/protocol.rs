//! What the editor asks and is told.

use serde::{Deserialize, Serialize};
use smaclite_units::file::Problem;
use smaclite_view::page::TypeInfo;
#[cfg(test)]
use ts_rs::TS;

/// A group as the page reads it; the scenario around it may be invalid.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct Group {
    pub x: f64,
    pub y: f64,
    pub faction: String,
    /// Types and their counts.
    pub units: Vec<(String, u32)>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct Builtins {
    /// The text of a new scenario.
    pub new: String,
    pub scenarios: Vec<NamedText>,
    pub presets: Vec<Preset>,
    pub units: Vec<StandardUnit>,
    pub rules: Vec<String>,
    pub scenario_format: FileFormat,
    pub unit_format: FileFormat,
    /// Keywords of `targeter`, with the parameters of each.
    pub targeters: Vec<TargeterFormat>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct NamedText {
    pub name: &'static str,
    pub text: String,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct Preset {
    pub name: &'static str,
    /// As scenario files have them: the southernmost first.
    pub rows: Vec<String>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct StandardUnit {
    pub name: &'static str,
    pub text: &'static str,
    /// Whether a unit file of this name has priority over it.
    pub is_replaceable: bool,
}

/// The keys of a kind of files.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct FileFormat {
    /// In the order in which files have them.
    pub keys: Vec<KeyFormat>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct KeyFormat {
    pub name: &'static str,
    /// Of its value: type, range, keywords, default, description.
    #[cfg_attr(test, ts(type = "JsonSchema"))]
    pub schema: serde_json::Value,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct TargeterFormat {
    pub name: &'static str,
    pub parameters: Vec<KeyFormat>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct CheckedFiles {
    /// The first 100 per reader.
    #[cfg_attr(test, ts(type = "Problem[]"))]
    pub problems: Vec<Problem>,
    /// How many there are, also of those that are not listed.
    pub n_problems: usize,
    /// What is probably a mistake in a valid scenario.
    #[cfg_attr(test, ts(type = "Problem[]"))]
    pub warnings: Vec<Problem>,
    /// Of a valid scenario.
    pub summary: Option<Summary>,
    #[cfg_attr(test, ts(type = "TypeInfo[]"))]
    pub types: Vec<TypeInfo>,
    /// The units of each group: `[index in types, x, y]`; none if a type is unknown.
    pub groups: Vec<Option<Vec<(usize, f64, f64)>>>,
    /// The units that a seed draws in a valid generated scenario: `[index in types, faction, x, y]`, where
    /// the faction is 0 for allies and 1 for enemies.
    pub drawn: Option<Vec<(usize, usize, f32, f32)>>,
}

/// What `smaclite-pool check` prints of a valid scenario.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct Summary {
    pub n_agents: usize,
    pub n_enemies: usize,
    pub n_actions: usize,
    pub obs_size: usize,
    pub state_size: usize,
}
