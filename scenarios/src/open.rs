//! Scenarios that are edited: their files may be invalid, and their unit types are looked up one by one.

use crate::ScenarioFiles;
use crate::unit_files::{Origin, UnitFiles};
use smaclite_units::UnitType;
use smaclite_units::file::{FileError, Json, MAX_SCENARIO_BYTES, Node, read_text, shown_path};
use std::path::{Path, PathBuf};

impl ScenarioFiles {
    /// The texts of a scenario file and of the unit files that it names, whether they are valid or not, and
    /// the path of each of the unit files. Unit types without a file are left out.
    ///
    /// # Errors
    /// [`FileError::Unreadable`] if the scenario file cannot be read.
    pub fn open(path: &Path) -> Result<(ScenarioFiles, Vec<PathBuf>), FileError> {
        let (text, source) = (read_text(path, MAX_SCENARIO_BYTES)?, shown_path(path));
        let json = Json::parse(&text, &source).unwrap_or(Json::Null);
        let base_dir = path.parent().unwrap_or(Path::new(""));
        let custom_unit_path = match get(&json, "custom_unit_path") {
            Some(Json::String(custom)) => Some(custom.as_str()),
            _ => None,
        };
        let files = UnitFiles::new(&source, Origin::Folder(base_dir), custom_unit_path);
        for key in unit_keys(&json) {
            let node = Node::root(&source, &Json::Null);
            if let Ok(found) = files.find(key, &node) {
                let _ = files.load(&found, &node); // notes the text, also of an invalid file
            }
        }
        let (paths, unit_files) = files.into_found_at().into_iter().unzip();
        Ok((ScenarioFiles { source, text, unit_files }, paths))
    }

    /// The unit type that a key of the scenario file names, if it is valid.
    pub fn unit_type(&self, key: &str) -> Option<UnitType> {
        let files = UnitFiles::new(&self.source, Origin::Texts(&self.unit_files), None);
        let node = Node::root(&self.source, &Json::Null);
        let found = files.find(key, &node).ok()?;
        files.load(&found, &node).ok()
    }
}

/// Every key of a scenario file that names a unit type.
fn unit_keys(json: &Json) -> Vec<&str> {
    let groups = match get(json, "groups") {
        Some(Json::Array(groups)) => groups.as_slice(),
        _ => &[],
    };
    let named = groups.iter().filter_map(|group| get(group, "units")).chain(get(json, "unit_type_ids"));
    named.flat_map(entries).map(|(key, _)| key.as_str()).collect()
}

fn entries(json: &Json) -> &[(String, Json)] {
    if let Json::Object(entries) = json { entries } else { &[] }
}

fn get<'a>(json: &'a Json, key: &str) -> Option<&'a Json> {
    entries(json).iter().find(|(name, _)| name == key).map(|(_, value)| value)
}
