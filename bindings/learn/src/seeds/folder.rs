//! The runs in a folder, and whether they are those of one `train --seeds`.

use super::{SeedsError, seed_folder};
use crate::description::{DESCRIPTIONS, RunDescription, holds_run, refuse_undescribed};
use crate::tensors::FileError;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// The runs in the subfolders of a folder, by seed.
///
/// # Errors
/// If the folder, or a description of a run in it, cannot be read; or if it has a run without one.
pub fn runs_in(folder: &Path) -> Result<Vec<(PathBuf, RunDescription)>, FileError> {
    let error = |source| FileError::Read { path: folder.to_owned(), source };
    refuse_undescribed(folder)?;
    let mut runs = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(error)? {
        let path = entry.map_err(error)?.path();
        if path.join("run.json").exists() {
            let run = RunDescription::read(&path)?;
            runs.push((path, run));
        } else {
            refuse_undescribed(&path)?;
        }
    }
    runs.sort_by(|(a, of_a), (b, of_b)| (of_a.config.seed, a).cmp(&(of_b.config.seed, b)));
    Ok(runs)
}

/// The run that a folder holds: its own, or the first of those of `train --seeds` in it. Beside either,
/// another run would hide one of them: where a folder has a `run.json`, no run is looked for in its
/// subfolders.
///
/// # Errors
/// If the folder cannot be read, or holds a run without its `run.json`.
pub fn held_run(folder: &Path) -> Result<Option<PathBuf>, FileError> {
    if holds_run(folder)? { Ok(Some(folder.to_owned())) } else { seed_in(folder) }
}

/// Refuses a folder that holds a run and others of `train --seeds`, of which one would be overlooked.
///
/// # Errors
/// If it does, or cannot be read.
pub fn refuse_both(folder: &Path) -> Result<(), FileError> {
    if !DESCRIPTIONS.iter().any(|name| folder.join(name).is_file()) {
        return Ok(());
    }
    match seed_in(folder)? {
        Some(inner) => Err(FileError::Both { folder: folder.to_owned(), inner }),
        None => Ok(()),
    }
}

/// The run in a folder that is called as those of `train --seeds` are.
fn seed_in(folder: &Path) -> Result<Option<PathBuf>, FileError> {
    if !folder.is_dir() {
        return Ok(None);
    }
    let error = |source| FileError::Read { path: folder.to_owned(), source };
    let mut seeds = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(error)? {
        let entry = entry.map_err(error)?;
        let seed =
            entry.file_name().to_str().and_then(|name| name.strip_prefix("seed-")?.parse::<u64>().ok());
        seeds.extend(seed.map(|seed| (seed, entry.path())));
    }
    seeds.sort();
    for (_, path) in seeds {
        if holds_run(&path)? {
            return Ok(Some(path));
        }
    }
    Ok(None)
}

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
