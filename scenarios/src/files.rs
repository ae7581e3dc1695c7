//! A scenario as the texts of its files, which need no file system to be read again.

use crate::unit_files::Origin;
use crate::{Scenario, ScenarioError};
use serde::{Deserialize, Serialize};
use smaclite_units::file::{MAX_SCENARIO_BYTES, read_text, shown_path};
use std::path::Path;

/// The text of a scenario file and of every unit file that it names.
///
/// ```
/// use smaclite_scenarios::ScenarioFiles;
///
/// let (scenario, files) = ScenarioFiles::resolve("2s3z").unwrap();
/// assert_eq!(files.scenario().unwrap(), scenario);
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ScenarioFiles {
    /// What error messages call the scenario file.
    pub source: String,
    /// The text of the scenario file.
    pub text: String,
    /// The unit files; standard unit types need none.
    pub unit_files: Vec<UnitFile>,
}

/// The text of a unit file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct UnitFile {
    /// The name of the unit type: the stem of the file.
    pub name: String,
    /// The keys of the scenario file that refer to the file.
    pub keys: Vec<String>,
    /// Its text; empty if only `unit_type_ids` refers to the file, which then is not read.
    pub text: String,
}

impl ScenarioFiles {
    /// As [`Scenario::load`], with the texts that the scenario was read from.
    pub(crate) fn load(path: &Path) -> Result<(Scenario, ScenarioFiles), ScenarioError> {
        let base_dir = path.parent().unwrap_or(Path::new(""));
        let (text, source) = (read_text(path, MAX_SCENARIO_BYTES)?, shown_path(path));
        let (scenario, unit_files) = Scenario::read(&text, &source, Origin::Folder(base_dir))?;
        Ok((scenario, ScenarioFiles { source, text, unit_files }))
    }

    /// Reads the scenario; no file is opened.
    ///
    /// # Errors
    /// [`ScenarioError`] for the first mistake in one of the texts.
    pub fn scenario(&self) -> Result<Scenario, ScenarioError> {
        let origin = Origin::Texts(&self.unit_files);
        Scenario::read(&self.text, &self.source, origin).map(|(scenario, _)| scenario)
    }
}
