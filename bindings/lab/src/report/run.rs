//! A run as a report reads it: what it played, its evaluations and its final episodes.
//!
//! The folder is one of `smaclite-pool train --evaluate-every N`, or of another learner that writes the same
//! `evaluations.csv`, `evaluation_episodes.csv` and `final.json`. Such a learner has `options.json` instead
//! of `run.json`, an object with `scenario` (a name, or the path of a file) and `seed`; and with `rules`, if
//! its battles were not played by those of SMAClite.
//!
//! A run on several maps is reported as one run per map, each with the episodes on it; steps and times are
//! those of the whole run, and the best weights those that are best on all maps together.

use super::ReportError;
use crate::verify::{missing, recorded};
use serde_json::Value;
use smaclite_engine::fnv::Fnv1a;
use smaclite_engine::{Rules, UnknownRules};
use smaclite_learn::{
    BothEpisodes, Choice, Config, DESCRIPTIONS, Enemies, Episode, EvaluationFiles, EvaluationRow, FileError,
    FinalResult, OPPONENT, RunDescription, Summary, Weights, on_map, read_file,
};
use std::path::{Path, PathBuf};

/// How far a win rate may be from that of its episodes.
const ROUNDING: f64 = 1e-6;

/// How far a mean return or length may be from that of the episodes, as a share of it if it is above 1: other
/// learners may round either of them.
const COARSE_ROUNDING: f64 = 1e-2;

/// An evaluation while a run trained.
#[derive(Clone, Debug)]
pub struct PlayedEvaluation {
    /// Step count, means and times.
    pub row: EvaluationRow,
    episodes: BothEpisodes,
}

/// A complete run that was evaluated.
#[derive(Clone, Debug)]
pub struct EvaluatedRun {
    /// Its folder.
    pub folder: PathBuf,
    /// The scenario's name, with `-paper` if it was played by those rules.
    pub task: String,
    /// Its seed.
    pub seed: u64,
    /// By step count; at least one.
    pub evaluations: Vec<PlayedEvaluation>,
    /// How its best weights play.
    pub result: FinalResult,
    /// The description, if `smaclite-pool train` made the run: then its weights can be played again.
    pub(super) description: Option<RunDescription>,
    /// What was played, and with which options, without the seed: what runs that are compared have in common.
    pub(super) battles: Option<Value>,
    pub(super) settings: Value,
}

impl PlayedEvaluation {
    /// Its episodes.
    pub fn episodes(&self, actions: Choice) -> &[Episode] {
        &self.episodes[actions.index()]
    }

    /// What was played on one map of so many.
    fn on_map(&self, map: usize, maps: usize) -> PlayedEvaluation {
        if maps == 1 {
            return self.clone(); // with the means as they are written
        }
        let episodes = self.episodes.each_ref().map(|all| on_map(all, map, maps).to_vec());
        let [greedy, sampled] = episodes.each_ref().map(|episodes| Summary::of(episodes));
        PlayedEvaluation { row: EvaluationRow { greedy, sampled, ..self.row }, episodes }
    }
}

impl EvaluatedRun {
    /// Whether a folder is that of a run.
    pub(super) fn is_in(folder: &Path) -> bool {
        DESCRIPTIONS.iter().any(|name| folder.join(name).is_file())
    }

    /// Reads a run, on each of its maps.
    pub(super) fn read(folder: &Path) -> Result<Vec<EvaluatedRun>, ReportError> {
        if !EvaluationFiles::exist(folder) {
            return Err(ReportError::NoEvaluations(folder.to_owned()));
        }
        let evaluations = read_evaluations(folder)?;
        let incomplete = || ReportError::Incomplete(folder.to_owned());
        let result = FinalResult::read(folder)?.ok_or_else(incomplete)?;
        if result.greedy_episodes.is_empty() || result.sampled_episodes.is_empty() || evaluations.is_empty() {
            return Err(incomplete());
        }
        check_final(folder, &result)?;
        let described = if folder.join(DESCRIPTIONS[0]).is_file() {
            Described::by_program(folder)?
        } else {
            vec![Described::by_other(&folder.join(DESCRIPTIONS[1]))?]
        };
        if let Some(run) = described.iter().find_map(|described| described.description.as_ref()) {
            // A complete run that was resumed with more steps keeps its final episodes until it evaluates
            // again.
            if result.run_steps < run.config.steps {
                return Err(incomplete());
            }
            check_none_is_missing(folder, &run.config, &evaluations)?;
        }
        let maps = described.len();
        check_equally_many(folder, &evaluations, &result, maps)?;
        let on = |(map, described): (usize, Described)| {
            let Described { task, seed, description, battles, settings } = described;
            let folder = folder.to_owned();
            let evaluations = evaluations.iter().map(|evaluation| evaluation.on_map(map, maps)).collect();
            let [greedy_episodes, sampled_episodes] = [&result.greedy_episodes, &result.sampled_episodes]
                .map(|all| on_map(all, map, maps).to_vec());
            let (greedy, sampled) = (Summary::of(&greedy_episodes), Summary::of(&sampled_episodes));
            let result = match maps {
                1 => result.clone(), // with the means as they are written
                _ => FinalResult { greedy, sampled, greedy_episodes, sampled_episodes, ..result },
            };
            EvaluatedRun { folder, task, seed, evaluations, result, description, battles, settings }
        };
        Ok(described.into_iter().enumerate().map(on).collect())
    }

    /// The step counts of its evaluations.
    pub fn steps(&self) -> impl Iterator<Item = u64> {
        self.evaluations.iter().map(|evaluation| evaluation.row.steps)
    }

    /// Whether it ended at so many steps before it was resumed with more.
    pub(super) fn ended_at(&self, steps: u64) -> bool {
        self.description.as_ref().is_some_and(|run| run.former_steps.contains(&steps))
    }

    /// The final episodes.
    pub fn final_episodes(&self, actions: Choice) -> &[Episode] {
        match actions {
            Choice::Greedy => &self.result.greedy_episodes,
            Choice::Sampled => &self.result.sampled_episodes,
        }
    }
}

/// Rows with their episodes, which must agree.
fn read_evaluations(folder: &Path) -> Result<Vec<PlayedEvaluation>, ReportError> {
    let mut evaluations: Vec<PlayedEvaluation> = Vec::new();
    for (row, episodes) in recorded(folder)? {
        let steps = row.steps;
        let damaged = |why| FileError::Damaged { path: folder.join("evaluations.csv"), why };
        for (actions, summary) in Choice::BOTH.into_iter().zip([row.greedy, row.sampled]) {
            let of_kind = &episodes[actions.index()];
            let none = of_kind.is_empty().then_some(("win rate", summary.win_rate, 0.0));
            if let Some((what, said, played)) = none.or_else(|| difference(summary, of_kind)) {
                let counted = of_kind.len();
                let why = format!(
                    "at {steps} steps it has the {what} {said} of {actions} episodes, and \
                     evaluation_episodes.csv has {counted} episodes with {played}"
                );
                return Err(damaged(why).into());
            }
        }
        evaluations.push(PlayedEvaluation { row, episodes });
    }
    Ok(evaluations)
}

/// No evaluation was left out.
fn check_none_is_missing(
    folder: &Path,
    config: &Config,
    evaluations: &[PlayedEvaluation],
) -> Result<(), FileError> {
    let (Some(every), end) = (config.evaluate_every, config.steps) else { return Ok(()) };
    let steps = evaluations.iter().map(|evaluation| evaluation.row.steps).collect();
    let Some(steps) = missing(&steps, every, end, true) else { return Ok(()) };
    let why = format!(
        "it has no evaluation at {steps} steps, but run.json says that there is one at every multiple of \
         {every} steps and at the end, {end}"
    );
    Err(FileError::Damaged { path: folder.join("evaluations.csv"), why })
}

/// Each map of a run has as many episodes.
fn check_equally_many(
    folder: &Path,
    evaluations: &[PlayedEvaluation],
    result: &FinalResult,
    maps: usize,
) -> Result<(), FileError> {
    let of_result = [&result.greedy_episodes, &result.sampled_episodes].map(|all| ("final.json", all.len()));
    let of_evaluations = evaluations.iter().flat_map(|evaluation| &evaluation.episodes);
    let counts = of_evaluations.map(|all| ("evaluation_episodes.csv", all.len())).chain(of_result);
    match counts.into_iter().find(|(_, count)| count % maps > 0) {
        None => Ok(()),
        Some((name, count)) => {
            let why = format!("it has an evaluation of {count} episodes, which {maps} maps cannot share");
            Err(FileError::Damaged { path: folder.join(name), why })
        }
    }
}

/// Its means must be those of its episodes.
fn check_final(folder: &Path, result: &FinalResult) -> Result<(), FileError> {
    let damaged = |why| FileError::Damaged { path: FinalResult::path(folder), why };
    let kinds = [(&result.greedy_episodes, result.greedy), (&result.sampled_episodes, result.sampled)];
    for (actions, (episodes, summary)) in Choice::BOTH.into_iter().zip(kinds) {
        let counted = episodes.len();
        if let Some((what, said, played)) = difference(summary, episodes) {
            let why = format!("its {actions} {what} is {said}, but that of its {counted} episodes {played}");
            return Err(damaged(why));
        }
    }
    Ok(())
}

/// A mean that is not that of the episodes: its name, what is said, and what was played.
fn difference(said: Summary, episodes: &[Episode]) -> Option<(&'static str, f64, f64)> {
    let played = Summary::of(episodes);
    let coarse = |value: f64| COARSE_ROUNDING * value.abs().max(1.0);
    let means = [
        ("win rate", said.win_rate, played.win_rate, ROUNDING),
        ("mean return", said.mean_return, played.mean_return, coarse(played.mean_return)),
        ("mean length", said.mean_length, played.mean_length, coarse(played.mean_length)),
    ];
    let differs = means.into_iter().find(|(_, said, played, rounding)| (said - played).abs() > *rounding)?;
    Some((differs.0, differs.1, differs.2))
}

/// What a description says.
struct Described {
    task: String,
    seed: u64,
    description: Option<RunDescription>,
    battles: Option<Value>,
    settings: Value,
}

impl Described {
    fn by_program(folder: &Path) -> Result<Vec<Described>, FileError> {
        let run = RunDescription::read(folder)?;
        let path = folder.join(DESCRIPTIONS[0]);
        let mut first = read_object(&path)?;
        let mut settings = first["config"].take();
        ["config", "version"].into_iter().for_each(|name| without(&mut first, name));
        without(&mut settings, "seed");
        let others = first.as_object_mut().and_then(|first| first.remove("other_maps"));
        let others = others.and_then(|others| others.as_array().cloned()).unwrap_or_default();
        if let Some(former) = first.as_object_mut().and_then(|first| first.remove("former_steps")) {
            settings["former_steps"] = former; // step sizes fell by these
        }
        let mut battles: Vec<Value> = [first].into_iter().chain(others).collect();
        for battles in &mut battles {
            without(&mut battles["files"], "source"); // where the file was, not what is in it
            without(battles, "opponents"); // weights say the same in many ways: `description` has them
        }
        if let Enemies::Team { .. } = &run.config.enemies {
            // Not its folder, in which another one may be by now.
            battles[0]["enemies"] = opponent(&folder.join(OPPONENT))?;
            settings["enemies"] = battles[0]["enemies"].clone();
        }
        if battles.len() > 1 {
            settings["maps"] = battles.clone().into();
        }
        let maps = run.on_each_map().map_err(|error| FileError::Damaged { path, why: error.to_string() })?;
        let described = maps.into_iter().zip(battles).map(|(run, battles)| Described {
            task: task_name(&run.name, run.setup.rules),
            seed: run.config.seed,
            description: Some(run),
            battles: Some(battles),
            settings: settings.clone(),
        });
        Ok(described.collect())
    }

    fn by_other(path: &Path) -> Result<Described, FileError> {
        let damaged = |why| FileError::Damaged { path: path.to_owned(), why };
        let mut settings = read_object(path)?;
        let scenario = settings["scenario"].as_str().map(Path::new);
        let name = scenario.map(|path| match path.extension() {
            Some(suffix) if suffix == "json" => path.file_stem().unwrap_or_default(),
            _ => path.as_os_str(),
        });
        let (Some(name), Some(seed)) = (name, settings["seed"].as_u64()) else {
            return Err(damaged(
                "expected an object with `scenario`, a text, and `seed`, a whole number".to_owned(),
            ));
        };
        let rules: Rules = match settings.get("rules") {
            None => Rules::default(),
            Some(Value::String(rules)) => {
                rules.parse().map_err(|error: UnknownRules| damaged(error.to_string()))?
            }
            Some(other) => {
                return Err(damaged(format!(
                    "`rules` must be `smaclite`, `paper` or `starcraft`, got {other}"
                )));
            }
        };
        let task = task_name(&name.to_string_lossy(), rules);
        let battles = settings.get("battles").cloned();
        ["seed", "out", "battles", "file"].into_iter().for_each(|name| without(&mut settings, name));
        Ok(Described { task, seed, description: None, battles, settings })
    }
}

/// What tells one opponent from another: its description, and a hash of its weights.
fn opponent(folder: &Path) -> Result<Value, FileError> {
    let mut description = read_object(&folder.join(DESCRIPTIONS[0]))?;
    without(&mut description, "version");
    without(&mut description["files"], "source");
    let mut hash = Fnv1a::default();
    hash.write(&read_file(&folder.join(Weights::Last.file_name()))?);
    description["weights"] = hash.finish().into();
    Ok(description)
}

/// Runs by different rules are not compared with each other.
fn task_name(scenario: &str, rules: Rules) -> String {
    match rules {
        Rules::Smaclite => scenario.to_owned(),
        Rules::Paper | Rules::Starcraft => format!("{scenario}-{rules}"),
    }
}

fn without(object: &mut Value, name: &str) {
    if let Some(object) = object.as_object_mut() {
        object.remove(name);
    }
}

fn read_object(path: &Path) -> Result<Value, FileError> {
    let damaged = |why: String| FileError::Damaged { path: path.to_owned(), why };
    let value: Value =
        serde_json::from_slice(&read_file(path)?).map_err(|error| damaged(error.to_string()))?;
    if value.is_object() { Ok(value) } else { Err(damaged("expected an object".to_owned())) }
}
