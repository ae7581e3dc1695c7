//! Folders that hold a run, or several of `train --seeds`.

use crate::description::{DESCRIPTIONS, RunDescription, holds_run, refuse_undescribed};
use crate::tensors::{FileError, entries};
use std::fs::DirEntry;
use std::path::{Path, PathBuf};

/// The folder of the run with this seed, in the folder of runs that differ in their seeds.
pub fn seed_folder(folder: &Path, seed: u64) -> PathBuf {
    folder.join(format!("seed-{seed}"))
}

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
    let seed = |entry: &DirEntry| entry.file_name().to_str()?.strip_prefix("seed-")?.parse::<u64>().ok();
    let entries = entries(folder)?.into_iter();
    let mut seeds: Vec<_> = entries.filter_map(|entry| Some((seed(&entry)?, entry.path()))).collect();
    seeds.sort();
    for (_, path) in seeds {
        if holds_run(&path)? {
            return Ok(Some(path));
        }
    }
    Ok(None)
}
