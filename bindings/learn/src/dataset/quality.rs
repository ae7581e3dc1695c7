//! Which weights of a training run are good, medium and poor: by its evaluations at equal intervals, of which
//! the folder has the table `evaluations.csv` and the weights `evaluations/STEPS.safetensors`.

use super::Policy;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

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

impl Quality {
    /// All of them.
    pub const ALL: [Quality; 4] = [Quality::Good, Quality::Medium, Quality::Poor, Quality::Replay];

    /// Its name in commands.
    pub const fn name(self) -> &'static str {
        match self {
            Quality::Good => "good",
            Quality::Medium => "medium",
            Quality::Poor => "poor",
            Quality::Replay => "replay",
        }
    }
}

/// A name that no quality has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("unknown quality `{0}`; they are {names}", names = Quality::ALL.map(Quality::name).join(", "))]
pub struct UnknownQuality(String);

impl FromStr for Quality {
    type Err = UnknownQuality;

    fn from_str(name: &str) -> Result<Quality, UnknownQuality> {
        let found = Quality::ALL.into_iter().find(|quality| quality.name() == name);
        found.ok_or_else(|| UnknownQuality(name.to_owned()))
    }
}

impl fmt::Display for Quality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Why a run has no policy of a quality.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum QualityError {
    #[error(
        "{folder}: the run has no evaluations.csv, so its qualities are unknown; leave --quality out to \
         record its last weights, or train with --evaluate-every for weights of several qualities"
    )]
    NoEvaluations { folder: String },
    #[error("{file}, line {line}: {reason}")]
    Table { file: String, line: usize, reason: String },
    #[error("{file}: cannot be read: {error}")]
    Read { file: String, error: std::io::Error },
    #[error("{folder}: no evaluation won a battle, so no weights are good; train for longer")]
    NoWins { folder: String },
    #[error(
        "{folder}: no evaluation before the {above} one has a lower win rate, so there is no {quality} one; \
         evaluate more often in training"
    )]
    NoneBefore { folder: String, quality: Quality, above: Quality },
}

/// A row of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Evaluation {
    steps: u64,
    win_rate: f64,
}

/// The policies of a quality, and the files of their weights.
pub(super) fn policies(folder: &Path, quality: Quality) -> Result<Vec<(Policy, PathBuf)>, QualityError> {
    let evaluations = read(folder)?;
    let chosen = choose(&evaluations, quality, &folder.display().to_string())?;
    let policy = |evaluation: Evaluation| {
        let name = format!("evaluations/{:012}.safetensors", evaluation.steps);
        let path = folder.join(&name);
        let (training_steps, sampled_win_rate) = (Some(evaluation.steps), Some(evaluation.win_rate));
        (Policy { name, training_steps, sampled_win_rate }, path)
    };
    Ok(chosen.into_iter().map(policy).collect())
}

fn choose(
    evaluations: &[Evaluation],
    quality: Quality,
    folder: &str,
) -> Result<Vec<Evaluation>, QualityError> {
    if quality == Quality::Replay {
        return Ok(evaluations.to_vec());
    }
    let mut good = 0;
    for (i, evaluation) in evaluations.iter().enumerate() {
        if evaluation.win_rate > evaluations[good].win_rate {
            good = i;
        }
    }
    let best = evaluations[good].win_rate;
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
fn nearest_before(evaluations: &[Evaluation], above: usize, target: f64) -> Option<usize> {
    let limit = evaluations[above].win_rate;
    let below = (0..above).rev().filter(|&i| evaluations[i].win_rate < limit);
    let distance = |i: usize| (evaluations[i].win_rate - target).abs();
    below.min_by(|&a, &b| distance(a).total_cmp(&distance(b)))
}

/// The table, in the order of training.
fn read(folder: &Path) -> Result<Vec<Evaluation>, QualityError> {
    let path = folder.join("evaluations.csv");
    let file = path.display().to_string();
    if !path.exists() {
        return Err(QualityError::NoEvaluations { folder: folder.display().to_string() });
    }
    let text =
        std::fs::read_to_string(&path).map_err(|error| QualityError::Read { file: file.clone(), error })?;
    let table = |line: usize, reason: String| QualityError::Table { file: file.clone(), line, reason };
    let mut lines = text.lines().enumerate();
    let head: Vec<&str> = lines.next().map_or(Vec::new(), |(_, head)| head.split(',').collect());
    let column = |name: &str| {
        let found = head.iter().position(|column| *column == name);
        found.ok_or_else(|| table(1, format!("expected a column `{name}`, got `{}`", head.join(","))))
    };
    let (steps, win_rate) = (column("steps")?, column("sampled_win_rate")?);
    let row = |(i, line): (usize, &str)| {
        let cells: Vec<&str> = line.split(',').collect();
        let cell = |column: usize| cells.get(column).copied().unwrap_or_default();
        let bad = |name: &str, expected: &str, given: &str| {
            table(i + 1, format!("`{name}` must be {expected}, got `{given}`"))
        };
        let rate = cell(win_rate).parse().ok().filter(|rate| (0.0..=1.0).contains(rate));
        Ok(Evaluation {
            steps: cell(steps).parse().map_err(|_| bad("steps", "a whole number", cell(steps)))?,
            win_rate: rate.ok_or_else(|| bad("sampled_win_rate", "between 0 and 1", cell(win_rate)))?,
        })
    };
    let mut evaluations = lines.map(row).collect::<Result<Vec<_>, QualityError>>()?;
    if evaluations.is_empty() {
        return Err(table(2, "expected at least one evaluation".to_owned()));
    }
    evaluations.sort_by_key(|evaluation| evaluation.steps);
    Ok(evaluations)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(win_rates: &[f64], quality: Quality) -> Result<u64, String> {
        let rows = (0..).zip(win_rates).map(|(steps, &win_rate)| Evaluation { steps, win_rate });
        let rows: Vec<Evaluation> = rows.collect();
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

    #[test]
    fn mistakes_in_the_table_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let of = |text: &str| {
            std::fs::write(folder.path().join("evaluations.csv"), text).unwrap();
            policies(folder.path(), Quality::Replay).map_err(|error| error.to_string())
        };
        let rows = of("steps,greedy_win_rate,sampled_win_rate\n20,1,0.75\n10,0,0.5\n").unwrap();
        let names: Vec<&str> = rows.iter().map(|(policy, _)| policy.name.as_str()).collect();
        assert_eq!(names, ["evaluations/000000000010.safetensors", "evaluations/000000000020.safetensors"]);
        for (text, expected) in [
            ("", "line 1: expected a column `steps`"),
            ("steps,win_rate\n", "line 1: expected a column `sampled_win_rate`"),
            ("steps,sampled_win_rate\n", "at least one evaluation"),
            ("steps,sampled_win_rate\n1,0.5\nx,0.5\n", "line 3: `steps` must be a whole number, got `x`"),
            (
                "steps,sampled_win_rate\n1,50\n",
                "line 2: `sampled_win_rate` must be between 0 and 1, got `50`",
            ),
        ] {
            let error = of(text).unwrap_err();
            assert!(error.contains(expected), "{error}");
        }
    }
}
