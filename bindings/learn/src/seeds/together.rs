//! Whether the runs in a folder are those of one `train --seeds`.

use super::SeedsError;
use crate::description::RunDescription;
use crate::run_folders::seed_folder;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// The runs in a folder differ in their seeds alone, by which their folders are called. A folder of other
/// runs is not continued as one: each of them would get the steps of all.
pub(super) fn check(folder: &Path, runs: &[(PathBuf, RunDescription)]) -> Result<(), SeedsError> {
    for (path, run) in runs {
        let seed = run.config.seed;
        if *path != seed_folder(folder, seed) {
            return Err(SeedsError::OtherName { run: path.clone(), seed });
        }
    }
    for pair in runs.windows(2) {
        let [(first, a), (second, b)] = pair else { continue };
        if let Some(what) = difference(a, b) {
            let (first, second) = (first.clone(), second.clone());
            return Err(SeedsError::Differ { first, second, what });
        }
    }
    Ok(())
}

/// All runs are to make the same number of steps. They are not if they were to be extended, and the process
/// ended before it came to all of them.
pub(super) fn check_steps(runs: &[(PathBuf, RunDescription)]) -> Result<(), SeedsError> {
    let other = runs.windows(2).find(|pair| pair[0].1.config.steps != pair[1].1.config.steps);
    let Some([(first, a), (second, b)]) = other else { return Ok(()) };
    let (first, second) = (first.clone(), second.clone());
    Err(SeedsError::OtherSteps { first, second, steps: [a, b].map(|run| run.config.steps) })
}

/// What two runs differ in, besides their seeds and steps.
fn difference(a: &RunDescription, b: &RunDescription) -> Option<String> {
    let (of_a, of_b) = (&a.setup, &b.setup);
    let same_files = of_a.files.text == of_b.files.text && of_a.files.unit_files == of_b.files.unit_files;
    let parts = [
        ("the scenario", same_files), // where its file was is no difference
        ("the rules", of_a.rules == of_b.rules),
        ("the episode limit", of_a.episode_limit == of_b.episode_limit),
        ("the opponents", of_a.opponents == of_b.opponents),
        ("the sides that are played", of_a.sides == of_b.sides),
        ("the other maps", a.other_maps == b.other_maps),
    ];
    if let Some((what, _)) = parts.into_iter().find(|(_, is_same)| !is_same) {
        return Some(what.to_owned());
    }
    let [a, b] = [a, b].map(|run| serde_json::to_value(&run.config).unwrap_or_default());
    let names = [&a, &b].into_iter().filter_map(Value::as_object).flat_map(serde_json::Map::keys);
    let mut names = names.filter(|name| !["seed", "steps"].contains(&name.as_str()));
    let name = names.find(|name| a[name.as_str()] != b[name.as_str()])?;
    Some(format!("{name} ({} and {})", a[name], b[name]))
}
