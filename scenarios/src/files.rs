//! A scenario as the texts of its files, which need no file system to be read again.

use crate::Scenario;
use crate::keys::{GROUPS, HEIGHT, REWARDS, SMACV2, START_POSITIONS, TEAMS, TERRAIN, TERRAIN_PRESET, WIDTH};
use crate::unit_files::{Origin, UnitFile};
use serde::{Deserialize, Serialize};
use serde_json::value::{RawValue, to_raw_value};
use smaclite_units::Problems;
use smaclite_units::file::{MAX_SCENARIO_BYTES, Report, read_text, shown_path, without_mark};
use std::collections::BTreeMap;
use std::path::Path;

/// Where the files of standard scenarios are in the source; they are embedded from there.
pub(crate) const STANDARD_FOLDER: &str = "scenarios/data/";

/// The end of the source of files with changed keys.
const CHANGED: &str = " with changed keys";

/// The keys of a file that this one replaces, as they say the same.
fn replaced_by(key: &str) -> &'static [&'static str] {
    match key {
        _ if key == TEAMS.name => &[GROUPS.name],
        _ if key == GROUPS.name => &[TEAMS.name],
        _ if key == TERRAIN.name => &[TERRAIN_PRESET.name],
        _ if key == TERRAIN_PRESET.name => &[TERRAIN.name, WIDTH.name, HEIGHT.name],
        _ => &[],
    }
}

/// The entries of a JSON object, as they are written.
fn entries_of(text: &str) -> Option<BTreeMap<String, Box<RawValue>>> {
    serde_json::from_str(text).ok()
}

/// The options of an object and others, which replace those of the same names. The others stay as they are
/// written: a duplicate is found by the reader of the whole.
fn with_options(options: &RawValue, others: &RawValue) -> Option<Box<RawValue>> {
    let (mut left, replaced) = (entries_of(options.get())?, entries_of(others.get())?);
    left.retain(|name, _| !replaced.contains_key(name));
    let left = serde_json::to_string(&left).ok()?;
    let inside = |object: &str| object[1..object.len() - 1].to_owned();
    let comma = if left == "{}" || replaced.is_empty() { "" } else { "," };
    RawValue::from_string(format!("{{{}{comma}{}}}", inside(&left), inside(others.get()))).ok()
}

/// The text of a scenario file and of every unit file that it names.
///
/// ```
/// use smaclite_scenarios::ScenarioFiles;
///
/// let (scenario, files) = ScenarioFiles::resolve("2s3z").unwrap();
/// assert_eq!(files.scenario().unwrap(), scenario);
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ScenarioFiles {
    /// What error messages call the scenario file.
    pub source: String,
    /// The text of the scenario file.
    pub text: String,
    /// The unit files; standard unit types need none.
    pub unit_files: Vec<UnitFile>,
}

impl ScenarioFiles {
    /// Keys that cannot be [changed](Self::with_keys), as no file is opened then.
    pub const ONLY_IN_FILES: [&str; 2] = ["$schema", "custom_unit_path"];

    /// As [`Scenario::load`], with the texts that the scenario was read from.
    ///
    /// # Errors
    /// As [`Scenario::load`].
    pub fn load(path: &Path) -> Result<(Scenario, ScenarioFiles), Problems> {
        let (base_dir, source) = (path.parent().unwrap_or(Path::new("")), shown_path(path));
        let report = Report::default();
        let read = read_text(path, MAX_SCENARIO_BYTES, &report).and_then(|text| {
            let read = Scenario::read(&text, &source, Origin::Folder(base_dir), &report);
            read.map(|(scenario, unit_files)| (scenario, text, unit_files))
        });
        let (scenario, text, unit_files) = report.finish(read)?;
        Ok((scenario, ScenarioFiles { source, text, unit_files }))
    }

    /// The files with other top-level keys of the scenario file: `null` removes a key, the options of
    /// `smacv2` and `rewards` are added to those of the file, and any other value replaces the file's. The
    /// options of `rewards` are among those of `smacv2` in a file that has them. Of `groups` and `teams`
    /// one replaces the other, groups also the `start_positions` of teams; and so it is of `terrain` and
    /// `terrain_preset`, with which the size of the map is that of presets. The text is written anew, and
    /// what cannot be changed because it is no JSON object stays as it is.
    ///
    /// ```
    /// use smaclite_scenarios::ScenarioFiles;
    ///
    /// let (_, files) = ScenarioFiles::resolve("3s5z").unwrap();
    /// let starts = serde_json::json!({"distribution": "reflect_position"});
    /// let scenario = files.with_keys([("start_positions".to_owned(), starts)]).scenario().unwrap();
    /// assert!(scenario.generation.is_some());
    /// ```
    #[must_use]
    pub fn with_keys(&self, keys: impl IntoIterator<Item = (String, impl Serialize)>) -> ScenarioFiles {
        // Texts, whose entries keep their order: that of `units` in groups gives units their ids.
        let text_of = |(key, value)| Some((key, to_raw_value(&value).ok()?));
        self.with_texts(keys.into_iter().filter_map(text_of).collect())
    }

    fn with_texts(&self, mut keys: Vec<(String, Box<RawValue>)>) -> ScenarioFiles {
        let is_null = |value: &RawValue| value.get() == "null";
        let is_given = |key: &str| keys.iter().any(|(given, value)| given == key && !is_null(value));
        let read = entries_of(without_mark(&self.text));
        let Some(mut file) = read.filter(|_| !keys.is_empty()) else { return self.clone() };
        if is_given(GROUPS.name) && file.contains_key(TEAMS.name) {
            // Drawn for teams, which have no positions. Groups have their own.
            file.remove(START_POSITIONS.name);
        }
        for key in keys.iter().map(|(key, _)| key.as_str()).filter(|key| is_given(key)) {
            // Who gives both is told that one of them must be left out.
            for replaced in replaced_by(key).iter().filter(|replaced| !is_given(replaced)) {
                file.remove(*replaced);
            }
        }
        let has_smacv2 = file.contains_key(SMACV2.name);
        keys.sort_by_key(|(key, _)| key == REWARDS.name); // after options of `smacv2` that are given, too
        for (mut key, value) in keys {
            let is_smacv2 = has_smacv2 && file.contains_key(SMACV2.name);
            if key == REWARDS.name && is_smacv2 && !is_null(&value) {
                SMACV2.name.clone_into(&mut key);
            }
            let has_options = [SMACV2.name, REWARDS.name].contains(&&*key);
            let of_file = file.remove(&key).filter(|_| has_options);
            if is_null(&value) {
                continue;
            }
            let merged = of_file.and_then(|options| with_options(&options, &value));
            file.insert(key, merged.unwrap_or(value));
        }
        let text = serde_json::to_string_pretty(&file).unwrap_or_default() + "\n";
        ScenarioFiles { source: self.source_with_changes(), text, ..self.clone() }
    }

    /// What error messages call the file with other keys. A standard scenario has no file that a user could
    /// open, so it is called by its name.
    fn source_with_changes(&self) -> String {
        let standard = self.source.strip_prefix(STANDARD_FOLDER).and_then(|file| file.strip_suffix(".json"));
        let name = standard.unwrap_or(&self.source);
        if name.ends_with(CHANGED) { name.to_owned() } else { format!("{name}{CHANGED}") }
    }

    /// Reads the scenario; no file is opened.
    ///
    /// ```
    /// use smaclite_scenarios::{ScenarioFiles, UnitFile};
    ///
    /// let scout = UnitFile { name: "scout".into(), keys: vec!["scout".into()], text: "{".into() };
    /// let group = r#"{"x": 9, "y": 9, "faction": "ALY", "units": {"scout": 1}}"#;
    /// let files = ScenarioFiles {
    ///     source: "duel.json".into(),
    ///     text: format!("{{\n  \"groups\": [{group}]\n}}"),
    ///     unit_files: vec![scout],
    /// };
    /// let problems = files.scenario().unwrap_err();
    /// let faction = problems.list().iter().find(|problem| problem.path == "groups[0].faction").unwrap();
    /// assert_eq!((faction.file.as_str(), faction.line, faction.column), ("duel.json", Some(2), Some(42)));
    /// assert!(problems.list().iter().any(|problem| problem.file == "scout.json"));
    /// ```
    ///
    /// # Errors
    /// [`Problems`] of all texts. A unit file is called by its name and `.json`.
    pub fn scenario(&self) -> Result<Scenario, Problems> {
        let report = Report::default();
        let read = Scenario::read(&self.text, &self.source, Origin::Texts(&self.unit_files), &report);
        let scenario = report.finish(read).map(|(scenario, _)| scenario);
        scenario.map_err(|found| self.placed(found))
    }

    /// The text with changes is in no file: its lines and columns would mislead.
    pub(crate) fn placed(&self, found: Problems) -> Problems {
        if self.source.ends_with(CHANGED) { found.without_places(&self.source) } else { found }
    }
}
