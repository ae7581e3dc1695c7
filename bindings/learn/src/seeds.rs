//! Runs with several seeds in one process: a queue, as many at a time as there are threads. Each is an
//! ordinary run in a folder of its own, `seed-1` and so on, with the bits that it has alone.
//!
//! No file says how many runs there are: those that have begun are looked for, if they belong together.

mod error;

use crate::config::Config;
use crate::description::RunDescription;
use crate::lanes::Lanes;
use crate::parallel;
use crate::run::{Run, TrainEvent, check_free, check_steps};
use crate::run_folders::{runs_in, seed_folder};
use crate::training::TrainError;
pub use error::SeedsError;
use smaclite_engine::BattleSetup;
use smaclite_ipc::RuntimeDir;
use std::path::{Path, PathBuf};

/// Runs in the subfolders of a folder that differ in their seeds.
///
/// ```
/// use smaclite_engine::Rules;
/// use smaclite_ipc::RuntimeDir;
/// use smaclite_learn::{Config, Seeds, resolve_scenario};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let folder = tempfile::tempdir()?;
/// # let runtime_dir = RuntimeDir::at(folder.path().join("pools"))?;
/// # let path = folder.path().join("runs");
/// let scenario = resolve_scenario("3m", Rules::Smaclite)?;
/// let small = Config { num_envs: 4, horizon: 8, minibatches: 2, hidden: vec![8], ..Config::for_agents(3) };
/// let config = Config { seed: 1, steps: 64, ..small };
/// let seeds = Seeds::begin(&path, &config, 3, &[scenario], &runtime_dir, &mut || false)?;
/// let results = seeds.train(None, 2, &runtime_dir, &|| false, &|seed, event| {
///     println!("{seed}: {event:?}");
/// });
/// assert!(results.iter().all(|(_, result)| result.is_ok()));
/// assert!(path.join("seed-3/weights.safetensors").exists());
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Seeds {
    /// Seeds and folders, by seed.
    runs: Vec<(u64, PathBuf)>,
}

/// Called by the threads of the runs, with the seed.
pub type OnTrainEvent<'a> = dyn Fn(u64, TrainEvent) + Sync + 'a;

/// Checks that there are so many seeds from the first on.
///
/// # Errors
/// If there are none, or the last one would be above `u64::MAX`.
pub fn check_seeds(seed: u64, count: u64) -> Result<(), SeedsError> {
    let last = seed.checked_add(count.checked_sub(1).ok_or(SeedsError::None)?);
    last.map(|_| ()).ok_or(SeedsError::TooHigh { seed, count })
}

impl Seeds {
    /// Begins `count` runs in a folder, with the seeds from that of `config` on, on these maps. They make no
    /// update yet.
    ///
    /// # Errors
    /// If the folder has runs, and as [`Run::begin`]; the runs before the one that failed have begun, and
    /// [`complete`](Seeds::complete) begins the others: also if `interrupted`, which is asked before each run
    /// but the first, returned true.
    pub fn begin(
        folder: &Path,
        config: &Config,
        count: u64,
        setups: &[BattleSetup],
        runtime_dir: &RuntimeDir,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<Seeds, SeedsError> {
        check_seeds(config.seed, count)?;
        // Also of other seeds: with other options, these would be no runs of one algorithm.
        check_free(folder)?;
        let path = seed_folder(folder, config.seed);
        begin(&path, None, config.clone(), setups, runtime_dir)?; // else, there is nothing to continue
        Seeds { runs: vec![(config.seed, path)] }.complete(count, runtime_dir, interrupted)
    }

    /// The runs in the subfolders of a folder, which are to be trained to `steps` steps, or to as many as
    /// they were to make; `None` if there are none.
    ///
    /// # Errors
    /// If one cannot be read, they are not runs that differ in their seeds alone, or one has made more than
    /// `steps` steps: then no run is trained, as those that have made fewer could not be set back.
    pub fn open(folder: &Path, steps: Option<u64>) -> Result<Option<Seeds>, SeedsError> {
        let runs = runs_in(folder)?;
        check_together(folder, &runs)?;
        match steps {
            None => check_equal_steps(&runs)?,
            Some(steps) => check_steps_made(&runs, steps)?,
        }
        let runs: Vec<_> = runs.into_iter().map(|(path, run)| (run.config.seed, path)).collect();
        Ok(if runs.is_empty() { None } else { Some(Seeds { runs }) })
    }

    /// Begins the runs that are missing for `count` seeds, from the lowest one of these runs on: those that
    /// could not begin with the others, or more of them. They have the same configuration.
    ///
    /// # Errors
    /// If there are runs with other seeds than these; and as [`begin`](Seeds::begin).
    pub fn complete(
        mut self,
        count: u64,
        runtime_dir: &RuntimeDir,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<Seeds, SeedsError> {
        let ends = self.runs.first().cloned().zip(self.runs.last().cloned());
        let Some(((first, model), (last, _))) = ends else { return Ok(self) };
        let folder = model.parent().unwrap_or(Path::new("")).to_owned();
        if last - first >= count {
            return Err(SeedsError::TooFew { folder, first, last, count });
        }
        check_seeds(first, count)?;
        let run = RunDescription::read(&model)?;
        let setups: Vec<BattleSetup> = run.setups().cloned().collect();
        for seed in (0..count).map(|i| first + i) {
            if self.runs.iter().all(|(begun, _)| *begun != seed) {
                if interrupted() {
                    return Err(SeedsError::Interrupted { folder, begun: self.runs.len(), count });
                }
                let (path, config) = (seed_folder(&folder, seed), Config { seed, ..run.config.clone() });
                let begun = begin(&path, Some(&model), config, &setups, runtime_dir);
                let source = |source| SeedsError::NotBegun { seed, folder: folder.clone(), count, source };
                begun.map_err(Box::new).map_err(source)?;
                self.runs.push((seed, path));
            }
        }
        self.runs.sort();
        Ok(self)
    }

    /// Seeds and folders, by seed.
    pub fn runs(&self) -> &[(u64, PathBuf)] {
        &self.runs
    }

    /// Trains all runs to their ends, on `threads` threads together. They change no result. An error of one
    /// run does not end the others; one that was interrupted can be resumed, and its result is no error.
    pub fn train(
        &self,
        steps: Option<u64>,
        threads: usize,
        runtime_dir: &RuntimeDir,
        interrupted: &(dyn Fn() -> bool + Sync),
        on_event: &OnTrainEvent<'_>,
    ) -> Vec<(u64, Result<(), TrainError>)> {
        let parallel = threads.clamp(1, self.runs.len().max(1));
        let mut results: Vec<_> = self.runs.iter().map(|(seed, _)| (*seed, Ok(()))).collect();
        let jobs = self.runs.iter().zip(&mut results).enumerate();
        // A run asks itself whether to stop, and leaves its files complete.
        let _ =
            parallel::run(jobs, &mut vec![(); parallel], &mut || false, |(i, ((seed, path), one)), ()| {
                let (threads, on_event) =
                    (self.threads_of(i, parallel, threads), |event| on_event(*seed, event));
                one.1 = train_one(path, steps, threads, runtime_dir, &mut || interrupted(), &on_event);
            });
        results
    }

    /// The threads of run `i`: those of all, divided by the number of runs in its turn, so that the last runs
    /// use all cores too.
    fn threads_of(&self, i: usize, parallel: usize, threads: usize) -> usize {
        let turn = i / parallel * parallel;
        let at_once = parallel.min(self.runs.len() - turn);
        let more = usize::from(i - turn < threads % at_once);
        (threads / at_once + more).max(1)
    }
}

/// The runs in a folder differ in their seeds alone, by which their folders are called. A folder of other
/// runs is not continued as one: each of them would get the steps of all.
fn check_together(folder: &Path, runs: &[(PathBuf, RunDescription)]) -> Result<(), SeedsError> {
    for (path, run) in runs {
        let seed = run.config.seed;
        if *path != seed_folder(folder, seed) {
            return Err(SeedsError::OtherName { run: path.clone(), seed });
        }
    }
    for pair in runs.windows(2) {
        let [(first, a), (second, b)] = pair else { continue };
        let differences = b.differences(a, &["seed", "steps"]);
        if !differences.is_empty() {
            let (first, second) = (first.clone(), second.clone());
            return Err(SeedsError::Differ { first, second, differences });
        }
    }
    Ok(())
}

/// All runs are to make the same number of steps. They are not if they were to be extended, and the process
/// ended before it came to all of them.
fn check_equal_steps(runs: &[(PathBuf, RunDescription)]) -> Result<(), SeedsError> {
    let other = runs.windows(2).find(|pair| pair[0].1.config.steps != pair[1].1.config.steps);
    let Some([(first, a), (second, b)]) = other else { return Ok(()) };
    let (first, second) = (first.clone(), second.clone());
    Err(SeedsError::OtherSteps { first, second, steps: [a, b].map(|run| run.config.steps) })
}

/// No run has made more than so many steps, if it is not to be set back to them. What cannot be read is an
/// error of its run alone, when it is trained. The error is of the run that has made most of them.
fn check_steps_made(runs: &[(PathBuf, RunDescription)], steps: u64) -> Result<(), SeedsError> {
    let refused = runs.iter().filter_map(|(path, run)| match check_steps(path, run, steps) {
        Err(TrainError::FewerSteps { folder, given, made }) => Some((made, folder, given)),
        _ => None,
    });
    match refused.max() {
        Some((made, folder, given)) => Err(TrainError::FewerSteps { folder, given, made }.into()),
        None => Ok(()),
    }
}

/// Begins a run, beside another one if there is one, whose opponents it has.
fn begin(
    folder: &Path,
    beside: Option<&Path>,
    config: Config,
    setups: &[BattleSetup],
    runtime_dir: &RuntimeDir,
) -> Result<(), TrainError> {
    let lanes_setups: Vec<BattleSetup> = setups.iter().map(|setup| config.enemies.setup(setup)).collect();
    let lanes = Lanes::start_maps(&lanes_setups, &config, 1, runtime_dir)?;
    let maps = setups.iter().cloned().zip(lanes).collect();
    Run::begin_beside(beside, folder, config, maps, 1).map(|_| ())
}

/// Trains a run, as [`Run::train`].
fn train_one(
    path: &Path,
    steps: Option<u64>,
    threads: usize,
    runtime_dir: &RuntimeDir,
    interrupted: &mut dyn FnMut() -> bool,
    on_event: &dyn Fn(TrainEvent),
) -> Result<(), TrainError> {
    if interrupted() {
        return Ok(()); // the run is as it was
    }
    let run = RunDescription::read(path)?;
    let workers = (threads - 1).max(1);
    let lanes = Lanes::start_maps(&run.lanes_setups(), &run.config, workers, runtime_dir)?;
    Run::resume_on_maps(path, steps, lanes, threads)?.train(interrupted, on_event).map(|_| ())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_turn_uses_all_threads() {
        let check = |runs: usize, threads: usize, expected: &[usize]| {
            let seeds = Seeds { runs: (0..runs as u64).map(|seed| (seed, PathBuf::new())).collect() };
            let parallel = threads.clamp(1, runs);
            let given = (0..runs).map(|i| seeds.threads_of(i, parallel, threads));
            assert!(given.eq(expected.iter().copied()), "{runs} runs, {threads} threads");
        };
        check(3, 2, &[1, 1, 2]);
        check(10, 16, &[2, 2, 2, 2, 2, 2, 1, 1, 1, 1]);
        check(4, 1, &[1, 1, 1, 1]);
        check(5, 3, &[1, 1, 1, 2, 1]);
    }
}
