//! `final.json`: how the best weights of a complete run play (its *absolute metric*).

use super::{EvaluationRow, Summary};
use crate::checkpoint::Progress;
use crate::rollout::Episode;
use crate::tensors::{FileError, read, write};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The result, and every episode of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FinalResult {
    /// The step count of the evaluation with the best weights.
    pub steps: u64,
    /// Steps of training that those weights were learnt from.
    pub trained_steps: u64,
    /// Steps of the whole run.
    pub run_steps: u64,
    /// Seconds of training of the whole run, without evaluations.
    pub seconds: f64,
    /// Processor time of the same.
    pub cpu_seconds: f64,
    /// Means of the greedy episodes.
    pub greedy: Summary,
    /// Means of the sampled ones.
    pub sampled: Summary,
    /// The episodes with the most probable actions.
    pub greedy_episodes: Vec<Episode>,
    /// The episodes with actions that are drawn.
    pub sampled_episodes: Vec<Episode>,
}

impl FinalResult {
    pub(crate) fn new(
        best: &EvaluationRow,
        progress: Progress,
        [greedy_episodes, sampled_episodes]: [Vec<Episode>; 2],
    ) -> FinalResult {
        FinalResult {
            steps: best.steps,
            trained_steps: best.trained_steps,
            run_steps: progress.steps,
            seconds: progress.seconds,
            cpu_seconds: progress.cpu_seconds,
            greedy: Summary::of(&greedy_episodes),
            sampled: Summary::of(&sampled_episodes),
            greedy_episodes,
            sampled_episodes,
        }
    }

    /// The file in the folder of a run.
    pub fn path(folder: &Path) -> PathBuf {
        folder.join("final.json")
    }

    /// Reads the result of a run; `None` if it has none.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn read(folder: &Path) -> Result<Option<FinalResult>, FileError> {
        let path = FinalResult::path(folder);
        if !path.exists() {
            return Ok(None);
        }
        let result = serde_json::from_slice(&read(&path)?);
        result.map(Some).map_err(|error| FileError::Damaged { path, why: error.to_string() })
    }

    pub(crate) fn write(&self, path: &Path) -> Result<(), FileError> {
        let text = serde_json::to_vec(self)
            .map_err(|error| FileError::Write { path: path.to_owned(), source: error.into() })?;
        write(path, &text)
    }
}
