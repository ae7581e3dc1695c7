//! What the editor of the program requests and is sent: files on the disk.

use serde::{Deserialize, Serialize};
use smaclite_scenarios::ScenarioFiles;
#[cfg(test)]
use ts_rs::TS;

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
pub(crate) struct OpenedFiles {
    #[cfg_attr(test, ts(type = "ScenarioFiles"))]
    pub(in crate::web) files: ScenarioFiles,
    /// The file that is saved, if the command names one.
    pub(in crate::web) target: Option<String>,
    /// Whether it exists.
    pub(in crate::web) exists: bool,
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
