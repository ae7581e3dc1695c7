//! A run in a folder:
//!
//! | file | contents |
//! | --- | --- |
//! | `run.json` | release, hyperparameters, and the scenario with its rules and limit |
//! | `weights.safetensors` | the weights of actor and critic |
//! | `checkpoint.safetensors` | what the run is resumed from |
//! | `log.csv`, `events.out.tfevents.*` | one row or event per update |
//!
//! While a process writes to it, it has the lock (`flock`) of the folder. The system releases it at the end
//! of the process.

use crate::checkpoint::{Checkpoint, write_weights};
use crate::config::Config;
use crate::lanes::{Lanes, sizes_with_history};
use crate::log::{CsvLog, TensorBoardLog};
use crate::tensors::{FileError, read, write};
use crate::training::{Record, TrainError, Training};
use serde::{Deserialize, Serialize};
use smaclite_engine::{BattleSetup, Sizes};
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// How often a checkpoint is written, besides at the end.
const CHECKPOINT_INTERVAL: Duration = Duration::from_secs(60);

/// The contents of `run.json`.
#[derive(Serialize, Deserialize)]
struct RunFile {
    version: String,
    config: Config,
    #[serde(flatten)]
    setup: BattleSetup,
}

/// What `run.json` says.
#[derive(Clone, Debug)]
pub struct RunDescription {
    /// The hyperparameters.
    pub config: Config,
    /// What the team plays.
    pub setup: BattleSetup,
    /// The scenario's name.
    pub name: String,
    /// The sizes of its environments; `obs_size` includes the last actions.
    pub sizes: Sizes,
}

impl RunDescription {
    /// Reads the description of the run in a folder.
    ///
    /// # Errors
    /// If it cannot be read or is not valid.
    pub fn read(folder: &Path) -> Result<RunDescription, FileError> {
        let path = folder.join("run.json");
        let damaged = |why: &dyn std::fmt::Display| {
            let (path, why) = (path.clone(), why.to_string());
            FileError::Damaged { path, why }
        };
        if !path.exists() {
            return Err(FileError::NoRun { folder: folder.to_owned() });
        }
        let file: RunFile = serde_json::from_slice(&read(&path)?).map_err(|error| damaged(&error))?;
        file.config.check().map_err(|error| damaged(&error))?;
        let (scenario, arena) = file.setup.arena().map_err(|error| damaged(&error))?;
        let sizes = sizes_with_history(arena.sizes(), file.config.last_actions);
        Ok(RunDescription { config: file.config, name: scenario.name, sizes, setup: file.setup })
    }
}

/// A run that writes its logs and checkpoints to its folder.
///
/// This is `smaclite-pool train` as a library: PPO on processors, with a policy that all agents share. For
/// another algorithm, network or a GPU, write a learner in Python (`smaclite_pool.examples.ppo` is one), or
/// on `smaclite_ipc::Client`.
///
/// # Example
///
/// ```
/// use smaclite_engine::Rules;
/// use smaclite_ipc::RuntimeDir;
/// use smaclite_learn::{Config, Lanes, Run, resolve_scenario};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let folder = tempfile::tempdir()?;
/// # let runtime_dir = RuntimeDir::at(folder.path().join("pools"))?;
/// # let path = folder.path().join("run");
/// let scenario = resolve_scenario("3m", Rules::Smaclite)?;
/// let small = Config { num_envs: 4, horizon: 8, minibatches: 2, hidden: vec![8], ..Config::default() };
/// let config = Config { steps: 64, ..small };
/// let lanes = Lanes::start(&scenario, config.num_envs, config.last_actions, 1, &runtime_dir)?;
/// let mut run = Run::begin(&path, config, &scenario, lanes, 1)?;
/// while let Some(record) = run.update(&mut || false)? {
///     println!("{} steps, {:.0} % won", record.steps, 100.0 * record.win_rate);
/// }
/// run.checkpoint()?;
/// assert!(path.join("weights.safetensors").exists());
/// # Ok(())
/// # }
/// ```
///
/// # At the edges
///
/// - A folder holds one run, and one process writes to it: [`begin`](Run::begin) in a folder with a run and
///   [`resume`](Run::resume) of a run that another process writes to are errors.
/// - A resumed run has the same bits as one that was not interrupted, since its last checkpoint. Dropping a
///   run writes nothing; call [`checkpoint`](Run::checkpoint) before.
/// - Training that diverges is an error of [`update`](Run::update).
pub struct Run {
    folder: PathBuf,
    training: Training,
    csv: CsvLog,
    tensorboard: TensorBoardLog,
    last_checkpoint: Instant,
    _lock: File,
}

impl Run {
    /// Begins a run in a folder, which is created and must not hold a run. `threads` threads learn; they do
    /// not change a result.
    ///
    /// # Errors
    /// If the folder holds a run or cannot be written, if another process begins one in it, or the
    /// configuration is not valid for the lanes.
    pub fn begin(
        folder: &Path,
        config: Config,
        setup: &BattleSetup,
        lanes: Lanes,
        threads: usize,
    ) -> Result<Run, TrainError> {
        let check_free = || {
            let is_taken = folder.join("run.json").exists();
            if is_taken { Err(TrainError::FolderInUse(folder.display().to_string())) } else { Ok(()) }
        };
        check_free()?;
        let training = Training::new(config, lanes, threads)?;
        fs::create_dir_all(folder).map_err(|source| FileError::Write { path: folder.to_owned(), source })?;
        let lock = lock(folder)?;
        check_free()?; // another process may have begun and ended one meanwhile
        let mut run = Run::open(folder, training, lock)?;
        run.checkpoint()?; // so that a run that is killed in its first minute can be resumed
        // Last: a folder with this file is a run that can be resumed, and one without can be begun.
        write_description(folder, run.config(), setup)?;
        Ok(run)
    }

    /// Continues the run in a folder, with the same bits as if it had not ended. `steps` replaces the number
    /// of steps after which it is complete.
    ///
    /// # Errors
    /// If its files are damaged or do not fit the lanes, or another process writes to the folder.
    pub fn resume(
        folder: &Path,
        steps: Option<u64>,
        lanes: Lanes,
        threads: usize,
    ) -> Result<Run, TrainError> {
        let lock = lock(folder)?;
        let RunDescription { mut config, setup, .. } = RunDescription::read(folder)?;
        config.steps = steps.unwrap_or(config.steps);
        let lanes = lanes.for_run(&config)?;
        let state = Checkpoint::read(&folder.join("checkpoint.safetensors"), &config, lanes.sizes())?;
        let training = Training::resume(config, lanes, threads, state)?;
        write_description(folder, &training.config, &setup)?;
        Run::open(folder, training, lock)
    }

    fn open(folder: &Path, training: Training, lock: File) -> Result<Run, TrainError> {
        let progress = training.state().progress;
        let csv = CsvLog::open(&folder.join("log.csv"), progress.updates)?;
        let tensorboard = TensorBoardLog::begin(folder, progress.steps)?;
        let last_checkpoint = Instant::now();
        Ok(Run { folder: folder.to_owned(), training, csv, tensorboard, last_checkpoint, _lock: lock })
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

/// Locks the folder until the file is dropped.
fn lock(folder: &Path) -> Result<File, TrainError> {
    let file = File::open(folder).map_err(|source| FileError::Read { path: folder.to_owned(), source })?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(TrainError::FolderLocked(folder.display().to_string())),
        Err(TryLockError::Error(source)) => Err(FileError::Write { path: folder.to_owned(), source }.into()),
    }
}

fn write_description(folder: &Path, config: &Config, setup: &BattleSetup) -> Result<(), FileError> {
    let version = env!("CARGO_PKG_VERSION").to_owned();
    let file = RunFile { version, config: config.clone(), setup: setup.clone() };
    let path = folder.join("run.json");
    let text = serde_json::to_vec_pretty(&file)
        .map_err(|error| FileError::Write { path: path.clone(), source: error.into() })?;
    write(&path, &text)
}
