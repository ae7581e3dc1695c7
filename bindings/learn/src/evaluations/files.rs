//! The files of evaluations in the folder of a run: `evaluations.csv` has a row per evaluation,
//! `evaluation_episodes.csv` a row per episode, and `evaluations/` the weights.
//!
//! The row of an evaluation is written last. So what a process that was killed left of an evaluation without
//! its row is removed, and that evaluation is played again. What was written before the checkpoint is there,
//! and a run is not continued without it: nothing could play it again.

use super::{EVALUATION_EPISODES, EvaluationRow, FinalResult, Summary, Trained};
use crate::description::{BEST, EVALUATIONS};
use crate::policy::Choice;
use crate::rollout::Episode;
use crate::team::Team;
use crate::tensors::{FileError, create_folder, entries, read_text, remove};
use crate::weights::write_weights;
use std::collections::HashMap;
use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Names of the other files.
const EPISODES: &str = "evaluation_episodes.csv";
pub(crate) const EVALUATION_WEIGHTS: &str = "evaluations";

/// The header of the episodes.
const EPISODE_COLUMNS: &str = "steps,actions,episode,return,length,won\n";

/// The episodes of an evaluation, with greedy and with sampled actions. Those of a run on several maps are of
/// one map after the other, as many of each ([`on_map`]).
pub type BothEpisodes = [Vec<Episode>; 2];

/// Those of the episodes of an evaluation that were played on map `map`, of so many.
pub fn on_map(episodes: &[Episode], map: usize, maps: usize) -> &[Episode] {
    let of_each = episodes.len() / maps;
    &episodes[map * of_each..(map + 1) * of_each]
}

/// The files of one run.
pub struct EvaluationFiles {
    folder: PathBuf,
}

impl EvaluationFiles {
    /// Opens the files of a run that trains on so many maps and is evaluated at every multiple of `every`
    /// steps until its `end`, and removes what is of evaluations after its checkpoint, which are played
    /// again, or after its end, which was later before. Returns the rows that stay.
    ///
    /// # Errors
    /// If something is missing that was written before the checkpoint; then nothing is removed.
    pub(crate) fn open(
        folder: &Path,
        (maps, every, end): (usize, u64, u64),
        trained: Trained,
    ) -> Result<(EvaluationFiles, Vec<EvaluationRow>), FileError> {
        let files = EvaluationFiles::of(folder);
        let mut rows = files.rows()?;
        rows.retain(|row| row.trained_steps <= trained.steps && row.steps <= end);
        files.check_rows(&rows, every, trained)?;
        files.check_episodes(&rows, maps * EVALUATION_EPISODES)?;
        let stays = |steps: u64| rows.iter().any(|row| row.steps == steps);
        let lines: String = rows.iter().map(EvaluationRow::line).collect();
        let header = EvaluationRow::COLUMNS.join(",") + "\n";
        let episodes = read_lines(&files.folder.join(EPISODES))?;
        let of_rows = episodes.lines().filter(|line| first_number(line).is_some_and(stays));
        let episodes = of_rows.fold(EPISODE_COLUMNS.to_owned(), |text, line| text + line + "\n");
        for (name, text) in [(EVALUATIONS, header + &lines), (EPISODES, episodes)] {
            crate::tensors::write(&files.folder.join(name), text.as_bytes())?;
        }
        for path in weights_in(&files.folder.join(EVALUATION_WEIGHTS))? {
            if !steps_of(&path).is_some_and(stays) {
                remove(&path)?;
            }
        }
        Ok((files, rows))
    }

    /// Every row that was written before the checkpoint must be there: those of the step counts that were
    /// reached before the last update, those before another one, and in a complete run that of its end.
    fn check_rows(&self, rows: &[EvaluationRow], every: u64, trained: Trained) -> Result<(), FileError> {
        let damaged = |why| Err(FileError::Damaged { path: self.folder.join(EVALUATIONS), why });
        let made = trained.steps;
        let reached = rows.last().map(|last| last.steps).max(trained.before_last_update);
        let due = (0..).map(|i| every.saturating_mul(i)).take_while(|steps| Some(*steps) <= reached);
        let mut rows_left = rows.iter().peekable();
        for steps in due {
            while rows_left.next_if(|row| row.steps < steps).is_some() {}
            if rows_left.next_if(|row| row.steps == steps).is_none() {
                return damaged(format!(
                    "it has no evaluation at {steps} steps, but the checkpoint is of {made} steps, and an \
                     evaluation was played at every multiple of {every}"
                ));
            }
        }
        // That of a killed process can be of an end after the checkpoint.
        let is_complete = FinalResult::read(&self.folder)?.is_some_and(|result| result.run_steps == made);
        if is_complete && rows.last().is_none_or(|last| last.trained_steps != made) {
            return damaged(format!(
                "it has no evaluation after {made} steps, but final.json is of that many"
            ));
        }
        Ok(())
    }

    /// Every row must have its episodes, so many of each kind.
    fn check_episodes(&self, rows: &[EvaluationRow], expected: usize) -> Result<(), FileError> {
        let counts: HashMap<u64, [usize; 2]> =
            self.episodes()?.into_iter().map(|(steps, both)| (steps, both.map(|kind| kind.len()))).collect();
        for EvaluationRow { steps, .. } in rows {
            let counts = counts.get(steps).copied().unwrap_or_default();
            for (actions, found) in Choice::BOTH.into_iter().zip(counts) {
                if found != expected {
                    let why = format!(
                        "it has {found} {actions} episodes of the evaluation at {steps} steps, but \
                         {expected} were played"
                    );
                    return Err(FileError::Damaged { path: self.folder.join(EPISODES), why });
                }
            }
        }
        Ok(())
    }

    /// Whether there is a file of evaluations.
    pub fn exist(folder: &Path) -> bool {
        folder.join(EVALUATIONS).exists()
    }

    /// Removes all files of a run that was here, so that one that begins takes nothing over: neither its
    /// rows, nor its best weights, which would play instead of the new ones.
    ///
    /// # Errors
    /// If they cannot be read or removed.
    pub fn clear(folder: &Path) -> Result<(), FileError> {
        for path in weights_in(&folder.join(EVALUATION_WEIGHTS))? {
            remove(&path)?;
        }
        for name in [EVALUATIONS, EPISODES, BEST] {
            remove(&folder.join(name))?;
        }
        remove(&FinalResult::path(folder))
    }

    /// The files of a run, to be read.
    pub fn of(folder: &Path) -> EvaluationFiles {
        EvaluationFiles { folder: folder.to_owned() }
    }

    /// The file with the weights of an evaluation.
    pub fn weights(&self, steps: u64) -> PathBuf {
        self.folder.join(EVALUATION_WEIGHTS).join(format!("{steps:012}.safetensors"))
    }

    /// Writes the weights of an evaluation, in a folder that exists from the first one on.
    ///
    /// # Errors
    /// If they cannot be written.
    pub(crate) fn write_weights(&self, steps: u64, team: &Team) -> Result<(), FileError> {
        create_folder(&self.folder.join(EVALUATION_WEIGHTS))?;
        write_weights(&self.weights(steps), team)
    }

    /// Adds an evaluation.
    ///
    /// # Errors
    /// If the files cannot be written.
    pub(crate) fn append(&self, row: &EvaluationRow, episodes: &BothEpisodes) -> Result<(), FileError> {
        let mut text = String::new();
        for (actions, episodes) in Choice::BOTH.into_iter().zip(episodes) {
            for (i, episode) in episodes.iter().enumerate() {
                let Episode { episode_return, length, won } = episode;
                let (steps, won) = (row.steps, u8::from(*won));
                text += &format!("{steps},{actions},{i},{episode_return},{length},{won}\n");
            }
        }
        append(&self.folder.join(EPISODES), &text)?;
        append(&self.folder.join(EVALUATIONS), &row.line())
    }

    /// All rows, by step count.
    ///
    /// # Errors
    /// If the file cannot be read or is damaged.
    pub fn rows(&self) -> Result<Vec<EvaluationRow>, FileError> {
        self.parse_rows(&self.lines(EVALUATIONS)?)
    }

    /// The same, with the means of the episodes on the first map of a run on so many.
    ///
    /// # Errors
    /// As [`rows`](Self::rows), and if that of the episodes cannot be read.
    pub fn rows_on_first(&self, maps: usize) -> Result<Vec<EvaluationRow>, FileError> {
        let mut rows = self.rows()?;
        if maps > 1 {
            let episodes: HashMap<u64, BothEpisodes> = self.episodes()?.into_iter().collect();
            for row in &mut rows {
                if let Some(both) = episodes.get(&row.steps) {
                    [row.greedy, row.sampled] = both.each_ref().map(|all| Summary::of(on_map(all, 0, maps)));
                }
            }
        }
        Ok(rows)
    }

    fn parse_rows(&self, text: &str) -> Result<Vec<EvaluationRow>, FileError> {
        let path = self.folder.join(EVALUATIONS);
        let columns = EvaluationRow::COLUMNS.join(",");
        let damaged = |why| FileError::Damaged { path: path.clone(), why };
        match text.lines().next() {
            None => return Ok(Vec::new()),
            Some(head) if head != columns => {
                return Err(damaged(format!("its first line is `{head}`, not `{columns}`")));
            }
            Some(_) => {}
        }
        let row = |(i, line)| {
            let row = EvaluationRow::parse(line);
            row.ok_or_else(|| {
                let number = i + 1;
                damaged(format!(
                    "line {number} is `{line}`, which is no evaluation: expected a finite number in each of \
                     the columns {columns}, the first three of them whole"
                ))
            })
        };
        let rows: Vec<EvaluationRow> = text.lines().enumerate().skip(1).map(row).collect::<Result<_, _>>()?;
        match rows.windows(2).find(|pair| pair[0].steps >= pair[1].steps) {
            Some(pair) => Err(damaged(format!("its steps do not rise at {}", pair[1].steps))),
            None => Ok(rows),
        }
    }

    /// The episodes of all evaluations, by step count.
    ///
    /// # Errors
    /// If the file cannot be read or is damaged.
    pub fn episodes(&self) -> Result<Vec<(u64, BothEpisodes)>, FileError> {
        let path = self.folder.join(EPISODES);
        let text = self.lines(EPISODES)?;
        let mut all: Vec<(u64, BothEpisodes)> = Vec::new();
        for (number, line) in text.lines().enumerate().skip(1) {
            let (steps, actions, episode) = parse_episode(line).ok_or_else(|| {
                let why = format!(
                    "line {} is `{line}`, which is no episode: expected {}, with `greedy` or `sampled` as \
                     actions, a finite return, and 0 or 1 for won",
                    number + 1,
                    EPISODE_COLUMNS.trim_end()
                );
                FileError::Damaged { path: path.clone(), why }
            })?;
            if all.last().is_none_or(|(last, _)| *last != steps) {
                all.push((steps, BothEpisodes::default()));
            }
            if let Some((_, both)) = all.last_mut() {
                both[actions.index()].push(episode);
            }
        }
        Ok(all)
    }

    /// The lines of a file. What a killed process left of its last line is left out; in a run that is
    /// complete none was killed, and an evaluation or an episode would be missing.
    fn lines(&self, name: &str) -> Result<String, FileError> {
        let path = self.folder.join(name);
        let text = read_lines(&path)?;
        if FinalResult::path(&self.folder).exists() && read_text(&path)?.len() > text.len() {
            let why = "its last line has no line break at its end, although the run is complete".to_owned();
            return Err(FileError::Damaged { path, why });
        }
        Ok(text)
    }
}

fn first_number(line: &str) -> Option<u64> {
    line.split(',').next()?.parse().ok()
}

fn parse_episode(line: &str) -> Option<(u64, Choice, Episode)> {
    let fields: Vec<&str> = line.split(',').collect();
    let &[steps, actions, _, episode_return, length, won] = &fields[..] else { return None };
    let actions = actions.parse().ok()?;
    let episode_return = episode_return.parse().ok().filter(|value: &f32| value.is_finite())?;
    let won = match won {
        "0" => false,
        "1" => true,
        _ => return None,
    };
    Some((steps.parse().ok()?, actions, Episode { episode_return, length: length.parse().ok()?, won }))
}

/// The complete lines of a file; none if it does not exist.
fn read_lines(path: &Path) -> Result<String, FileError> {
    let mut text = read_text(path)?;
    text.truncate(text.rfind('\n').map_or(0, |end| end + 1));
    Ok(text)
}

/// The step count that a file of weights is named by.
fn steps_of(path: &Path) -> Option<u64> {
    path.file_name()?.to_str()?.strip_suffix(".safetensors")?.parse().ok()
}

/// The files of weights in a folder. Other files are not those of a run.
fn weights_in(folder: &Path) -> Result<impl Iterator<Item = PathBuf>, FileError> {
    let paths = entries(folder)?.into_iter().map(|entry| entry.path());
    Ok(paths.filter(|path| steps_of(path).is_some()))
}

fn append(path: &Path, text: &str) -> Result<(), FileError> {
    let file = OpenOptions::new().append(true).open(path);
    let written = file.and_then(|mut file| {
        file.write_all(text.as_bytes())?;
        file.sync_data() // the checkpoint that says that it was written may outlive a failure of the power
    });
    written.map_err(|source| FileError::Write { path: path.to_owned(), source })
}
