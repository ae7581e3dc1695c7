//! Which weights of a training run are good, medium and poor: by its evaluations at equal intervals, of which
//! the folder has the table `evaluations.csv` and the weights `evaluations/STEPS.safetensors`.

use super::Policy;
use smaclite_learn::{EvaluationFiles, EvaluationRow, FileError};
use std::path::{Path, PathBuf};

/// How well the policies of a dataset play.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quality {
    /// The evaluation with the highest win rate, the first of equal ones.
    Good,
    /// Of those before the good one, the one whose win rate is nearest to half of the good one's.
    Medium,
    /// Of those before the medium one with a lower win rate, the one that is nearest to an eighth of the good
    /// one's.
    Poor,
    /// All of them, in the order of training, each with the same number of steps.
    Replay,
}

smaclite_units::keywords!(
    Quality,
    "quality",
    "good" => Good,
    "medium" => Medium,
    "poor" => Poor,
    "replay" => Replay,
);

/// Why a run has no policy of a quality.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum QualityError {
    #[error(
        "{folder}: the run has no evaluations in evaluations.csv, so its qualities are unknown; leave \
         --quality out to record the weights that `evaluate` plays, or train with --evaluate-every for \
         weights of several qualities"
    )]
    NoEvaluations { folder: String },
    #[error("{folder}: no evaluation won a battle, so no weights are good; train for longer")]
    NoWins { folder: String },
    #[error(
        "{folder}: no evaluation before the {above} one has a lower win rate, so there is no {quality} one; \
         evaluate more often in training"
    )]
    NoneBefore { folder: String, quality: Quality, above: Quality },
    #[error(transparent)]
    File(#[from] FileError),
}

/// The policies of a quality on the first map of a run on so many, and the files of their weights.
pub(super) fn policies(
    folder: &Path,
    maps: usize,
    quality: Quality,
) -> Result<Vec<(Policy, PathBuf)>, QualityError> {
    let files = EvaluationFiles::of(folder);
    let evaluations = files.rows_on_first(maps)?;
    let shown = folder.display().to_string();
    if evaluations.is_empty() {
        return Err(QualityError::NoEvaluations { folder: shown });
    }
    let policy = |evaluation: EvaluationRow| {
        let path = files.weights(evaluation.steps);
        let name = name_in(folder, path.strip_prefix(folder).unwrap_or(&path));
        let (training_steps, sampled_win_rate) = (Some(evaluation.steps), Some(evaluation.sampled.win_rate));
        (Policy { name, training_steps, sampled_win_rate }, path)
    };
    Ok(choose(&evaluations, quality, &shown)?.into_iter().map(policy).collect())
}

fn choose(
    evaluations: &[EvaluationRow],
    quality: Quality,
    folder: &str,
) -> Result<Vec<EvaluationRow>, QualityError> {
    if quality == Quality::Replay {
        return Ok(evaluations.to_vec());
    }
    let mut good = 0;
    for (i, evaluation) in evaluations.iter().enumerate() {
        if evaluation.sampled.win_rate > evaluations[good].sampled.win_rate {
            good = i;
        }
    }
    let best = evaluations[good].sampled.win_rate;
    if best <= 0.0 {
        return Err(QualityError::NoWins { folder: folder.to_owned() });
    }
    let before = |above: usize, share: f64, quality, of| {
        nearest_before(evaluations, above, best * share).ok_or_else(|| QualityError::NoneBefore {
            folder: folder.to_owned(),
            quality,
            above: of,
        })
    };
    let medium = || before(good, 0.5, Quality::Medium, Quality::Good);
    let chosen = match quality {
        Quality::Good | Quality::Replay => good,
        Quality::Medium => medium()?,
        Quality::Poor => before(medium()?, 0.125, Quality::Poor, Quality::Medium)?,
    };
    Ok(vec![evaluations[chosen]])
}

/// Of the evaluations before `above` with a lower win rate, the one that is nearest to `target`, the last of
/// equally near ones: it has learnt the most.
fn nearest_before(evaluations: &[EvaluationRow], above: usize, target: f64) -> Option<usize> {
    let limit = evaluations[above].sampled.win_rate;
    let below = (0..above).rev().filter(|&i| evaluations[i].sampled.win_rate < limit);
    let distance = |i: usize| (evaluations[i].sampled.win_rate - target).abs();
    below.min_by(|&a, &b| distance(a).total_cmp(&distance(b)))
}

/// A file of a run by the name of the run's folder; where the folder is, is not of interest to others.
pub(super) fn name_in(folder: &Path, file: &Path) -> String {
    let absolute = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    Path::new(absolute.file_name().unwrap_or_default()).join(file).display().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use smaclite_learn::Summary;

    fn row(steps: u64, win_rate: f64) -> EvaluationRow {
        let (sampled, greedy) = (Summary { win_rate, ..Summary::default() }, Summary::default());
        let (seconds, cpu_seconds) = (0.5, 0.25);
        EvaluationRow { steps, trained_steps: steps, updates: 1, greedy, sampled, seconds, cpu_seconds }
    }

    fn chosen(win_rates: &[f64], quality: Quality) -> Result<u64, String> {
        let rows: Vec<EvaluationRow> = (0..).zip(win_rates).map(|(i, &rate)| row(i, rate)).collect();
        choose(&rows, quality, "run").map(|rows| rows[0].steps).map_err(|error| error.to_string())
    }

    #[test]
    fn qualities_are_chosen_by_the_win_rates_before_the_best() {
        let rates = [0.0, 0.0, 0.15, 0.3, 0.55, 0.9, 0.9, 0.4];
        for (quality, expected) in [(Quality::Good, 5), (Quality::Medium, 4), (Quality::Poor, 2)] {
            assert_eq!(chosen(&rates, quality), Ok(expected), "{quality}");
        }
        assert_eq!(chosen(&[0.0, 0.0, 0.5, 1.0], Quality::Poor), Ok(1), "the last of equally near ones");
    }

    #[test]
    fn a_run_without_such_an_evaluation_says_what_to_do() {
        for (rates, quality, expected) in [
            (&[0.9, 0.9][..], Quality::Medium, "before the good one"),
            (&[0.5, 0.9], Quality::Poor, "before the medium one"),
            (&[0.0, 0.0], Quality::Good, "train for longer"),
        ] {
            let error = chosen(rates, quality).unwrap_err();
            assert!(error.contains(expected), "{error}");
        }
    }

    /// A second reader of the table took the part of a line that a killed process had written for a row, and
    /// 0.8 of 0.84375 for its win rate.
    #[test]
    fn a_row_that_was_cut_is_no_evaluation() {
        let folder = tempfile::tempdir().unwrap();
        let run = folder.path().join("run");
        std::fs::create_dir(&run).unwrap();
        let of = |text: &str| {
            std::fs::write(run.join("evaluations.csv"), text).unwrap();
            policies(&run, 1, Quality::Replay).map_err(|error| error.to_string())
        };
        let head = EvaluationRow::COLUMNS.join(",") + "\n";
        let (first, last) = (row(10, 0.5).line(), row(20, 0.84375).line());
        let names = |text: &str| -> Vec<String> {
            of(text).unwrap().into_iter().map(|(policy, _)| policy.name).collect()
        };
        let whole = [10, 20].map(|steps| format!("run/evaluations/{steps:012}.safetensors"));
        assert_eq!(names(&format!("{head}{first}{last}")), whole);
        let cut = &last[..last.find("0.84375").unwrap() + 3];
        assert_eq!(names(&format!("{head}{first}{cut}")), whole[..1]);
        for (text, expected) in [
            (head.clone(), "the run has no evaluations"),
            (String::new(), "the run has no evaluations"),
            ("steps,win_rate\n".to_owned(), "its first line is `steps,win_rate`"),
            (format!("{head}{first}x,{last}"), "line 3 is `x,20,"),
        ] {
            let error = of(&text).unwrap_err();
            assert!(error.contains(expected), "{error}");
        }
    }
}
