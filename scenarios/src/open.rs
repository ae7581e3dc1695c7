//! Scenarios that are edited: their files may be invalid, and their unit types are looked up one by one.

use crate::generation::keys::{EXCEPTION_UNIT_TYPES, TEAMS_LIST, UNIT_TYPES};
use crate::keys::{CUSTOM_UNIT_PATH, GROUPS, MAX_TYPE_NAME, TEAMS, UNIT_TYPE_IDS, UNITS};
use crate::read::{refuse_other, refuse_page};
use crate::unit_files::{Origin, UnitFiles};
use crate::{Problems, ScenarioFiles};
use smaclite_units::UnitType;
use smaclite_units::file::{Document, MAX_SCENARIO_BYTES, Node, Report, Reported, read_text, shown_path};
use std::path::{Path, PathBuf};

impl ScenarioFiles {
    /// The texts of a scenario file and of the unit files that it names, whether they are valid or not, and
    /// the path of each of the unit files. Unit types without a file are left out.
    ///
    /// # Errors
    /// [`Problems`] if the scenario file cannot be read as text, or is a file of another kind.
    pub fn open(path: &Path) -> Result<(ScenarioFiles, Vec<PathBuf>), Problems> {
        let report = Report::default();
        let text = read_text(path, MAX_SCENARIO_BYTES, &report);
        let source = shown_path(path);
        let text = text.and_then(|text| refuse_page(&text, &source, &report).map(|()| text));
        let text = report.finish(text)?;
        refuse_json(&text, &source)?;
        let base_dir = path.parent().unwrap_or(Path::new(""));
        let report = Report::default(); // of problems that the editor shows by `scenario`
        let found = unit_files(&text, &source, base_dir, &report).unwrap_or_default();
        let (paths, unit_files) = found.into_iter().unzip();
        Ok((ScenarioFiles { source, text, unit_files }, paths))
    }

    /// The unit type that a key of the scenario file names, if it is valid.
    pub fn unit_type(&self, key: &str) -> Option<UnitType> {
        let report = Report::default();
        let document = Document::parse("null", &self.source, &report).ok()?;
        let files = UnitFiles::new(Origin::Texts(&self.unit_files), Ok(None), &report);
        let found = files.find(key, &document.root()).ok()?;
        files.load(&found, &document.root()).ok()
    }
}

/// Refuses JSON that is not a scenario, which saving would replace. Text that is not JSON yet may become one.
fn refuse_json(text: &str, source: &str) -> Result<(), Problems> {
    let report = Report::default();
    let refused = match Document::parse(text, source, &report) {
        Ok(document) => refuse_other(&document.root(), source, &report),
        Err(_) => return Ok(()),
    };
    refused.or_else(|reported| report.finish(Err(reported)))
}

fn unit_files(
    text: &str,
    source: &str,
    base_dir: &Path,
    report: &Report,
) -> Result<Vec<(PathBuf, crate::UnitFile)>, Reported> {
    let document = Document::parse(text, source, report)?;
    let file = document.root().object(&[])?;
    let files = UnitFiles::new(Origin::Folder(base_dir), file.read_optional(&CUSTOM_UNIT_PATH), report);
    let groups = file.get(&GROUPS).and_then(|groups| groups.items().ok()).unwrap_or_default();
    for node in file.get(&TEAMS).iter().flat_map(types_of_teams) {
        if let Ok(found) = node.text(MAX_TYPE_NAME).and_then(|key| files.find(key, &node)) {
            let _ = files.load(&found, &node); // as below
        }
    }
    let named = groups.iter().filter_map(units_of).chain(file.get(&UNIT_TYPE_IDS));
    for (key, node) in named.filter_map(|named| named.entries().ok()).flatten() {
        if let Ok(found) = files.find(key, &node) {
            let _ = files.load(&found, &node); // notes the text, also of an invalid file
        }
    }
    Ok(files.into_found_at())
}

/// The values of `teams` that name unit types.
fn types_of_teams<'a>(teams: &Node<'a>) -> Vec<Node<'a>> {
    let Ok(object) = teams.object(&[]) else { return Vec::new() };
    let items = |node: Node<'a>| node.items().unwrap_or_default();
    let lists = object.get(&UNIT_TYPES).into_iter().chain(object.get(&EXCEPTION_UNIT_TYPES));
    let lists = lists.chain(object.get(&TEAMS_LIST).map(items).into_iter().flatten());
    lists.flat_map(items).collect()
}

fn units_of<'a>(group: &Node<'a>) -> Option<Node<'a>> {
    group.object(&[]).ok()?.get(&UNITS)
}
