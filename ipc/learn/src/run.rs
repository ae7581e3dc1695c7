//! A run in a folder:
//!
//! | file | contents |
//! | --- | --- |
//! | `run.json` | release, hyperparameters, and the scenario with its rules and limit |
//! | `weights.safetensors` | the weights of actor and critic |
//! | `checkpoint.safetensors` | what the run is resumed from |
//! | `log.csv`, `events.out.tfevents.*` | one row or event per update |

use crate::checkpoint::{Checkpoint, write_weights};
use crate::config::Config;
use crate::lanes::Lanes;
use crate::log::{CsvLog, TensorBoardLog};
use crate::tensors::{FileError, read, write};
use crate::training::{Record, TrainError, Training};
use serde::{Deserialize, Serialize};
use smaclite_engine::Sizes;
use smaclite_ipc::LaneScenario;
use smaclite_scenarios::ScenarioFiles;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// How often a checkpoint is written, besides at the end.
const CHECKPOINT_INTERVAL: Duration = Duration::from_secs(60);

/// What `run.json` says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunDescription {
    /// The release that began the run.
    pub version: String,
    /// Its hyperparameters.
    pub config: Config,
    files: ScenarioFiles,
    rules: String,
    episode_limit: Option<u32>,
}

impl RunDescription {
    fn new(config: &Config, scenario: &LaneScenario) -> RunDescription {
        let LaneScenario { files, rules, episode_limit } = scenario.clone();
        let version = env!("CARGO_PKG_VERSION").to_owned();
        RunDescription { version, config: config.clone(), files, rules: rules.to_string(), episode_limit }
    }

    /// Reads the description of the run in a folder.
    ///
    /// # Errors
    /// If it cannot be read or is not valid.
    pub fn read(folder: &Path) -> Result<RunDescription, FileError> {
        let path = folder.join("run.json");
        let damaged = |why: String| FileError::Damaged { path: path.clone(), why };
        let run: RunDescription =
            serde_json::from_slice(&read(&path)?).map_err(|error| damaged(error.to_string()))?;
        run.config.check().map_err(|error| damaged(error.to_string()))?;
        run.sizes().map_err(damaged)?;
        Ok(run)
    }

    /// What the team plays.
    ///
    /// # Errors
    /// If the rules are unknown.
    pub fn scenario(&self) -> Result<LaneScenario, String> {
        let rules = self.rules.parse().map_err(|error| format!("{error}"))?;
        Ok(LaneScenario { files: self.files.clone(), rules, episode_limit: self.episode_limit })
    }

    /// The sizes of its environments.
    pub(crate) fn sizes(&self) -> Result<Sizes, String> {
        Ok(self.scenario()?.arena().map_err(|error| error.to_string())?.1.sizes())
    }
}

/// A run that writes its logs and checkpoints to its folder.
pub struct Run {
    folder: PathBuf,
    training: Training,
    csv: CsvLog,
    tensorboard: TensorBoardLog,
    last_checkpoint: Instant,
}

impl Run {
    /// Begins a run in a folder, which is created and must not hold a run. `threads` threads learn; they do
    /// not change a result.
    ///
    /// # Errors
    /// If the folder holds a run or cannot be written, or the configuration is not valid for the lanes.
    pub fn begin(
        folder: &Path,
        config: Config,
        scenario: &LaneScenario,
        lanes: Lanes,
        threads: usize,
    ) -> Result<Run, TrainError> {
        if folder.join("run.json").exists() {
            return Err(TrainError::FolderInUse(folder.display().to_string()));
        }
        let description = RunDescription::new(&config, scenario);
        let training = Training::new(config, lanes, threads)?;
        fs::create_dir_all(folder).map_err(|source| FileError::Write { path: folder.to_owned(), source })?;
        write_description(folder, &description)?;
        let mut run = Run::open(folder, training)?;
        run.checkpoint()?; // so that a run that is killed in its first minute can be resumed
        Ok(run)
    }

    /// Continues the run in a folder, with the same bits as if it had not ended. `steps` replaces the number
    /// of steps after which it is complete.
    ///
    /// # Errors
    /// If its files are damaged or do not fit the lanes.
    pub fn resume(
        folder: &Path,
        steps: Option<u64>,
        lanes: Lanes,
        threads: usize,
    ) -> Result<Run, TrainError> {
        let mut description = RunDescription::read(folder)?;
        description.config.steps = steps.unwrap_or(description.config.steps);
        let path = folder.join("checkpoint.safetensors");
        let state = Checkpoint::read(&path, &description.config, lanes.sizes())?;
        let training = Training::resume(description.config.clone(), lanes, threads, state)?;
        write_description(folder, &description)?;
        Run::open(folder, training)
    }

    fn open(folder: &Path, training: Training) -> Result<Run, TrainError> {
        let progress = training.state().progress;
        let csv = CsvLog::open(&folder.join("log.csv"), progress.updates)?;
        let tensorboard = TensorBoardLog::begin(folder, progress.steps)?;
        let last_checkpoint = Instant::now();
        Ok(Run { folder: folder.to_owned(), training, csv, tensorboard, last_checkpoint })
    }

    /// The hyperparameters.
    pub fn config(&self) -> &Config {
        &self.training.config
    }

    /// Makes one update, logs it, and writes a checkpoint if the last one is a minute old. `None` if the run
    /// is complete.
    ///
    /// # Errors
    /// If the pool fails, training diverges or a file cannot be written; `ClientError::Interrupted` if
    /// `interrupted` returned true. Then [`checkpoint`](Run::checkpoint) writes the state before the update.
    pub fn update(&mut self, interrupted: &mut dyn FnMut() -> bool) -> Result<Option<Record>, TrainError> {
        if self.training.is_complete() {
            return Ok(None);
        }
        let record = self.training.update(interrupted)?;
        self.csv.append(&record)?;
        self.tensorboard.append(&record)?;
        if self.last_checkpoint.elapsed() > CHECKPOINT_INTERVAL {
            self.checkpoint()?;
        }
        Ok(Some(record))
    }

    /// Writes the weights and the checkpoint.
    ///
    /// # Errors
    /// If they cannot be written. The old files stay complete.
    pub fn checkpoint(&mut self) -> Result<(), TrainError> {
        let state = self.training.state();
        write_weights(&self.folder.join("weights.safetensors"), &state.team)?;
        state.write(&self.folder.join("checkpoint.safetensors"))?;
        self.last_checkpoint = Instant::now();
        Ok(())
    }
}

fn write_description(folder: &Path, description: &RunDescription) -> Result<(), FileError> {
    let path = folder.join("run.json");
    let text = serde_json::to_vec_pretty(description)
        .map_err(|error| FileError::Write { path: path.clone(), source: error.into() })?;
    write(&path, &text)
}
