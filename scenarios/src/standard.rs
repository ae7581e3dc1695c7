//! The 23 standard and the 15 generated scenarios, embedded from `scenarios/data`, and the lookup of a
//! scenario by name or path.
//!
//! They are the maps of SMAC. Twelve are the published environment's own; it plays the other eleven as custom
//! scenarios. In SMAC's 2m_vs_1z the enemies march to a random point between the marines; here it is the
//! point midway between them.

use crate::files::STANDARD_FOLDER;
use crate::{Scenario, ScenarioError, ScenarioFiles};
use smaclite_units::file::{did_you_mean, shortened};
use std::path::Path;

/// Names and files, in the order in which they are listed.
const STANDARD: [(&str, &str); 23] = [
    ("10m_vs_11m", include_str!("../data/10m_vs_11m.json")),
    ("1c3s5z", include_str!("../data/1c3s5z.json")),
    ("25m", include_str!("../data/25m.json")),
    ("27m_vs_30m", include_str!("../data/27m_vs_30m.json")),
    ("2c_vs_64zg", include_str!("../data/2c_vs_64zg.json")),
    ("2m_vs_1z", include_str!("../data/2m_vs_1z.json")),
    ("2s3z", include_str!("../data/2s3z.json")),
    ("2s_vs_1sc", include_str!("../data/2s_vs_1sc.json")),
    ("3m", include_str!("../data/3m.json")),
    ("3s5z", include_str!("../data/3s5z.json")),
    ("3s5z_vs_3s6z", include_str!("../data/3s5z_vs_3s6z.json")),
    ("3s_vs_3z", include_str!("../data/3s_vs_3z.json")),
    ("3s_vs_4z", include_str!("../data/3s_vs_4z.json")),
    ("3s_vs_5z", include_str!("../data/3s_vs_5z.json")),
    ("5m_vs_6m", include_str!("../data/5m_vs_6m.json")),
    ("6h_vs_8z", include_str!("../data/6h_vs_8z.json")),
    ("8m", include_str!("../data/8m.json")),
    ("8m_vs_9m", include_str!("../data/8m_vs_9m.json")),
    ("bane_vs_bane", include_str!("../data/bane_vs_bane.json")),
    ("corridor", include_str!("../data/corridor.json")),
    ("MMM", include_str!("../data/MMM.json")),
    ("MMM2", include_str!("../data/MMM2.json")),
    ("so_many_baneling", include_str!("../data/so_many_baneling.json")),
];

/// The generated scenarios: SMACv2's tasks under SMAClite's rules. Battles are SMAClite's; what SMACv2's
/// Python code computes from the units is what that code computes.
const GENERATED: [(&str, &str); 15] = [
    ("protoss_5_vs_5", include_str!("../data/protoss_5_vs_5.json")),
    ("protoss_10_vs_10", include_str!("../data/protoss_10_vs_10.json")),
    ("protoss_10_vs_11", include_str!("../data/protoss_10_vs_11.json")),
    ("protoss_20_vs_20", include_str!("../data/protoss_20_vs_20.json")),
    ("protoss_20_vs_23", include_str!("../data/protoss_20_vs_23.json")),
    ("terran_5_vs_5", include_str!("../data/terran_5_vs_5.json")),
    ("terran_10_vs_10", include_str!("../data/terran_10_vs_10.json")),
    ("terran_10_vs_11", include_str!("../data/terran_10_vs_11.json")),
    ("terran_20_vs_20", include_str!("../data/terran_20_vs_20.json")),
    ("terran_20_vs_23", include_str!("../data/terran_20_vs_23.json")),
    ("zerg_5_vs_5", include_str!("../data/zerg_5_vs_5.json")),
    ("zerg_10_vs_10", include_str!("../data/zerg_10_vs_10.json")),
    ("zerg_10_vs_11", include_str!("../data/zerg_10_vs_11.json")),
    ("zerg_20_vs_20", include_str!("../data/zerg_20_vs_20.json")),
    ("zerg_20_vs_23", include_str!("../data/zerg_20_vs_23.json")),
];

fn all() -> impl Iterator<Item = &'static (&'static str, &'static str)> {
    STANDARD.iter().chain(&GENERATED)
}

impl Scenario {
    /// The standard or generated scenario of that name (`"2s3z"`), if there is one.
    pub fn standard(name: &str) -> Option<Scenario> {
        // A test reads all of them, so an embedded file never fails here.
        ScenarioFiles::standard(name)?.scenario().ok()
    }

    /// The names of the standard scenarios, whose units are always the same.
    pub fn standard_names() -> impl Iterator<Item = &'static str> {
        STANDARD.iter().map(|(name, _)| *name)
    }

    /// The names of the generated scenarios, whose teams and start positions are drawn for each episode.
    pub fn generated_names() -> impl Iterator<Item = &'static str> {
        GENERATED.iter().map(|(name, _)| *name)
    }

    /// The standard scenario of that name, else the scenario file at that path.
    ///
    /// # Errors
    /// [`ScenarioError::Unknown`] with the closest standard name if it is neither; otherwise as
    /// [`load`](Scenario::load).
    pub fn resolve(name_or_path: &str) -> Result<Scenario, ScenarioError> {
        ScenarioFiles::resolve(name_or_path).map(|(scenario, _)| scenario)
    }
}

impl ScenarioFiles {
    /// The file of the standard or generated scenario of that name, if there is one.
    pub fn standard(name: &str) -> Option<ScenarioFiles> {
        let (_, text) = all().find(|(standard, _)| *standard == name)?;
        let source = format!("{STANDARD_FOLDER}{name}.json");
        Some(ScenarioFiles { source, text: (*text).into(), unit_files: Vec::new() })
    }

    /// Whether this is the file of a standard or generated scenario.
    pub fn is_standard(&self) -> bool {
        all().any(|(_, text)| *text == self.text)
    }

    /// As [`Scenario::resolve`], with the texts that the scenario was read from.
    ///
    /// # Errors
    /// As [`Scenario::resolve`].
    pub fn resolve(name_or_path: &str) -> Result<(Scenario, ScenarioFiles), ScenarioError> {
        if let Some(files) = ScenarioFiles::standard(name_or_path) {
            return Ok((files.scenario()?, files));
        }
        let path = Path::new(name_or_path);
        // A text that looks like a path gets the error of a file that cannot be read.
        if path.components().count() > 1 || name_or_path.ends_with(".json") || path.exists() {
            return Ok(ScenarioFiles::load(path)?);
        }
        let hint = did_you_mean(name_or_path, all().map(|(name, _)| *name));
        Err(ScenarioError::Unknown { name: shortened(name_or_path), hint })
    }
}
