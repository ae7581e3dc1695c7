//! Evaluations of a run while it trains, at step counts that are the same for every seed, and of its best
//! weights at the end. They are played in battles that threads step here, with seeds of their own, so they
//! change no bit of the training.
//!
//! | file | contents |
//! | --- | --- |
//! | `play` | playing the episodes |
//! | `row` | the result of one evaluation, and what is best |
//! | `files` | the files in the folder of a run |
//! | `final_result` | `final.json` |
//!
//! The evaluation at `k` times `evaluate_every` steps is that of the weights after the first update that
//! reaches so many steps. It is played when the next update is asked for, so a run that ends in between
//! plays it when it is resumed.

mod files;
mod final_result;
mod play;
mod row;

use crate::checkpoint::Checkpoint;
use crate::cpu_timer::CpuTimer;
use crate::description::{BEST, RunDescription};
use crate::parallel::Interrupted;
use crate::policy::Choice;
use crate::team::Network;
use crate::tensors::{FileError, read, remove, write};
use crate::training::TrainError;
use crate::weights::read_actor;
pub(crate) use files::EVALUATION_WEIGHTS;
pub use files::{BothEpisodes, EvaluationFiles, on_map};
pub use final_result::FinalResult;
pub use play::{Evaluator, Occasion};
pub use row::{EvaluationRow, Summary};
use smaclite_ipc::ClientError;
use std::path::{Path, PathBuf};

/// Episodes with greedy actions, and as many with sampled ones, of an evaluation while a run trains, on each
/// of its maps.
pub const EVALUATION_EPISODES: usize = 32;

/// The same for the best weights, at the end.
pub const FINAL_EPISODES: usize = 320;

/// The evaluations of a run that trains.
pub(crate) struct Evaluations {
    folder: PathBuf,
    run: RunDescription,
    every: u64,
    evaluator: Evaluator,
    files: EvaluationFiles,
    rows: Vec<EvaluationRow>,
}

/// How far the run is that is evaluated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Trained {
    /// The steps that it has made.
    pub steps: u64,
    /// Those before its last update; `None` if it has made none. Only evaluations after these can be due.
    pub before_last_update: Option<u64>,
}

impl Evaluations {
    /// The evaluations of the run in the folder; `None` if it makes none.
    pub fn open(
        folder: &Path,
        run: &RunDescription,
        trained: Trained,
        threads: usize,
    ) -> Result<Option<Evaluations>, TrainError> {
        let Some(every) = run.config.evaluate_every else { return Ok(None) };
        let evaluator = Evaluator::open(folder, run, threads)?;
        let (files, rows) =
            EvaluationFiles::open(folder, (run.map_count(), every, run.config.steps), trained)?;
        let (folder, run) = (folder.to_owned(), run.clone());
        let evaluations = Evaluations { folder, run, every, evaluator, files, rows };
        evaluations.restore_best()?;
        // Those of a killed process can be of an end after the checkpoint.
        if FinalResult::read(&evaluations.folder)?.is_some_and(|result| result.run_steps != trained.steps) {
            remove(&FinalResult::path(&evaluations.folder))?;
        }
        Ok(Some(evaluations))
    }

    /// The results so far.
    pub fn rows(&self) -> &[EvaluationRow] {
        &self.rows
    }

    /// Plays what is due after so many steps of training.
    pub fn play_due(
        &mut self,
        state: &Checkpoint,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<(), TrainError> {
        while let Some(steps) = self.due(state.progress.steps) {
            self.play(steps, state, interrupted)?;
        }
        Ok(())
    }

    /// The step count whose evaluation is due, if one is: a multiple of `every`, or the end of the run.
    fn due(&self, trained_steps: u64) -> Option<u64> {
        let total = self.run.config.steps;
        let steps = match self.rows.last() {
            None => 0,
            Some(last) if last.steps >= total => return None,
            Some(last) => self.after(last.steps),
        };
        (steps <= trained_steps).then_some(steps)
    }

    /// The next step count, after one.
    fn after(&self, steps: u64) -> u64 {
        let next = (steps / self.every + 1) * self.every;
        next.min(self.run.config.steps)
    }

    fn play(
        &mut self,
        steps: u64,
        state: &Checkpoint,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<(), TrainError> {
        let _timer = CpuTimer::start(); // so that other runs of the process do not count this time
        // The final episodes are those of the best of all evaluations. Not before: until then a complete run
        // that was resumed with more steps can be set back.
        remove(&FinalResult::path(&self.folder))?;
        self.files.write_weights(steps, &state.team)?;
        let (occasion, progress) = (Occasion::Training { steps }, state.progress);
        let played = self.both(&state.team.actor, occasion, EVALUATION_EPISODES, interrupted)?;
        let [greedy, sampled] = played.each_ref().map(|episodes| Summary::of(episodes));
        let row = EvaluationRow {
            steps,
            trained_steps: progress.steps,
            updates: progress.updates,
            greedy,
            sampled,
            seconds: progress.seconds,
            cpu_seconds: progress.cpu_seconds,
        };
        self.files.append(&row, &played)?;
        self.rows.push(row);
        if EvaluationRow::best(&self.rows).is_some_and(|best| best.steps == steps) {
            write(&self.folder.join(BEST), &read(&self.files.weights(steps))?)?;
        }
        Ok(())
    }

    /// Plays the final episodes of a complete run with the best weights, unless that was done.
    pub fn finish(
        &mut self,
        state: &Checkpoint,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<(), TrainError> {
        let path = FinalResult::path(&self.folder);
        let (false, Some(best)) = (path.exists(), EvaluationRow::best(&self.rows)) else { return Ok(()) };
        let _timer = CpuTimer::start();
        let actor = read_actor(&self.folder.join(BEST), state.team.actor.architecture.clone())?;
        let best = *best;
        let played = self.both(&actor, Occasion::Final, FINAL_EPISODES, interrupted)?;
        Ok(FinalResult::new(&best, state.progress, played).write(&path)?)
    }

    /// Plays so many episodes with either kind of actions.
    fn both(
        &mut self,
        actor: &Network,
        occasion: Occasion,
        episodes: usize,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<BothEpisodes, TrainError> {
        let play = |actions| self.evaluator.play(actor, occasion, actions, episodes, interrupted);
        let [greedy, sampled] = Choice::BOTH.map(play);
        let stop = |Interrupted| TrainError::Client(ClientError::Interrupted);
        Ok([greedy.map_err(stop)?, sampled.map_err(stop)?])
    }

    /// A run that was killed may have best weights of an evaluation after its checkpoint, which is not
    /// played again in the same way if the run is resumed with another number of steps.
    fn restore_best(&self) -> Result<(), FileError> {
        let path = self.folder.join(BEST);
        let Some(best) = EvaluationRow::best(&self.rows) else { return remove(&path) };
        let kept = self.files.weights(best.steps);
        let actor = self.run.read_actor(&kept)?;
        // One that is missing or damaged is written anew.
        if self.run.read_actor(&path).ok() != Some(actor) {
            write(&path, &read(&kept)?)?;
        }
        Ok(())
    }
}
