//! What the scenario editor requests and is sent.

use serde::{Deserialize, Serialize};
use smaclite_scenarios::ScenarioFiles;
use smaclite_units::file::Problem;
use smaclite_view::page::TypeInfo;
#[cfg(test)]
use ts_rs::TS;

/// A group as the page reads it; the scenario around it may be invalid.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct Group {
    pub(in crate::web) x: f64,
    pub(in crate::web) y: f64,
    pub(in crate::web) faction: String,
    /// Types and their counts.
    pub(in crate::web) units: Vec<(String, u32)>,
}

#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct PlayBattle {
    #[cfg_attr(test, ts(type = "ScenarioFiles"))]
    pub(in crate::web) files: ScenarioFiles,
    pub(in crate::web) policy: String,
    /// A whole number; as a text, because JavaScript has no 64-bit integers.
    pub(in crate::web) seed: String,
    pub(in crate::web) rules: String,
}

#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct SaveFiles {
    #[cfg_attr(test, ts(type = "ScenarioFiles"))]
    pub(in crate::web) files: ScenarioFiles,
    /// Whether files are written that were changed by another program since they were read.
    pub(in crate::web) replace: bool,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct Builtins {
    /// The text of a new scenario.
    pub(in crate::web) new: String,
    pub(in crate::web) scenarios: Vec<NamedText>,
    pub(in crate::web) presets: Vec<Preset>,
    pub(in crate::web) units: Vec<StandardUnit>,
    pub(in crate::web) policies: Vec<&'static str>,
    pub(in crate::web) rules: Vec<String>,
    pub(in crate::web) scenario_format: FileFormat,
    pub(in crate::web) unit_format: FileFormat,
    /// Keywords of `targeter`, with the parameters of each.
    pub(in crate::web) targeters: Vec<TargeterFormat>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct NamedText {
    pub(in crate::web) name: &'static str,
    pub(in crate::web) text: String,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct Preset {
    pub(in crate::web) name: &'static str,
    /// As scenario files have them: the southernmost first.
    pub(in crate::web) rows: Vec<String>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct StandardUnit {
    pub(in crate::web) name: &'static str,
    pub(in crate::web) text: &'static str,
    /// Whether a unit file of this name has priority over it.
    pub(in crate::web) is_replaceable: bool,
}

/// The keys of a kind of files.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct FileFormat {
    /// In the order in which files have them.
    pub(in crate::web) keys: Vec<KeyFormat>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct KeyFormat {
    pub(in crate::web) name: &'static str,
    pub(in crate::web) is_required: bool,
    /// Of its value: type, range, keywords, default, description.
    #[cfg_attr(test, ts(type = "JsonSchema"))]
    pub(in crate::web) schema: serde_json::Value,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct TargeterFormat {
    pub(in crate::web) name: &'static str,
    pub(in crate::web) parameters: Vec<KeyFormat>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct OpenedFiles {
    #[cfg_attr(test, ts(type = "ScenarioFiles"))]
    pub(in crate::web) files: ScenarioFiles,
    /// The file that is saved, if the command names one.
    pub(in crate::web) target: Option<String>,
    /// Whether it exists.
    pub(in crate::web) exists: bool,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct CheckedFiles {
    #[cfg_attr(test, ts(type = "Problem[]"))]
    pub(in crate::web) problems: Vec<Problem>,
    /// What is probably a mistake in a valid scenario.
    #[cfg_attr(test, ts(type = "Problem[]"))]
    pub(in crate::web) warnings: Vec<Problem>,
    /// Of a valid scenario.
    pub(in crate::web) summary: Option<Summary>,
    #[cfg_attr(test, ts(type = "TypeInfo[]"))]
    pub(in crate::web) types: Vec<TypeInfo>,
    /// The units of each group: `[index in types, x, y]`; none if a type is unknown.
    pub(in crate::web) groups: Vec<Option<Vec<(usize, f64, f64)>>>,
    /// The units that a seed draws in a valid generated scenario: `[index in types, faction, x, y]`, where
    /// the faction is 0 for allies and 1 for enemies.
    pub(in crate::web) drawn: Option<Vec<(usize, usize, f32, f32)>>,
    pub(in crate::web) sight: f64,
}

/// What `smaclite-pool check` prints of a valid scenario.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct Summary {
    pub(in crate::web) n_agents: usize,
    pub(in crate::web) n_enemies: usize,
    pub(in crate::web) n_actions: usize,
    pub(in crate::web) obs_size: usize,
    pub(in crate::web) state_size: usize,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct PlayedBattle {
    /// The page of a replay.
    pub(in crate::web) page: String,
    pub(in crate::web) steps: u32,
    /// Steps after which a limit of the editor ended it, not the scenario's.
    pub(in crate::web) cut_at: Option<u32>,
}

/// What was written, or why nothing was.
#[derive(Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
#[cfg_attr(test, derive(TS))]
pub(crate) enum SavedFiles {
    Saved(Vec<String>),
    /// Files that another program changed.
    Conflicts(Vec<String>),
}
