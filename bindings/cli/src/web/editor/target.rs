//! What the editor begins with, and the files that it may write: the one that the command names and the unit
//! files of that scenario, in the same folder.

use crate::web::protocol::{Base, OpenedFiles, SaveFiles, SavedFiles};
use serde_json::Value;
use smaclite_engine::fnv::Fnv1a;
use smaclite_playground::new_scenario;
use smaclite_scenarios::{Problems, Scenario, ScenarioFiles, UnitFile, unit_file_candidates};
use smaclite_units::file::{MAX_SCENARIO_BYTES, MAX_UNIT_BYTES, Report, read_text, shown_path, write_whole};
use std::path::{Component, Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// What the editor begins with.
pub(crate) enum Start {
    /// A new scenario; saved by download.
    New,
    /// A standard scenario; saved by download.
    Standard(Box<ScenarioFiles>),
    /// A file, which need not exist yet.
    File(Target),
}

#[derive(Debug, thiserror::Error)]
pub(crate) enum TargetError {
    #[error(transparent)]
    Read(#[from] Problems),
    #[error("{0}: {1}")]
    Io(String, std::io::Error),
    #[error("`{0}` is neither a standard scenario nor the name of a file that ends in .json")]
    Name(String),
    #[error("the command names no file to save to; download the files instead")]
    NoFile,
    #[error(
        "unit type names must be 1 to 100 of the characters A-Z, a-z, 0-9, `_`, `-` and `.`, which cannot be \
         the first, got `{0}`"
    )]
    UnitName(String),
    #[error(
        "{0} is outside the folder of the scenario file, which is the only one that the editor writes to; \
         download the files instead"
    )]
    Outside(String),
    #[error(
        "the unit type `{unit}` would be written to {file}, which is another file of this scenario; rename it"
    )]
    SameFile { unit: String, file: String },
    #[error("{file}: has {bytes} bytes, but must have at most {max}")]
    TooLarge { file: String, bytes: usize, max: u64 },
}

impl Start {
    /// Of the command's argument.
    pub(crate) fn of(name: &str) -> Result<Start, TargetError> {
        if Scenario::standard_names().chain(Scenario::generated_names()).any(|standard| standard == name) {
            let files = ScenarioFiles::resolve(name).ok().map(|(_, files)| files);
            let files = files.ok_or_else(|| TargetError::Name(name.to_owned()))?;
            return Ok(Start::Standard(Box::new(ScenarioFiles { source: format!("{name}.json"), ..files })));
        }
        let path = Path::new(name);
        if !path.exists() && path.extension().is_none_or(|suffix| suffix != "json") {
            return Err(TargetError::Name(name.to_owned()));
        }
        let target = Target::new(path)?;
        target.read()?; // a file that cannot be read is reported before a page is opened
        Ok(Start::File(target))
    }

    /// The files to begin with; and the file that `save` writes, if there is one.
    pub(super) fn open(&self) -> Result<OpenedFiles, TargetError> {
        let unsaved = |files| OpenedFiles { files, target: None, exists: false, base: Base::new() };
        Ok(match self {
            Start::New => unsaved(new_files("new_scenario.json")),
            Start::Standard(files) => unsaved((**files).clone()),
            Start::File(target) => {
                let path = shown_path(&target.path);
                let (files, exists, base) = match target.read()? {
                    Some((files, base)) => (files, true, base),
                    None => (new_files(&path), false, Base::new()),
                };
                OpenedFiles { files, target: Some(path), exists, base }
            }
        })
    }

    pub(super) fn save(&self, save: SaveFiles) -> Result<SavedFiles, TargetError> {
        match self {
            Start::File(target) => target.save(save),
            Start::New | Start::Standard(_) => Err(TargetError::NoFile),
        }
    }
}

/// A new scenario, named after its file if that is a name that scenarios can have.
fn new_files(source: &str) -> ScenarioFiles {
    let stem = Path::new(source).file_stem().unwrap_or_default().to_string_lossy();
    let named = |name: &str| ScenarioFiles {
        source: source.to_owned(),
        text: new_scenario(name),
        unit_files: Vec::new(),
    };
    let files = named(&stem);
    if files.scenario().is_ok() { files } else { named("new_scenario") }
}

/// A scenario file that is edited.
pub(crate) struct Target {
    path: PathBuf,
    /// Its folder, without symbolic links.
    folder: PathBuf,
    /// The unit files that were read last.
    units: Mutex<Vec<KnownUnit>>,
}

/// The name of a unit type, its keys in the scenario file, and its file.
type KnownUnit = (String, Vec<String>, PathBuf);

impl Target {
    fn new(path: &Path) -> Result<Target, TargetError> {
        let parent = match path.parent() {
            Some(parent) if parent != Path::new("") => parent,
            _ => Path::new("."),
        };
        let folder = parent.canonicalize().map_err(|error| TargetError::Io(shown_path(parent), error))?;
        Ok(Target { path: path.into(), folder, units: Mutex::default() })
    }

    /// The file and its unit files, and their checksums; none if it does not exist.
    fn read(&self) -> Result<Option<(ScenarioFiles, Base)>, TargetError> {
        if !self.path.exists() {
            return Ok(None);
        }
        let (files, paths) = ScenarioFiles::open(&self.path)?;
        let mut base = Base::from([entry(&self.path, &files.text)]);
        base.extend(files.unit_files.iter().zip(&paths).map(|(unit, path)| entry(path, &unit.text)));
        *self.units.lock().unwrap_or_else(PoisonError::into_inner) = (files.unit_files.iter().zip(paths))
            .map(|(unit, path)| (unit.name.clone(), unit.keys.clone(), path))
            .collect();
        Ok(Some((files, base)))
    }

    fn save(&self, SaveFiles { files, mut base, replace }: SaveFiles) -> Result<SavedFiles, TargetError> {
        // Until all is written: two pages that save at the same time do so one after the other.
        let units = self.units.lock().unwrap_or_else(PoisonError::into_inner);
        let writes = self.writes(&units, &files)?;
        let mut conflicts = Vec::new();
        let mut changed = Vec::new();
        for (path, text, max) in writes {
            let file = shown_path(&path);
            if text.len() as u64 > max {
                return Err(TargetError::TooLarge { file, bytes: text.len(), max });
            }
            let on_disk = if path.exists() { Some(read(&path, max)?) } else { None };
            let (key, checksum) = entry(&path, text);
            let before = base.insert(key, checksum);
            if on_disk.as_ref() == Some(text) {
                continue;
            }
            if path != self.path {
                self.check_inside(&path)?;
            }
            if on_disk.is_some_and(|text| Some(entry(&path, &text).1) != before) {
                conflicts.push(file);
            }
            changed.push((path, text));
        }
        if !conflicts.is_empty() && !replace {
            return Ok(SavedFiles::Conflicts(conflicts));
        }
        let mut saved = Vec::new();
        for (path, text) in changed {
            write_text(&path, text).map_err(|error| TargetError::Io(shown_path(&path), error))?;
            saved.push(shown_path(&path));
        }
        Ok(SavedFiles::Saved { files: saved, base })
    }

    /// What is to be written: path, text, and the most bytes that it may have.
    fn writes<'a>(
        &self,
        known: &[KnownUnit],
        files: &'a ScenarioFiles,
    ) -> Result<Vec<(PathBuf, &'a String, u64)>, TargetError> {
        let mut writes: Vec<(PathBuf, &String, u64)> = Vec::new();
        let scenario: Option<Value> = serde_json::from_str(&files.text).ok();
        for unit in &files.unit_files {
            let path = self.unit_path(known, unit, scenario.as_ref())?;
            let others = writes.iter().map(|(path, ..)| path).chain([&self.path]);
            if others.map(|other| identity(other)).any(|other| other == identity(&path)) {
                return Err(TargetError::SameFile { unit: unit.name.clone(), file: shown_path(&path) });
            }
            writes.push((path, &unit.text, MAX_UNIT_BYTES));
        }
        // The scenario file is the last one: it never names a unit file that is not there yet.
        writes.push((self.path.clone(), &files.text, MAX_SCENARIO_BYTES));
        Ok(writes)
    }

    /// Where a scenario finds the unit file. A scenario that is no JSON names no folder: then where the unit
    /// file was read.
    fn unit_path(
        &self,
        known: &[KnownUnit],
        unit: &UnitFile,
        scenario: Option<&Value>,
    ) -> Result<PathBuf, TargetError> {
        let is_same = |(name, keys, _): &&KnownUnit| {
            *name == unit.name && unit.keys.iter().any(|key| keys.contains(key))
        };
        let read = known.iter().find(is_same).map(|(.., path)| path);
        if let (None, Some(path)) = (scenario, read) {
            return Ok(path.clone());
        }
        let custom = scenario.and_then(|scenario| scenario["custom_unit_path"].as_str()).map(Path::new);
        let key = unit.keys.first().unwrap_or(&unit.name);
        let candidates = unit_file_candidates(&self.folder, custom, key);
        let found = candidates.iter().find(|path| path.is_file()).and_then(|path| path.canonicalize().ok());
        // A file elsewhere is another scenario's, unless it was read: the first candidate comes before it.
        match found.filter(|path| path.starts_with(&self.folder) || Some(path) == read) {
            Some(path) => Ok(path),
            None => self.new_unit_path(&unit.name, custom.unwrap_or(Path::new("")), &candidates[0]),
        }
    }

    /// Where a unit type without a file gets one: where the scenario looks first.
    fn new_unit_path(&self, name: &str, custom: &Path, path: &Path) -> Result<PathBuf, TargetError> {
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "_-.".contains(c);
        if !(1..=100).contains(&name.len()) || name.starts_with('.') || !name.chars().all(is_plain) {
            return Err(TargetError::UnitName(name.to_owned()));
        }
        let stays = |part: Component| matches!(part, Component::Normal(_) | Component::CurDir);
        let folder = path.parent().unwrap_or(path);
        let below = folder.strip_prefix(&self.folder);
        // An absolute path may lead to this folder too.
        if !below.is_ok_and(|below| below.components().all(stays))
            && !folder.canonicalize().is_ok_and(|f| f.starts_with(&self.folder))
        {
            return Err(TargetError::Outside(shown_path(custom)));
        }
        Ok(path.to_owned())
    }

    /// Follows symbolic links: the file itself, or the nearest folder above it that exists, must be in the
    /// scenario's folder.
    fn check_inside(&self, path: &Path) -> Result<(), TargetError> {
        let existing = path.ancestors().find_map(|ancestor| ancestor.canonicalize().ok());
        match existing {
            Some(existing) if existing.starts_with(&self.folder) => Ok(()),
            _ => Err(TargetError::Outside(shown_path(path))),
        }
    }
}

/// A file as a page knows it. The checksum is the same in every run.
fn entry(path: &Path, text: &str) -> (String, String) {
    let mut checksum = Fnv1a::default();
    checksum.write(text.as_bytes());
    (shown_path(path), format!("{:016x}", checksum.finish()))
}

/// The same for every path of a file, which need not exist.
fn identity(path: &Path) -> PathBuf {
    let in_folder = || {
        let parent = path.parent().filter(|parent| *parent != Path::new("")).unwrap_or(Path::new("."));
        Some(parent.canonicalize().ok()?.join(path.file_name()?))
    };
    path.canonicalize().ok().or_else(in_folder).unwrap_or_else(|| path.to_owned())
}

fn read(path: &Path, max_bytes: u64) -> Result<String, Problems> {
    let report = Report::default();
    let text = read_text(path, max_bytes, &report);
    report.finish(text)
}

/// Writes a file whole or not at all, in a folder that may be new.
fn write_text(path: &Path, text: &str) -> std::io::Result<()> {
    let folder = path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder)?;
    write_whole(path, |output| output.write_all(text.as_bytes()))
}

#[cfg(test)]
mod tests;
