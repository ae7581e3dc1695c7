//! Another number of steps for a run that is resumed: whether it can have it, and what `run.json` says then.

use super::checkpoints::CHECKPOINT;
use crate::checkpoint::Progress;
use crate::description::{LOG, RunDescription};
use crate::log::KeptLines;
use crate::training::TrainError;
use std::path::Path;

/// Refuses a number of steps with which [`Run::resume_on_maps`](super::Run::resume_on_maps) would refuse the
/// run in a folder, and changes nothing.
///
/// # Errors
/// If it does, or cannot read what it compares.
pub(crate) fn check_steps(folder: &Path, run: &RunDescription, steps: u64) -> Result<(), TrainError> {
    let mut changed = run.clone();
    changed.config.steps = steps;
    let progress = Progress::read(&folder.join(CHECKPOINT))?;
    change_steps(folder, &mut changed, run.config.steps, progress)
}

/// Says in the description of a run what its number of steps was, `described`, if it has another one now. A
/// complete run has made some steps more than described, and can be resumed with that number.
pub(super) fn change_steps(
    folder: &Path,
    description: &mut RunDescription,
    described: u64,
    Progress { updates, steps: made, .. }: Progress,
) -> Result<(), TrainError> {
    let given = description.config.steps;
    if given == described || made == 0 {
        return Ok(());
    }
    let before = KeptLines::read(&folder.join(LOG), updates)?.steps_before;
    let is_end = given <= made && before.is_some_and(|before| before < given);
    match description.former_steps.iter().position(|former| *former == given) {
        // It ended so before, and has learnt nothing since.
        Some(then) if is_end => description.former_steps.truncate(then),
        _ if given < made => {
            return Err(TrainError::FewerSteps { folder: folder.display().to_string(), given, made });
        }
        _ => description.former_steps.push(described),
    }
    Ok(())
}
