//! When the checkpoints of a run are written, so that the end of its process costs a minute of training at
//! most, and the evaluation that is played.
//!
//! Besides at its end, a run writes one as soon as the last is a minute old and an update was made since:
//! after an update, and while an evaluation is played. So evaluations that are played often cause no more of
//! them, and the training before one that takes long is not lost with it.

use crate::checkpoint::Checkpoint;
use crate::description::{RunDescription, WEIGHTS};
use crate::log::CsvLog;
use crate::training::TrainError;
use crate::weights::write_weights;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// What the run is resumed from.
pub(super) const CHECKPOINT: &str = "checkpoint.safetensors";

/// How often a checkpoint is written.
const INTERVAL: Duration = Duration::from_secs(60);

/// The checkpoints of the run in a folder.
pub(super) struct Checkpoints {
    folder: PathBuf,
    /// When the next one is due.
    pub(super) next: Instant,
    /// The updates of the last one.
    updates: u64,
}

impl Checkpoints {
    /// Of a run that begins or continues after so many updates.
    pub fn new(folder: &Path, updates: u64) -> Checkpoints {
        Checkpoints { folder: folder.to_owned(), next: Instant::now() + INTERVAL, updates }
    }

    /// Whether one is to be written.
    pub fn is_due(&self, state: &Checkpoint) -> bool {
        state.progress.updates > self.updates && Instant::now() >= self.next
    }

    /// Writes the weights and the checkpoint. An error leaves the old files.
    pub fn write(
        &mut self,
        state: &Checkpoint,
        run: &RunDescription,
        log: &CsvLog,
    ) -> Result<(), TrainError> {
        log.sync()?; // the checkpoint is not continued without the lines of its updates
        write_weights(&self.folder.join(WEIGHTS), &state.team)?;
        state.write(&self.folder.join(CHECKPOINT), run)?;
        (self.updates, self.next) = (state.progress.updates, Instant::now() + INTERVAL);
        Ok(())
    }
}
