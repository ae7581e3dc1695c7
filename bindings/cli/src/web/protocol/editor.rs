//! What the editor of the program requests and is sent: files on the disk.

use serde::{Deserialize, Serialize};
use smaclite_scenarios::ScenarioFiles;
use std::collections::BTreeMap;
#[cfg(test)]
use ts_rs::TS;

/// Files and checksums of their texts. A page keeps those of the files that it edits, because others may edit
/// them too: a second page, another program, or a page of an earlier run of this one.
pub(crate) type Base = BTreeMap<String, String>;

#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct SaveFiles {
    #[cfg_attr(test, ts(type = "ScenarioFiles"))]
    pub(in crate::web) files: ScenarioFiles,
    /// What the page last opened or saved.
    #[cfg_attr(test, ts(type = "Base"))]
    pub(in crate::web) base: Base,
    /// Whether files are written that were changed since then.
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
    #[cfg_attr(test, ts(type = "Base"))]
    pub(in crate::web) base: Base,
}

/// What was written, or why nothing was.
#[derive(Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
#[cfg_attr(test, derive(TS))]
pub(crate) enum SavedFiles {
    Saved {
        files: Vec<String>,
        #[cfg_attr(test, ts(type = "Base"))]
        base: Base,
    },
    /// Files that were changed since the page opened or saved them.
    Conflicts(Vec<String>),
}
