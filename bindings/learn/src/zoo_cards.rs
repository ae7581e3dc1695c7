//! The cards of the teams in the zoo, and that they are what they say.

use crate::evaluations::Summary;
use crate::tensors::{FileError, read};
use crate::zoo::{folder, zoo_file, zoo_teams};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// How a team of the zoo was trained, and how it plays.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ZooCard {
    /// The scenario, or `all-maps`.
    pub scenario: String,
    /// The seed of its training.
    pub seed: u64,
    /// Environment steps that its weights were learnt from.
    pub steps: u64,
    /// Environment steps of the whole training.
    pub run_steps: u64,
    /// Processor time of the whole training.
    pub cpu_seconds: f64,
    /// Means of the final evaluation, with the most probable actions; of a team that plays every map, means
    /// over the maps of SMAC.
    pub greedy: Summary,
    /// The same with actions that are drawn.
    pub sampled: Summary,
    /// Episodes of each of the two, per map.
    pub episodes: usize,
    /// Of a team that plays every map: the same by map.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub maps: BTreeMap<String, ZooResult>,
}

/// How a team plays on a map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ZooResult {
    /// With the most probable actions.
    pub greedy: Summary,
    /// With actions that are drawn.
    pub sampled: Summary,
}

/// The cards of all teams, in the order of their names.
///
/// # Errors
/// If the program was built with a file that is not a card.
pub fn zoo_cards() -> Result<Vec<ZooCard>, FileError> {
    zoo_teams().map(|name| read_card(&folder(name))).collect()
}

/// The card of a team, if it is one of the zoo.
///
/// # Errors
/// As [`zoo_cards`].
pub fn zoo_card(folder: &Path) -> Result<Option<ZooCard>, FileError> {
    zoo_file(&folder.join("card.json")).is_some().then(|| read_card(folder)).transpose()
}

fn read_card(folder: &Path) -> Result<ZooCard, FileError> {
    let path = folder.join("card.json");
    let card = serde_json::from_slice(&read(&path)?);
    card.map_err(|error| FileError::Damaged { path, why: error.to_string() })
}
