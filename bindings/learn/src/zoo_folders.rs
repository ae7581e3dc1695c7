//! Teams of the zoo where the folder of a run is expected: refused, or written as one.

use crate::description::OtherMap;
use crate::run_folders::held_run;
use crate::tensors::{FileError, create_folder, write};
use crate::zoo::{PREFIX, folder, zoo_file, zoo_teams};
use std::path::{Path, PathBuf};

/// Refuses a team of the zoo where more than its weights is needed.
///
/// # Errors
/// If it is one.
pub fn refuse_zoo_team(folder: &Path, missing: &'static str) -> Result<(), FileError> {
    match folder.to_str().is_some_and(|name| name.starts_with(PREFIX)) && !folder.is_dir() {
        true => Err(FileError::OfZoo { folder: folder.to_owned(), missing }),
        false => Ok(()),
    }
}

/// Writes the files of a team of the zoo, called by its scenario, to a folder, which must not hold a run.
///
/// # Errors
/// If there is no such team, or the folder holds a run or cannot be written.
pub fn export_zoo_team(scenario: &str, to: &Path) -> Result<(), ExportError> {
    let name = scenario.strip_prefix(PREFIX).unwrap_or(scenario);
    if !zoo_teams().any(|team| team == name) {
        return Err(FileError::NotInZoo { name: name.to_owned() }.into());
    }
    create_team_folder(to)?;
    // The description last: a folder without it is not a run.
    for file in ["best.safetensors", "card.json", "run.json"] {
        write(&to.join(file), zoo_file(&folder(name).join(file)).unwrap_or_default())?;
    }
    Ok(())
}

/// Makes a folder for a team, which must not hold a run.
pub(crate) fn create_team_folder(folder: &Path) -> Result<(), ExportError> {
    match held_run(folder)? {
        Some(folder) => Err(ExportError::HoldsRun { folder }),
        None => Ok(create_folder(folder)?),
    }
}

/// Why a team cannot be written to a folder.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum ExportError {
    #[error("`{}` already holds a run; choose another folder", folder.display())]
    HoldsRun { folder: PathBuf },
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    Map(#[from] OtherMap),
}
