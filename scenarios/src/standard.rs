//! The twelve standard scenarios, embedded from `scenarios/data`, and how a scenario is asked for by name or path.

use crate::{Scenario, ScenarioError};
use smaclite_units::file::{did_you_mean, shortened};
use std::path::Path;

/// Names and files, in the order they are listed to people.
const STANDARD: [(&str, &str); 12] = [
    ("10m_vs_11m", include_str!("../data/10m_vs_11m.json")),
    ("27m_vs_30m", include_str!("../data/27m_vs_30m.json")),
    ("2c_vs_64zg", include_str!("../data/2c_vs_64zg.json")),
    ("2s3z", include_str!("../data/2s3z.json")),
    ("2s_vs_1sc", include_str!("../data/2s_vs_1sc.json")),
    ("3s5z", include_str!("../data/3s5z.json")),
    ("3s5z_vs_3s6z", include_str!("../data/3s5z_vs_3s6z.json")),
    ("3s_vs_5z", include_str!("../data/3s_vs_5z.json")),
    ("bane_vs_bane", include_str!("../data/bane_vs_bane.json")),
    ("corridor", include_str!("../data/corridor.json")),
    ("MMM", include_str!("../data/MMM.json")),
    ("MMM2", include_str!("../data/MMM2.json")),
];

impl Scenario {
    /// The standard scenario of that name (`"2s3z"`), if there is one.
    pub fn standard(name: &str) -> Option<Scenario> {
        let (_, text) = STANDARD.iter().find(|(standard, _)| *standard == name)?;
        // A test reads all twelve, so an embedded file never fails here.
        Scenario::from_json(text, &format!("scenarios/data/{name}.json"), Path::new("")).ok()
    }

    /// The names of the standard scenarios.
    pub fn standard_names() -> impl Iterator<Item = &'static str> {
        STANDARD.iter().map(|(name, _)| *name)
    }

    /// The standard scenario of that name, else the scenario file at that path.
    ///
    /// # Errors
    /// [`ScenarioError::Unknown`] with the nearest standard name if it is neither; otherwise as
    /// [`load`](Scenario::load).
    pub fn resolve(name_or_path: &str) -> Result<Scenario, ScenarioError> {
        if let Some(scenario) = Scenario::standard(name_or_path) {
            return Ok(scenario);
        }
        let path = Path::new(name_or_path);
        // What is clearly meant as a path gets the error of a file that cannot be read.
        if path.components().count() > 1 || name_or_path.ends_with(".json") || path.exists() {
            return Scenario::load(path);
        }
        let hint = did_you_mean(name_or_path, Scenario::standard_names());
        Err(ScenarioError::Unknown { name: shortened(name_or_path), hint })
    }
}
