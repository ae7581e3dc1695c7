//! The runs of an algorithm: found in folders, sorted by task and seed, and checked to be comparable.

use super::{EvaluatedRun, ReportError};
use smaclite_learn::{FileError, refuse_both, refuse_undescribed, refuse_zoo_team};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// How deep runs are searched in a folder.
const MAX_DEPTH: usize = 4;

/// What is reported of as one algorithm: the runs in some folders, under a name.
#[derive(Clone, Debug)]
pub struct AlgorithmRuns {
    /// The name.
    pub name: String,
    /// The runs of every task, by seed.
    pub tasks: BTreeMap<String, Vec<EvaluatedRun>>,
}

impl AlgorithmRuns {
    /// Reads all runs in the folders: each is one itself, or has some in it.
    pub(super) fn read(name: &str, folders: &[PathBuf]) -> Result<AlgorithmRuns, ReportError> {
        let mut tasks: BTreeMap<String, Vec<EvaluatedRun>> = BTreeMap::new();
        for folder in folders {
            refuse_zoo_team(folder, "evaluations to report")?;
            let mut found = Vec::new();
            find(folder, MAX_DEPTH, &mut found)?;
            if found.is_empty() {
                return Err(ReportError::NoRuns(folder.clone()));
            }
            for path in found {
                for run in EvaluatedRun::read(&path)? {
                    tasks.entry(run.task.clone()).or_default().push(run);
                }
            }
        }
        for runs in tasks.values_mut() {
            runs.sort_by(|a, b| (a.seed, &a.folder).cmp(&(b.seed, &b.folder)));
            leave_out_former_ends(runs);
            runs.windows(2).try_for_each(|pair| check_comparable(name, &pair[0], &pair[1]))?;
        }
        Ok(AlgorithmRuns { name: name.to_owned(), tasks })
    }

    /// Whether the runs of a task have different options, which the name does not say.
    pub(super) fn has_mixed_settings(&self, task: &str) -> bool {
        self.tasks[task].windows(2).any(|pair| pair[0].settings != pair[1].settings)
    }
}

/// Adds the folders of runs in a folder. What is in the folder of a run belongs to it.
fn find(folder: &Path, depth: usize, found: &mut Vec<PathBuf>) -> Result<(), FileError> {
    if EvaluatedRun::is_in(folder) {
        refuse_both(folder)?;
        found.push(folder.to_owned());
        return Ok(());
    }
    refuse_undescribed(folder)?;
    if folder.is_file() {
        return Ok(()); // which has no runs
    }
    let error = |source| FileError::Read { path: folder.to_owned(), source };
    let mut inner = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(error)? {
        let path = entry.map_err(error)?.path();
        if path.is_dir() {
            inner.push(path);
        }
    }
    inner.sort();
    match depth.checked_sub(1) {
        Some(depth) => inner.iter().try_for_each(|path| find(path, depth, found)),
        None => Ok(()),
    }
}

/// Leaves out evaluations at a former end of a run that some run does not have: seeds that were added when it
/// was resumed with more steps were not evaluated there.
fn leave_out_former_ends(runs: &mut [EvaluatedRun]) {
    let steps: Vec<Vec<u64>> = runs.iter().map(|run| run.steps().collect()).collect();
    for run in runs {
        let shared = |at: u64| steps.iter().all(|steps| steps.contains(&at));
        let left_out: Vec<u64> = run.steps().filter(|at| run.ended_at(*at) && !shared(*at)).collect();
        run.evaluations.retain(|evaluation| !left_out.contains(&evaluation.row.steps));
    }
}

/// Runs of one algorithm and task differ in their seeds, and have evaluations at the same steps.
fn check_comparable(algorithm: &str, a: &EvaluatedRun, b: &EvaluatedRun) -> Result<(), ReportError> {
    let (algorithm, task) = (algorithm.to_owned(), a.task.clone());
    let (first, second) = (a.folder.clone(), b.folder.clone());
    if a.seed == b.seed {
        return Err(ReportError::Twice { algorithm, task, seed: a.seed, first, second });
    }
    if !a.steps().eq(b.steps()) {
        let steps = [a, b].map(|run| in_words(&run.steps().collect::<Vec<_>>())).join(" and ");
        return Err(ReportError::OtherSteps { algorithm, task, first, second, steps });
    }
    Ok(())
}

/// Steps as a text that is short if there are many.
fn in_words(steps: &[u64]) -> String {
    let all = |steps: &[u64]| steps.iter().map(u64::to_string).collect::<Vec<_>>().join(", ");
    match steps {
        [first @ .., last] if steps.len() > 6 => {
            format!("{}, ..., {last} ({} evaluations)", all(&first[..3]), steps.len())
        }
        few => all(few),
    }
}
