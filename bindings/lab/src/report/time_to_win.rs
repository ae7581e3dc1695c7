//! How long a team trained until it won: until the lower end of the 95 % interval of its win rate over 200
//! episodes is at least 90 %, which 189 wins are.
//!
//! The 32 episodes of an evaluation cannot say so: even 32 wins have a lower end of 89.3 %. So the weights of
//! every evaluation, from the first on, play 200 episodes, and the time is that of the first weights with
//! enough wins. Neither the evaluations of the run nor its final episodes have the seeds of these episodes;
//! greedy and sampled actions have the same. A team that has lost too many episodes plays no more of them, so
//! this costs little.
//!
//! Other learners do the same while they train, and leave the result in `time_to_win.json`, an object with
//! `greedy` and `sampled`, each a [`TimeToWin`] or null. The file is optional: without it, nobody knows when
//! the team won, which is not the same as never ([`FirstWin`]).
//!
//! Greedy teams are not all: where episodes begin equal and hardly anything is random, 200 of them are one
//! battle, which a team can win by chance. With sampled actions they differ.

use super::{EvaluatedRun, ReportError};
use crate::statistics::wilson_interval;
use serde::{Deserialize, Serialize};
use smaclite_learn::{
    Choice, Episode, EvaluationFiles, EvaluationRow, Evaluator, FileError, Occasion, parallel::Interrupted,
    read_file,
};

/// Episodes that are played with the weights of an evaluation.
pub const CRITERION_EPISODES: usize = 200;

/// What the lower end of the interval of the win rate must reach.
pub const CRITERION_WIN_RATE: f64 = 0.9;

/// Episodes that are played before the losses are counted.
const BLOCK: usize = 40;

/// When a team first won.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TimeToWin {
    /// The step count of the evaluation with its weights.
    pub steps: u64,
    /// Wins among the episodes.
    pub wins: usize,
    /// Episodes that were played.
    pub episodes: usize,
    /// Seconds of training until then, without evaluations.
    pub seconds: f64,
    /// Processor time of the same.
    pub cpu_seconds: f64,
}

/// Whether a team won while it trained, and when for the first time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FirstWin {
    /// Nobody knows: another learner trained the team, whose weights cannot be played here, and left no
    /// `time_to_win.json`.
    NotMeasured,
    /// Not in its run.
    Never,
    /// It did.
    At(TimeToWin),
}

impl FirstWin {
    /// When it won, if it did.
    pub fn time(&self) -> Option<&TimeToWin> {
        match self {
            FirstWin::At(time) => Some(time),
            FirstWin::NotMeasured | FirstWin::Never => None,
        }
    }

    /// Whether it is known.
    pub fn is_measured(&self) -> bool {
        *self != FirstWin::NotMeasured
    }
}

/// When the team of a run first won with such actions.
///
/// # Errors
/// If its files cannot be read or are damaged.
pub fn time_to_win(
    run: &EvaluatedRun,
    actions: Choice,
    threads: usize,
    interrupted: &mut dyn FnMut() -> bool,
) -> Result<FirstWin, ReportError> {
    let Some(description) = &run.description else { return Ok(recorded(run, actions)?) };
    let evaluator = Evaluator::open(&run.folder, description, threads);
    let mut evaluator = evaluator.map_err(ReportError::NoTime)?;
    for evaluation in &run.evaluations {
        let EvaluationRow { steps, seconds, cpu_seconds, .. } = evaluation.row;
        let weights = EvaluationFiles::of(&run.folder).weights(steps);
        let actor = description.read_actor(&weights).map_err(ReportError::NoTime)?;
        let mut play = |block: u64| {
            let occasion = Occasion::TimeToWin { steps, block };
            evaluator.play(&actor, occasion, actions, BLOCK, interrupted)
        };
        if let Some(wins) = enough_wins(&mut play)? {
            let episodes = CRITERION_EPISODES;
            return Ok(FirstWin::At(TimeToWin { steps, wins, episodes, seconds, cpu_seconds }));
        }
    }
    Ok(FirstWin::Never)
}

/// The wins among the episodes, played in blocks of [`BLOCK`], if they are enough.
fn enough_wins(
    play: &mut dyn FnMut(u64) -> Result<Vec<Episode>, Interrupted>,
) -> Result<Option<usize>, Interrupted> {
    let (mut wins, mut left) = (0, CRITERION_EPISODES);
    for block in 0.. {
        let played = play(block)?;
        wins += played.iter().filter(|episode| episode.won).count();
        left -= played.len().min(left);
        if !is_enough(wins + left, CRITERION_EPISODES) {
            return Ok(None);
        }
        if left == 0 {
            break;
        }
    }
    Ok(Some(wins))
}

fn is_enough(wins: usize, episodes: usize) -> bool {
    wilson_interval(wins, episodes)[0] >= CRITERION_WIN_RATE
}

/// What another learner left.
fn recorded(run: &EvaluatedRun, actions: Choice) -> Result<FirstWin, FileError> {
    let path = run.folder.join("time_to_win.json");
    if !path.exists() {
        return Ok(FirstWin::NotMeasured);
    }
    let damaged = |why: String| FileError::Damaged { path: path.clone(), why };
    let read = serde_json::from_slice(&read_file(&path)?);
    let Recorded { greedy, sampled } = read.map_err(|error| damaged(error.to_string()))?;
    let time = match actions {
        Choice::Greedy => greedy,
        Choice::Sampled => sampled,
    };
    match time {
        Some(TimeToWin { wins, episodes, .. }) if wins > episodes => {
            Err(damaged(format!("{wins} wins are more than there are episodes, {episodes}")))
        }
        Some(TimeToWin { wins, episodes, .. }) if !is_enough(wins, episodes) => Err(damaged(format!(
            "{wins} wins of {episodes} episodes are too few: the lower end of the 95 % interval (Wilson) \
             must be at least {CRITERION_WIN_RATE}, as that of 189 wins of 200 is"
        ))),
        Some(time) => Ok(FirstWin::At(time)),
        None => Ok(FirstWin::Never),
    }
}

/// Both keys must be there: without one, nothing says that the team never won.
#[derive(Deserialize)]
struct Recorded {
    #[serde(deserialize_with = "Option::deserialize")]
    greedy: Option<TimeToWin>,
    #[serde(deserialize_with = "Option::deserialize")]
    sampled: Option<TimeToWin>,
}

/// Median and worst of the runs of which it is known when the team first won; `None` where it never did, and
/// if there are no such runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// The median; of an even number of runs, the mean of the middle two.
    pub median: Option<f64>,
    /// The largest.
    pub worst: Option<f64>,
}

impl Spread {
    /// Of some runs. One that never won is worse than all others; one that was not measured is left out.
    pub fn of(wins: &[FirstWin], value: impl Fn(&TimeToWin) -> f64) -> Spread {
        let value = |win: &FirstWin| win.time().map_or(f64::INFINITY, &value);
        let mut values: Vec<f64> = wins.iter().filter(|win| win.is_measured()).map(value).collect();
        values.sort_unstable_by(f64::total_cmp);
        let known = |value: f64| value.is_finite().then_some(value);
        let middle = |i: usize| values.get(i).copied().unwrap_or(f64::INFINITY);
        let n = values.len();
        let median = (middle(n.saturating_sub(1) / 2) + middle(n / 2)) / 2.0;
        Spread { median: known(median), worst: values.last().copied().and_then(known) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eleven_of_200_episodes_may_be_lost() {
        assert_eq!([189, 188].map(|wins| is_enough(wins, CRITERION_EPISODES)), [true, false]);
        assert!(!is_enough(32, 32), "an evaluation alone cannot tell");
        assert_eq!(CRITERION_EPISODES % BLOCK, 0);
    }

    /// As many blocks are played as are needed to see that the wins are too few.
    #[test]
    fn a_team_that_loses_plays_few_episodes() {
        let check = |lost_in_block: &[usize], expected: Option<usize>, expected_blocks: u64| {
            let mut blocks = 0;
            let mut play = |block: u64| {
                blocks = block + 1;
                let won = |i| i >= lost_in_block[block as usize];
                Ok((0..BLOCK).map(|i| Episode { episode_return: 0.0, length: 1, won: won(i) }).collect())
            };
            assert_eq!(enough_wins(&mut play), Ok(expected));
            assert_eq!(blocks, expected_blocks, "{lost_in_block:?}");
        };
        check(&[40], None, 1);
        check(&[12], None, 1);
        check(&[11, 0, 1], None, 3);
        check(&[0; 5], Some(200), 5);
        check(&[3, 2, 2, 2, 2], Some(189), 5);
        check(&[3, 2, 2, 2, 3], None, 5);
    }

    #[test]
    fn who_never_won_is_worst() {
        let at = |seconds| {
            FirstWin::At(TimeToWin {
                steps: 1,
                wins: 200,
                episodes: 200,
                seconds,
                cpu_seconds: 2.0 * seconds,
            })
        };
        let check = |wins: &[FirstWin], median, worst| {
            assert_eq!(Spread::of(wins, |time| time.seconds), Spread { median, worst }, "{wins:?}");
        };
        check(&[at(3.0), at(1.0), at(2.0)], Some(2.0), Some(3.0));
        check(&[at(3.0), FirstWin::Never, at(1.0), at(2.0)], Some(2.5), None);
        check(&[at(3.0), FirstWin::Never], None, None);
        check(&[FirstWin::Never], None, None);
        check(&[], None, None);
        check(&[at(3.0), FirstWin::NotMeasured, at(1.0)], Some(2.0), Some(3.0));
        check(&[FirstWin::NotMeasured, FirstWin::Never], None, None);
        check(&[FirstWin::NotMeasured], None, None);
        assert_eq!(Spread::of(&[at(3.0)], |time| time.cpu_seconds).worst, Some(6.0));
    }
}
