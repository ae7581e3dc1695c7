//! What a page calls a scenario: one text, which its choices, its links and its requests have in common.
//!
//! It is the name of a standard scenario; or the text of a scenario file; or, where that is not all (with
//! unit files, other rules, another limit or other opponents), a battle setup as `run.json` has it, which is
//! known by its key `files`.

use crate::layer::Activation;
use crate::network::NetworkKind;
use crate::protocol::TextFile;
use serde::Deserialize;
use serde_json::Value;
use smaclite_engine::{BattleSetup, EpisodeLimit, Sides};
use smaclite_scenarios::{Problems, Scenario, ScenarioFiles, UnitFile};
use smaclite_units::file::{did_you_mean, shortened};

/// Why a text or files are not a scenario.
#[derive(Debug, thiserror::Error)]
pub(crate) enum SourceError {
    #[error("`{name}` is not the name of a standard scenario; {hint}")]
    Unknown { name: String, hint: String },
    #[error("the battle is not valid: {0}")]
    Setup(serde_json::Error),
    #[error("`episode_limit` of the battle must be at least 1, or null, got 0")]
    NoLimit,
    #[error("the scenario `{name}` is not valid: {problems}{hint}")]
    Invalid { name: String, problems: Problems, hint: &'static str },
    #[error("two unit files are called {name}.json; a scenario has each name once, so rename one of them")]
    TwoFiles { name: String },
    #[error("open one scenario file, which has `groups` or `teams`, and its unit files; got {0}")]
    Count(String),
}

/// What is played in a scenario.
pub(crate) fn setup_of(source: &str) -> Result<BattleSetup, SourceError> {
    if !source.trim_start().starts_with('{') {
        // A link may be anybody's: it must not make the program that serves the page read files.
        let files = ScenarioFiles::standard(source).ok_or_else(|| {
            let names = Scenario::standard_names().chain(Scenario::generated_names());
            SourceError::Unknown { name: shortened(source), hint: did_you_mean(source, names) }
        })?;
        return Ok(BattleSetup::new(files));
    }
    if parsed(source).get("files").is_some() {
        // As a run without a configuration, so that the page has this code once.
        let RunFile { setup, .. } = serde_json::from_str(source).map_err(SourceError::Setup)?;
        if setup.episode_limit == EpisodeLimit::Steps(0) {
            return Err(SourceError::NoLimit);
        }
        return Ok(if setup.sides.are_both() { setup.with_sides(Sides::Allies) } else { setup });
    }
    let files = ScenarioFiles { source: "scenario".into(), text: source.into(), unit_files: Vec::new() };
    Ok(BattleSetup::new(files))
}

/// What matters here of `run.json`.
#[derive(Deserialize)]
pub(crate) struct RunFile {
    pub config: Option<RunConfig>,
    #[serde(flatten)]
    pub setup: BattleSetup,
}

/// The hyperparameters that playing needs.
#[derive(Debug, Deserialize)]
pub(crate) struct RunConfig {
    #[serde(default)]
    pub network: NetworkKind,
    pub hidden: Vec<usize>,
    #[serde(default)]
    pub activation: Activation,
    #[serde(default)]
    pub last_actions: usize,
}

/// What a page calls the scenario of a setup: the shortest text of what is played in it.
pub fn source_of(setup: &BattleSetup, scenario: &Scenario) -> String {
    let plain = BattleSetup::new(setup.files.clone());
    let limit = match setup.episode_limit {
        EpisodeLimit::Scenario => scenario.episode_limit,
        EpisodeLimit::Steps(steps) => Some(steps),
        EpisodeLimit::None => None,
    };
    let is_plain = limit == scenario.episode_limit
        && (setup.rules, &setup.opponents) == (plain.rules, &plain.opponents)
        && setup.files.unit_files.is_empty();
    match is_plain {
        true if setup.files.is_standard() => scenario.name.clone(),
        true => setup.files.text.clone(),
        false => serde_json::to_string(setup).unwrap_or_default(), // every value of it is valid JSON
    }
}

/// The scenario in files that a person opens together.
pub(crate) fn opened(files: Vec<TextFile>) -> Result<String, SourceError> {
    let names = files.iter().map(|file| file.name.as_str()).collect::<Vec<_>>().join(", ");
    let is_alone = files.len() == 1; // its reader says what is wrong with it
    let (mut scenarios, units): (Vec<_>, Vec<_>) =
        files.into_iter().partition(|file| is_alone || is_scenario(&file.text));
    let (Some(TextFile { name, text }), true) = (scenarios.pop(), scenarios.is_empty()) else {
        return Err(SourceError::Count(if names.is_empty() { "none".into() } else { names }));
    };
    let words = words(&text);
    let unit_file = |TextFile { name, text }: TextFile| {
        let stem = stem(&name).to_owned();
        let mut keys: Vec<_> = words.iter().filter(|word| self::stem(word) == stem).cloned().collect();
        keys.sort_unstable();
        keys.dedup();
        (!keys.is_empty()).then_some(UnitFile { name: stem, keys, text })
    };
    let unit_files: Vec<UnitFile> = units.into_iter().filter_map(unit_file).collect();
    let names: Vec<&str> = unit_files.iter().map(|file| file.name.as_str()).collect();
    if let Some(twice) = (1..names.len()).find(|&i| names[..i].contains(&names[i])) {
        return Err(SourceError::TwoFiles { name: names[twice].to_owned() });
    }
    let files = ScenarioFiles { source: name.clone(), text, unit_files };
    match files.scenario() {
        Ok(scenario) => Ok(source_of(&BattleSetup::new(files), &scenario)),
        Err(problems) => {
            let lacks = problems.list().iter().any(|problem| problem.message.contains("nor a unit file"));
            let hint = if lacks { "; open its unit files together with it" } else { "" };
            Err(SourceError::Invalid { name, problems, hint })
        }
    }
}

/// The value of a text, or null if it is not JSON.
fn parsed(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_default()
}

fn is_scenario(text: &str) -> bool {
    let file = parsed(text);
    file.get("groups").or(file.get("teams")).is_some()
}

/// A name of a unit file without its folders and without `.json`, as scenarios may leave them out.
fn stem(name: &str) -> &str {
    let name = name.rsplit(['/', '\\']).next().unwrap_or(name);
    name.strip_suffix(".json").unwrap_or(name)
}

/// All keys and texts of a file of JSON, among which are the names of units.
fn words(text: &str) -> Vec<String> {
    let mut words = Vec::new();
    let mut left = vec![parsed(text)];
    while let Some(value) = left.pop() {
        match value {
            Value::Object(entries) => {
                for (key, value) in entries {
                    words.push(key);
                    left.push(value);
                }
            }
            Value::Array(items) => left.extend(items),
            Value::String(word) => words.push(word),
            Value::Null | Value::Bool(_) | Value::Number(_) => {}
        }
    }
    words
}
