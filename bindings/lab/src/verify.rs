//! Plays recorded evaluations again, with the weights that were kept, and compares every number.

use smaclite_learn::{
    BothEpisodes, Choice, EVALUATION_EPISODES, Episode, EvaluationFiles, EvaluationRow, Evaluator,
    FINAL_EPISODES, FileError, FinalResult, Network, Occasion, RunDescription, Summary, Weights,
    parallel::Interrupted, read_file,
};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// What was played again.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Verification {
    /// Evaluations while the run trained.
    pub evaluations: usize,
    /// Whether the final episodes were played again.
    pub is_final: bool,
    /// Episodes of all of them.
    pub episodes: usize,
}

/// A number that differs.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// The step count of the evaluation; `None` for the final one.
    pub steps: Option<u64>,
    /// How actions were chosen.
    pub actions: Choice,
    /// The episode; `None` if all are equal, and only a mean differs.
    pub episode: Option<usize>,
    /// What the file says.
    pub recorded: String,
    /// What was played.
    pub played: String,
}

impl std::fmt::Display for Difference {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Difference { steps, actions, episode, recorded, played } = self;
        match steps {
            Some(steps) => write!(f, "the evaluation at {steps} steps, ")?,
            None => write!(f, "the final evaluation, ")?,
        }
        match episode {
            Some(episode) => write!(f, "{actions} episode {episode}: ")?,
            None => write!(f, "{actions} means: ")?,
        }
        write!(f, "recorded {recorded}, played {played}")
    }
}

/// Why the numbers of a run are not verified.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum VerifyError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("`{folder}` has no evaluations; `train --evaluate-every N` makes them")]
    NoEvaluations { folder: String },
    #[error(
        "`{folder}` has no final episodes (final.json), as it is not complete: verify its evaluations with \
         --evaluations sample or all, or resume it until its end"
    )]
    NotComplete { folder: String },
    #[error("`{folder}` is not verified: {mismatch}")]
    Mismatch { folder: String, mismatch: Mismatch },
    #[error("interrupted")]
    Interrupted,
}

/// What does not agree in the files of a run, or with what is played.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum Mismatch {
    #[error(
        "it has no evaluation at {steps} steps, but run.json says that there is one at every multiple of \
         {every} steps and at the end, {end}"
    )]
    Missing { steps: u64, every: u64, end: u64 },
    #[error(
        "final.json is of a run of {played} steps, but run.json says that it makes {end}; resume it until \
         its end"
    )]
    OtherEnd { played: u64, end: u64 },
    #[error("{which} has {found} {actions} episodes, but {expected} are played")]
    Episodes { which: String, found: usize, actions: Choice, expected: usize },
    #[error("final.json is of {played} steps, but the best evaluation is at {best}")]
    NotTheBest { played: u64, best: u64 },
    #[error(
        "the evaluation at {steps} steps is of {found} trained steps in evaluations.csv, but of {expected} \
         in {file}"
    )]
    TrainedSteps { steps: u64, found: u64, expected: u64, file: &'static str },
    #[error("best.safetensors has other weights than the evaluation at {best} steps")]
    OtherWeights { best: u64 },
    #[error(
        "{0}\nThe last bits of a network's outputs depend on the vector instructions of the CPU, and so can \
         an episode: verify on a machine with the instructions of the one that trained. On such a machine, \
         the weights or the numbers were changed"
    )]
    Played(Box<Difference>),
}

impl From<Interrupted> for VerifyError {
    fn from(_: Interrupted) -> VerifyError {
        VerifyError::Interrupted
    }
}

/// Plays evaluations of the run in the folder again: at most `evaluations` of those while it trained, evenly
/// chosen, the last one among them; and the final one.
///
/// # Errors
/// If a number differs, or the files cannot be read.
pub fn verify(
    folder: &Path,
    evaluations: usize,
    threads: usize,
    interrupted: &mut dyn FnMut() -> bool,
) -> Result<Verification, VerifyError> {
    let mut verifier = Verifier::open(folder, threads)?;
    let mut verification = Verification::default();
    let all = recorded(folder)?;
    let result = verifier.final_result(&all)?;
    verifier.check_steps(&all, result.as_ref())?;
    verifier.check_trained_steps(&all, result.as_ref())?;
    for (row, recorded) in spread(&all, evaluations) {
        let steps = row.steps;
        let which = format!("the evaluation at {steps} steps");
        verifier.check_count(&which, recorded, EVALUATION_EPISODES)?;
        let actor = verifier.run.read_actor(&EvaluationFiles::of(folder).weights(steps))?;
        let summaries = [row.greedy, row.sampled];
        let occasion = (Some(steps), Occasion::Training { steps });
        verifier.compare(&actor, occasion, recorded, summaries, interrupted)?;
        verification.evaluations += 1;
        verification.episodes += recorded.iter().map(Vec::len).sum::<usize>();
    }
    if let Some(result) = result {
        let rows: Vec<EvaluationRow> = all.iter().map(|(row, _)| *row).collect();
        let actor = verifier.best(&result, &rows)?;
        let summaries = [result.greedy, result.sampled];
        let recorded = [result.greedy_episodes, result.sampled_episodes];
        verifier.check_count("the final evaluation", &recorded, FINAL_EPISODES)?;
        let occasion = (None, Occasion::Final);
        verifier.compare(&actor, occasion, &recorded, summaries, interrupted)?;
        verification.is_final = true;
        verification.episodes += recorded.iter().map(Vec::len).sum::<usize>();
    }
    let folder = || folder.display().to_string();
    match verification.episodes {
        0 if all.is_empty() => Err(VerifyError::NoEvaluations { folder: folder() }),
        0 => Err(VerifyError::NotComplete { folder: folder() }),
        _ => Ok(verification),
    }
}

/// The first step count without an evaluation, of a run that is evaluated at every multiple of `every` steps
/// and at its end, and that has evaluations at `steps`. A run that is not complete has them until its last
/// one. Others, as that at the end before the run was extended, may be there too.
pub(crate) fn missing(steps: &BTreeSet<u64>, every: u64, end: u64, is_complete: bool) -> Option<u64> {
    let last = steps.last().copied();
    let known = if is_complete { end } else { last.map_or(0, |last| last.min(end)) };
    let mut multiples = (0..known).step_by(usize::try_from(every).unwrap_or(usize::MAX));
    let is_missing_at_end = is_complete && last.is_none_or(|last| last < end);
    multiples.find(|count| !steps.contains(count)).or(is_missing_at_end.then_some(end))
}

/// At most `count` of them, evenly chosen, the last one among them.
fn spread<T>(all: &[T], count: usize) -> impl Iterator<Item = &T> {
    let count = count.min(all.len());
    (1..=count).map(move |i| &all[i * all.len() / count - 1])
}

/// The rows of the evaluations of a run, with their episodes.
pub(crate) fn recorded(folder: &Path) -> Result<Vec<(EvaluationRow, BothEpisodes)>, FileError> {
    let files = EvaluationFiles::of(folder);
    let mut episodes = files.episodes()?;
    let with_episodes = |row: EvaluationRow| {
        let found = episodes.iter().position(|(steps, _)| *steps == row.steps);
        let both = found.map(|i| episodes.swap_remove(i).1).unwrap_or_default();
        (row, both)
    };
    Ok(files.rows()?.into_iter().map(with_episodes).collect())
}

struct Verifier<'a> {
    folder: &'a Path,
    run: RunDescription,
    evaluator: Evaluator,
}

impl<'a> Verifier<'a> {
    fn open(folder: &'a Path, threads: usize) -> Result<Verifier<'a>, FileError> {
        let run = RunDescription::read(folder)?;
        let evaluator = Evaluator::open(folder, &run, threads)?;
        Ok(Verifier { folder, run, evaluator })
    }

    fn mismatch(&self, mismatch: Mismatch) -> VerifyError {
        VerifyError::Mismatch { folder: self.folder.display().to_string(), mismatch }
    }

    /// The final episodes, if the run has come to the end that it was to. A complete run that was resumed
    /// with more steps keeps those of the earlier end until then.
    fn final_result(
        &self,
        all: &[(EvaluationRow, BothEpisodes)],
    ) -> Result<Option<FinalResult>, VerifyError> {
        let (result, end) = (FinalResult::read(self.folder)?, self.run.config.steps);
        match result {
            Some(FinalResult { run_steps: played, .. }) if played < end => {
                let was_at_end = all.last().is_some_and(|(row, _)| row.steps >= end);
                if was_at_end { Err(self.mismatch(Mismatch::OtherEnd { played, end })) } else { Ok(None) }
            }
            result => Ok(result),
        }
    }

    /// No evaluation was left out, as far as the run has come.
    fn check_steps(
        &self,
        all: &[(EvaluationRow, BothEpisodes)],
        result: Option<&FinalResult>,
    ) -> Result<(), VerifyError> {
        let end = self.run.config.steps;
        let Some(every) = self.run.config.evaluate_every else { return Ok(()) };
        let steps = all.iter().map(|(row, _)| row.steps).collect();
        if let Some(steps) = missing(&steps, every, end, result.is_some()) {
            return Err(self.mismatch(Mismatch::Missing { steps, every, end }));
        }
        Ok(())
    }

    /// Rows have the trained steps that the log has after as many updates, and the final result has those of
    /// its row. A log can lack updates that a process which was killed had made.
    fn check_trained_steps(
        &self,
        all: &[(EvaluationRow, BothEpisodes)],
        result: Option<&FinalResult>,
    ) -> Result<(), VerifyError> {
        let log = self.folder.join("log.csv");
        let log = if log.exists() { read_file(&log)? } else { Vec::new() };
        let log = String::from_utf8_lossy(&log);
        let counts = |line: &str| {
            let mut fields = line.split(',').map_while(|field| field.parse::<u64>().ok());
            fields.next().zip(fields.next())
        };
        let logged: BTreeMap<u64, u64> = log.lines().filter_map(counts).chain([(0, 0)]).collect();
        for (row, _) in all {
            let of_log = logged.get(&row.updates).map(|steps| ("log.csv", *steps));
            let of_result = result.filter(|result| result.steps == row.steps);
            let of_result = of_result.map(|result| ("final.json", result.trained_steps));
            let (steps, found) = (row.steps, row.trained_steps);
            let other = of_log.into_iter().chain(of_result).find(|(_, expected)| *expected != found);
            if let Some((file, expected)) = other {
                return Err(self.mismatch(Mismatch::TrainedSteps { steps, found, expected, file }));
            }
        }
        Ok(())
    }

    /// The best weights, which must be those of the best evaluation: the final episodes choose no weights.
    fn best(&self, result: &FinalResult, rows: &[EvaluationRow]) -> Result<Network, VerifyError> {
        let actor = self.run.read_actor(&self.folder.join(Weights::Best.file_name()))?;
        let of_rows = EvaluationRow::best(rows).map_or(result.steps, |best| best.steps);
        let kept = self.run.read_actor(&EvaluationFiles::of(self.folder).weights(of_rows))?;
        if of_rows != result.steps {
            return Err(self.mismatch(Mismatch::NotTheBest { played: result.steps, best: of_rows }));
        }
        if actor != kept {
            return Err(self.mismatch(Mismatch::OtherWeights { best: of_rows }));
        }
        Ok(actor)
    }

    /// All episodes are there, so many on each map: none was left out.
    fn check_count(&self, which: &str, recorded: &BothEpisodes, on_each: usize) -> Result<(), VerifyError> {
        let expected = on_each * self.run.map_count();
        let wrong = Choice::BOTH.into_iter().zip(recorded).find(|(_, episodes)| episodes.len() != expected);
        let Some((actions, episodes)) = wrong else { return Ok(()) };
        let (which, found) = (which.to_owned(), episodes.len());
        Err(self.mismatch(Mismatch::Episodes { which, found, actions, expected }))
    }

    fn compare(
        &mut self,
        actor: &Network,
        (steps, occasion): (Option<u64>, Occasion),
        recorded: &BothEpisodes,
        summaries: [Summary; 2],
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<(), VerifyError> {
        for ((actions, recorded), summary) in Choice::BOTH.into_iter().zip(recorded).zip(summaries) {
            let of_map = recorded.len() / self.run.map_count();
            let played = self.evaluator.play(actor, occasion, actions, of_map, interrupted)?;
            let differs = recorded.iter().zip(&played).position(|(a, b)| !equal_bits(a, b));
            let difference = |episode, recorded: String, played: String| {
                let difference = Difference { steps, actions, episode, recorded, played };
                Err(self.mismatch(Mismatch::Played(Box::new(difference))))
            };
            if let Some(i) = differs {
                return difference(Some(i), in_words(&recorded[i]), in_words(&played[i]));
            }
            if Summary::of(&played) != summary {
                return difference(None, format!("{summary:?}"), format!("{:?}", Summary::of(&played)));
            }
        }
        Ok(())
    }
}

fn equal_bits(a: &Episode, b: &Episode) -> bool {
    let bits = |episode: &Episode| (episode.episode_return.to_bits(), episode.length, episode.won);
    bits(a) == bits(b)
}

fn in_words(episode: &Episode) -> String {
    let Episode { episode_return, length, won } = episode;
    let end = if *won { "won" } else { "not won" };
    format!("return {episode_return} (bits {:08x}), {length} steps, {end}", episode_return.to_bits())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_evaluation_that_was_left_out_is_missing() {
        let check = |steps: &[u64], end, is_complete, expected: Option<u64>| {
            let found = missing(&steps.iter().copied().collect(), 400, end, is_complete);
            assert_eq!(found, expected, "{steps:?} of {end}");
        };
        check(&[0, 400, 800, 930], 930, true, None);
        check(&[0, 800, 930], 930, true, Some(400));
        check(&[400, 800, 930], 930, true, Some(0));
        check(&[0, 400, 800], 930, true, Some(930));
        check(&[0, 400, 800], 800, true, None);
        check(&[0, 400], 800, true, Some(800));
        check(&[], 930, true, Some(0));
        // As far as a run that is not complete has come.
        check(&[0, 400], 930, false, None);
        check(&[0, 800], 930, false, Some(400));
        check(&[400], 930, false, Some(0));
        check(&[], 930, false, None);
        // Extended after its end at 930 or 800, and ended before an evaluation that it had.
        check(&[0, 400, 800, 930, 1200, 1500], 1500, true, None);
        check(&[0, 400, 800, 1200, 1500], 1500, true, None);
        check(&[0, 400, 930, 1200, 1500], 1500, true, Some(800));
        check(&[0, 400, 800], 500, true, None);
    }

    #[test]
    fn a_sample_is_spread_and_has_the_last() {
        let all: Vec<u32> = (0..10).collect();
        let check = |count, expected: &[u32]| {
            assert!(spread(&all, count).eq(expected), "{count}");
        };
        check(0, &[]);
        check(1, &[9]);
        check(3, &[2, 5, 9]);
        check(10, &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9]);
        check(11, &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9]);
    }
}
