//! A run in a folder:
//!
//! | file | contents |
//! | --- | --- |
//! | `run.json` | release, hyperparameters, and the scenario with its rules and limit, or those of all maps |
//! | `weights.safetensors` | the weights of actor and critic |
//! | `checkpoint.safetensors` | what the run is resumed from |
//! | `log.csv`, `events.out.tfevents.*` | one row or event per update |
//! | `evaluations.csv`, `evaluation_episodes.csv` | one row per evaluation, and per episode of one |
//! | `evaluations/*.safetensors` | the weights of actor and critic in each evaluation |
//! | `best.safetensors` | the weights of the best one |
//! | `final.json` | how the best weights play |
//! | `opponent/` | `run.json` and weights of the team that plays the enemies, if one does |
//! | `league/*.safetensors` | in a league: the weights of the actor after some updates |
//!
//! While a process writes to it, it has the lock (`flock`) of the folder. The system releases it at the end
//! of the process. `checkpoints` says when a checkpoint is written, and `steps` which number of steps a run
//! that is resumed can have.

mod checkpoints;
mod steps;

use crate::checkpoint::Checkpoint;
use crate::config::Config;
use crate::description::{LOG, OPPONENT, RunDescription, Weights, write_description};
use crate::evaluations::{EVALUATION_WEIGHTS, EvaluationFiles, EvaluationRow, Evaluations, Trained};
use crate::lane_error::LaneError;
use crate::lanes::Lanes;
use crate::log::{CsvLog, KeptLines, TensorBoardLog};
use crate::run_folders::held_run;
use crate::team_files::TeamFiles;
use crate::tensors::{FileError, create_folder, exists, remove_incomplete};
use crate::training::{Record, TrainError, Training};
use crate::weights::{read_actor, write_actor};
use crate::zoo_folders;
use checkpoints::{CHECKPOINT, Checkpoints};
use smaclite_engine::{BattleSetup, Opponent};
use smaclite_ipc::ClientError;
use smaclite_units::file::os::to_lock;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use steps::change_steps;
pub(crate) use steps::check_steps;

/// What happens in a run that trains.
#[derive(Clone, Debug)]
pub enum TrainEvent {
    /// It begins or continues, from the last checkpoint. The record says how far it is; what it says of an
    /// update is 0.
    Began(Record),
    /// An update was made.
    Updated(Record),
    /// An evaluation was played.
    Evaluated(EvaluationRow),
    /// It has made all its steps, and its last checkpoint is written.
    Completed,
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
/// use smaclite_learn::{Config, Lanes, Run, TrainEvent, resolve_scenario};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let folder = tempfile::tempdir()?;
/// # let runtime_dir = RuntimeDir::at(folder.path().join("pools"))?;
/// # let path = folder.path().join("run");
/// let scenario = resolve_scenario("3m", Rules::Smaclite)?;
/// let small = Config { num_envs: 4, horizon: 8, minibatches: 2, hidden: vec![8], ..Config::for_agents(3) };
/// let config = Config { steps: 64, ..small };
/// let lanes = Lanes::start(&scenario, config.num_envs, config.last_actions, 1, &runtime_dir)?;
/// let mut run = Run::begin(&path, config, &scenario, lanes, 1)?;
/// let show = |event| {
///     if let TrainEvent::Updated(record) = event {
///         println!("{} steps, {:.0} % won", record.steps, 100.0 * record.win_rate);
///     }
/// };
/// assert!(run.train(&mut || false, &show)?);
/// assert!(path.join("weights.safetensors").exists());
/// # Ok(())
/// # }
/// ```
///
/// # At the edges
///
/// - A folder holds one run, and one process writes to it: [`begin`](Run::begin) in a folder with a run and
///   [`resume`](Run::resume) of a run that another process writes to are errors.
/// - A resumed run has the same bits as one that was not interrupted, since its last checkpoint, if the
///   number of its steps is unchanged: step sizes and entropy are annealed over them. Dropping a run writes
///   nothing; call [`checkpoint`](Run::checkpoint) before.
/// - Training that diverges is an error of [`update`](Run::update).
pub struct Run {
    folder: PathBuf,
    description: RunDescription,
    training: Training,
    csv: CsvLog,
    tensorboard: TensorBoardLog,
    evaluations: Option<Evaluations>,
    checkpoints: Checkpoints,
    _lock: File,
}

impl Run {
    /// Begins a run in a folder, which is created and must not hold a run. `threads` threads learn; they do
    /// not change a result. The lanes play [`Enemies::setup`](crate::Enemies::setup) of `setup`.
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
        Run::begin_on_maps(folder, config, vec![(setup.clone(), lanes)], threads)
    }

    /// The same on several maps at once, with [`NetworkKind::Universal`](crate::NetworkKind::Universal): what
    /// they play, and lanes that play it, with `config.num_envs` environments together. Each update learns
    /// from all of them.
    ///
    /// # Errors
    /// As [`begin`](Self::begin), and if there is no map, or the configuration is for one map alone.
    pub fn begin_on_maps(
        folder: &Path,
        config: Config,
        maps: Vec<(BattleSetup, Lanes)>,
        threads: usize,
    ) -> Result<Run, TrainError> {
        Run::begin_beside(None, folder, config, maps, threads)
    }

    /// The same; with `other`, beside the run in that folder, which has the same configuration but for its
    /// seed. If a team plays the enemies, it is then the one that `other` has a copy of: its own run may have
    /// gone on.
    pub(crate) fn begin_beside(
        other: Option<&Path>,
        folder: &Path,
        config: Config,
        maps: Vec<(BattleSetup, Lanes)>,
        threads: usize,
    ) -> Result<Run, TrainError> {
        config.check_maps(maps.len())?;
        if let Some(rival) = config.enemies.folder().filter(|folder| folder.to_str().is_none()) {
            return Err(TrainError::NotText(rival.to_owned())); // run.json could not name it
        }
        let rival_folder =
            config.enemies.folder().map(|own| other.map_or(own.to_owned(), |other| other.join(OPPONENT)));
        let (mut setups, lanes): (Vec<BattleSetup>, Vec<Lanes>) = maps.into_iter().unzip();
        if !config.enemies.are_scripts() {
            // Also where the scenario has an opponent of its own: figures of runs are compared.
            setups.iter_mut().for_each(|setup| setup.opponents = Opponent::AttackMove.into());
        }
        let setup = setups.remove(0);
        check_free(folder)?;
        let rival_files = rival_folder.as_deref().map(|folder| TeamFiles::read(folder, None)).transpose()?;
        let rival = rival_files.as_ref().map(|files| files.rival::<TrainError>(&setup, &lanes[0]));
        let rival = rival.transpose()?;
        let training = Training::new(config, lanes, threads, rival)?;
        create_folder(folder)?;
        let lock = lock(folder)?;
        check_free(folder)?; // another process may have begun and ended one meanwhile
        remove_incomplete_files(folder)?;
        crate::tensors::write(&folder.join(LOG), b"")?; // first: from now on this is a run that begins
        if let Some(rival) = rival_files {
            rival.write(&folder.join(OPPONENT))?;
        }
        EvaluationFiles::clear(folder)?;
        let description = RunDescription::new(training.config.clone(), setup).map_err(LaneError::from)?;
        let description = RunDescription { other_maps: setups, ..description };
        let mut run = Run::open(folder, description, training, threads, lock)?;
        run.checkpoint()?; // so that a run that is killed in its first minute can be resumed
        // Last: a folder with this file is a run that can be resumed, and one without can be begun.
        write_description(folder, &run.description)?;
        Ok(run)
    }

    /// Continues the run in a folder, with the same bits as if it had not ended. `steps` replaces the number
    /// of steps after which it is complete; with another number the bits are others, unless the run anneals
    /// neither step sizes nor entropy.
    ///
    /// # Errors
    /// If its files are damaged or do not fit the lanes, another process writes to the folder, or the run has
    /// made more than `steps` steps, unless it was complete with that number and has learnt nothing since.
    pub fn resume(
        folder: &Path,
        steps: Option<u64>,
        lanes: Lanes,
        threads: usize,
    ) -> Result<Run, TrainError> {
        Run::resume_on_maps(folder, steps, vec![lanes], threads)
    }

    /// The same with lanes of each map of the run, in their order: the run's own, and
    /// [`RunDescription::other_maps`].
    ///
    /// # Errors
    /// As [`resume`](Self::resume).
    pub fn resume_on_maps(
        folder: &Path,
        steps: Option<u64>,
        lanes: Vec<Lanes>,
        threads: usize,
    ) -> Result<Run, TrainError> {
        zoo_folders::refuse_zoo_team(folder, "checkpoint to continue from")?;
        let lock = lock(folder)?;
        remove_incomplete_files(folder)?;
        let mut description = RunDescription::read(folder)?;
        let described = description.config.steps;
        description.config.steps = steps.unwrap_or(described);
        let path = folder.join(CHECKPOINT);
        if !exists(&path) {
            let why = "folders of `adapt` and `zoo --export` have none, and no training continues from them";
            return Err(FileError::NoWeights { folder: folder.to_owned(), missing: CHECKPOINT, why }.into());
        }
        let RunDescription { config, setup, .. } = description.clone();
        let (given, expected) = (lanes.len(), description.map_count());
        if given != expected {
            return Err(LaneError::Maps { given, expected }.into());
        }
        let actor = description.actor();
        let mut given = match config.enemies.folder() {
            None => None,
            Some(_) => {
                let (folder, weights) = (folder.join(OPPONENT), Some(Weights::Last));
                Some(TeamFiles::read(&folder, weights)?.rival::<TrainError>(&setup, &lanes[0])?)
            }
        };
        let mut read_rival = |number| match number {
            0 => given.take().ok_or_else(|| {
                let why = "it has a team that the run was not given".to_owned();
                FileError::Damaged { path: path.clone(), why }
            }),
            number => read_actor(&copy_path(folder, number), actor.clone()),
        };
        let state = Checkpoint::read(&path, &description, &mut read_rival)?;
        change_steps(folder, &mut description, described, state.progress)?;
        let training = Training::resume(config, lanes, threads, state)?;
        let run = Run::open(folder, description, training, threads, lock)?;
        // Last: an error before it leaves the old number of steps.
        write_description(folder, &run.description)?;
        Ok(run)
    }

    fn open(
        folder: &Path,
        description: RunDescription,
        training: Training,
        threads: usize,
        lock: File,
    ) -> Result<Run, TrainError> {
        let progress = training.state().progress;
        let log = folder.join(LOG);
        // Both are read before one is changed: an error leaves the files of the run as they are.
        let kept = KeptLines::read(&log, progress.updates)?;
        let trained = Trained { steps: progress.steps, before_last_update: kept.steps_before };
        let evaluations = Evaluations::open(folder, &description, trained, threads)?;
        let csv = CsvLog::open(&log, &kept)?;
        let tensorboard = TensorBoardLog::new(folder, progress.steps);
        let (folder, checkpoints) = (folder.to_owned(), Checkpoints::new(folder, progress.updates));
        Ok(Run { folder, description, training, csv, tensorboard, evaluations, checkpoints, _lock: lock })
    }

    /// The hyperparameters.
    pub fn config(&self) -> &Config {
        &self.training.config
    }

    /// How far the run is. What the record says of an update is 0.
    pub fn record(&self) -> Record {
        self.training.record()
    }

    /// The evaluations so far, by step count.
    pub fn evaluations(&self) -> &[EvaluationRow] {
        self.evaluations.as_ref().map_or(&[], Evaluations::rows)
    }

    /// Makes one update, logs it, and writes a checkpoint if the last one is a minute old. `None` if the run
    /// is complete. Before, it plays the evaluations that are due, and writes such a checkpoint meanwhile.
    ///
    /// # Errors
    /// If the pool fails, training diverges or a file cannot be written; `ClientError::Interrupted` if
    /// `interrupted` returned true. Then [`checkpoint`](Run::checkpoint) writes the state before the update.
    pub fn update(&mut self, interrupted: &mut dyn FnMut() -> bool) -> Result<Option<Record>, TrainError> {
        self.evaluate(interrupted)?;
        if self.training.is_complete() {
            return Ok(None);
        }
        let record = self.training.update(interrupted)?;
        if let Some(copy) = self.training.new_copy() {
            create_folder(&self.folder.join(LEAGUE))?;
            write_actor(&copy_path(&self.folder, copy.number), &copy.actor)?;
        }
        self.csv.append(&record)?;
        self.tensorboard.append(&record)?;
        if self.checkpoints.is_due(self.training.state()) {
            self.checkpoint()?;
        }
        Ok(Some(record))
    }

    /// Trains to the end of the run, and returns `true`, or until it is interrupted; then a checkpoint is
    /// written.
    ///
    /// # Errors
    /// As [`update`](Run::update) and [`checkpoint`](Run::checkpoint). What was learnt until the pool failed
    /// is in the checkpoint.
    pub fn train(
        &mut self,
        interrupted: &mut dyn FnMut() -> bool,
        on_event: &dyn Fn(TrainEvent),
    ) -> Result<bool, TrainError> {
        on_event(TrainEvent::Began(self.record()));
        let mut evaluated = self.evaluations().len();
        let result = loop {
            let updated = self.update(interrupted);
            self.evaluations()[evaluated..].iter().for_each(|row| on_event(TrainEvent::Evaluated(*row)));
            evaluated = self.evaluations().len();
            match updated {
                Ok(Some(record)) => on_event(TrainEvent::Updated(record)),
                Ok(None) => break Ok(true),
                Err(TrainError::Client(ClientError::Interrupted)) => break Ok(false),
                Err(error @ TrainError::Client(_)) => break Err(error),
                Err(error) => return Err(error),
            }
        };
        self.checkpoint()?;
        if let Ok(true) = result {
            on_event(TrainEvent::Completed);
        }
        result
    }

    /// Plays what is due: evaluations, and the final one of a run that is complete. They can take longer than
    /// the updates between two checkpoints, so one that becomes due is written meanwhile.
    fn evaluate(&mut self, interrupted: &mut dyn FnMut() -> bool) -> Result<(), TrainError> {
        let Some(evaluations) = &mut self.evaluations else { return Ok(()) };
        let (state, before) = (self.training.state(), evaluations.rows().len());
        let (checkpoints, mut written) = (&mut self.checkpoints, Ok(()));
        let mut interrupted = || {
            if checkpoints.is_due(state) {
                written = checkpoints.write(state, &self.description, &self.csv);
            }
            written.is_err() || interrupted()
        };
        let mut played = evaluations.play_due(state, &mut interrupted);
        // Those before an interruption, too: they are not played again.
        for row in &evaluations.rows()[before..] {
            self.tensorboard.append_evaluation(row)?;
        }
        if played.is_ok() && self.training.is_complete() {
            played = evaluations.finish(state, &mut interrupted);
        }
        written.and(played)
    }

    /// Writes the weights and the checkpoint.
    ///
    /// # Errors
    /// If they cannot be written. The old files stay complete.
    pub fn checkpoint(&mut self) -> Result<(), TrainError> {
        self.checkpoints.write(self.training.state(), &self.description, &self.csv)
    }
}

/// The folder, in that of a run, of its copies.
const LEAGUE: &str = "league";

/// The file of the copy that was made after that many updates.
fn copy_path(folder: &Path, updates: u64) -> PathBuf {
    folder.join(LEAGUE).join(format!("{updates:06}.safetensors"))
}

/// Removes the files that a killed process did not complete.
fn remove_incomplete_files(folder: &Path) -> Result<(), FileError> {
    ["", OPPONENT, LEAGUE, EVALUATION_WEIGHTS]
        .iter()
        .try_for_each(|name| remove_incomplete(&folder.join(name)))
}

/// Checks that no run is in a folder, also none of several seeds.
pub(crate) fn check_free(folder: &Path) -> Result<(), TrainError> {
    match held_run(folder)? {
        None => Ok(()),
        Some(run) if run == folder => Err(TrainError::FolderInUse(folder.display().to_string())),
        Some(run) => Err(TrainError::SeedsInFolder { run, folder: folder.to_owned() }),
    }
}

/// Locks the folder until the file is dropped.
fn lock(folder: &Path) -> Result<File, TrainError> {
    let file = to_lock(folder).map_err(|source| FileError::Read { path: folder.to_owned(), source })?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(TrainError::FolderLocked(folder.display().to_string())),
        Err(TryLockError::Error(source)) => Err(FileError::Write { path: folder.to_owned(), source }.into()),
    }
}

#[cfg(test)]
mod tests;
