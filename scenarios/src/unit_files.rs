//! The search for the unit type that a scenario file names: a standard type, or a file in one of a few
//! folders.

use crate::ScenarioError;
use smaclite_units::UnitType;
use smaclite_units::file::{FileError, Node, did_you_mean, shown_path};
use std::fmt;
use std::path::{Path, PathBuf};

/// The standard type that the published environment lacks. Scenarios for that environment define it in a
/// file, so a file of this name has priority.
const ADDED: &str = "HYDRALISK";

/// The identity of a unit type: two names of one file are one type.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum UnitSource {
    Standard(String),
    File(PathBuf),
}

impl fmt::Display for UnitSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            UnitSource::Standard(name) => f.write_str(name),
            UnitSource::File(path) => f.write_str(&shown_path(path)),
        }
    }
}

/// Where a scenario's unit files are searched.
pub(crate) struct UnitFiles<'a> {
    scenario: &'a str,
    /// None for an embedded scenario, which uses no unit files.
    base_dir: Option<&'a Path>,
    custom_unit_path: Option<PathBuf>,
}

impl<'a> UnitFiles<'a> {
    /// For the scenario file called `scenario` in the folder `base_dir`.
    pub(crate) fn new(scenario: &'a str, base_dir: Option<&'a Path>, custom_unit_path: Option<&str>) -> Self {
        UnitFiles { scenario, base_dir, custom_unit_path: custom_unit_path.map(PathBuf::from) }
    }

    /// The unit type that `name`, the key of entry `node`, refers to. Standard names have priority, except
    /// [`ADDED`].
    pub(crate) fn find(&self, name: &str, node: &Node) -> Result<UnitSource, ScenarioError> {
        let is_standard = UnitType::standard_names().any(|standard| standard == name);
        if is_standard && name != ADDED {
            return Ok(UnitSource::Standard(name.into()));
        }
        let candidates = self.candidates(name);
        if let Some(path) = candidates.iter().find(|path| path.is_file()) {
            // Canonical, so that two names of one file are equal.
            return Ok(UnitSource::File(path.canonicalize().unwrap_or_else(|_| path.clone())));
        }
        if is_standard {
            return Ok(UnitSource::Standard(name.into()));
        }
        let tried: Vec<_> = candidates.iter().map(|path| shown_path(path)).collect();
        Err(ScenarioError::UnknownUnit {
            file: self.scenario.into(),
            key: node.key().into(),
            hint: did_you_mean(name, UnitType::standard_names()),
            tried: tried.join(", "),
        })
    }

    /// Reads the type of `source`, which entry `node` of the scenario names.
    pub(crate) fn load(&self, source: &UnitSource, node: &Node) -> Result<UnitType, ScenarioError> {
        let loaded = match source {
            UnitSource::Standard(name) => {
                return UnitType::standard(name).ok_or_else(|| node.invalid("a standard type").into());
            }
            UnitSource::File(path) => UnitType::load(path),
        };
        loaded.map_err(|error| self.invalid_unit(node.key(), error))
    }

    /// The error that the unit type named at `key` is invalid.
    pub(crate) fn invalid_unit(&self, key: &str, error: FileError) -> ScenarioError {
        ScenarioError::UnitFile { scenario: self.scenario.into(), key: key.into(), error: Box::new(error) }
    }

    /// The paths that `name` may refer to, by descending priority: in `custom_unit_path`, which is itself
    /// relative to the scenario file or to the working directory, then beside the scenario file, then in the
    /// working directory.
    fn candidates(&self, name: &str) -> Vec<PathBuf> {
        let name = if name.ends_with(".json") { name.to_owned() } else { format!("{name}.json") };
        let mut candidates = Vec::new();
        let Some(base_dir) = self.base_dir else {
            return candidates;
        };
        if let Some(custom) = &self.custom_unit_path {
            candidates.push(base_dir.join(custom).join(&name));
            candidates.push(custom.join(&name));
        }
        candidates.push(base_dir.join(&name));
        candidates.push(PathBuf::from(name));
        // Adjacent paths are equal for absolute paths and for a scenario file in the working directory.
        candidates.dedup();
        candidates
    }
}
