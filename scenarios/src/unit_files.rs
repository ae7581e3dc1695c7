//! The search for the unit type that a scenario file names: a standard type, or a file in one of a few
//! folders.

use serde::{Deserialize, Serialize};
use smaclite_units::UnitType;
use smaclite_units::file::{MAX_UNIT_BYTES, Node, Report, Reported, did_you_mean, read_text, shown_path};
use std::cell::RefCell;
use std::fmt;
use std::path::{Path, PathBuf};

/// The standard type that the published environment lacks. Scenarios for that environment define it in a
/// file, so a file of this name has priority.
const ADDED: &str = "HYDRALISK";

/// Whether a unit file of this name has priority over the standard type.
pub fn is_replaceable(standard_type: &str) -> bool {
    standard_type == ADDED
}

/// The text of a unit file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct UnitFile {
    /// The name of the unit type: the stem of the file.
    pub name: String,
    /// The keys of the scenario file that refer to the file.
    pub keys: Vec<String>,
    /// Its text; empty if only `unit_type_ids` refers to the file, which then is not read.
    pub text: String,
}

/// The identity of a unit type: two names of one file are one type.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum UnitSource {
    Standard(String),
    File(PathBuf),
    /// Of [`Origin::Texts`].
    Text {
        index: usize,
        name: String,
    },
}

impl fmt::Display for UnitSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            UnitSource::Standard(name) => f.write_str(name),
            UnitSource::File(path) => f.write_str(&shown_path(path)),
            UnitSource::Text { name, .. } => write!(f, "{name}.json"),
        }
    }
}

/// Where the unit files of a scenario come from.
#[derive(Clone, Copy)]
pub(crate) enum Origin<'a> {
    /// The folder that contains the scenario file, and those that [`UnitFiles::candidates`] adds.
    Folder(&'a Path),
    /// Texts in memory.
    Texts(&'a [UnitFile]),
}

/// Where a scenario's unit files are searched.
pub(crate) struct UnitFiles<'a> {
    origin: Origin<'a>,
    custom_unit_path: Result<Option<PathBuf>, Reported>,
    report: &'a Report,
    /// What was found in folders so far, by path.
    found: RefCell<Vec<(PathBuf, UnitFile)>>,
}

impl<'a> UnitFiles<'a> {
    pub(crate) fn new(
        origin: Origin<'a>,
        custom_unit_path: Result<Option<String>, Reported>,
        report: &'a Report,
    ) -> Self {
        let custom_unit_path = custom_unit_path.map(|path| path.map(PathBuf::from));
        UnitFiles { origin, custom_unit_path, report, found: RefCell::default() }
    }

    /// The unit files that were found in folders.
    pub(crate) fn into_found(self) -> Vec<UnitFile> {
        self.into_found_at().into_iter().map(|(_, file)| file).collect()
    }

    /// The unit files that were found in folders, and where.
    pub(crate) fn into_found_at(self) -> Vec<(PathBuf, UnitFile)> {
        self.found.into_inner()
    }

    /// The unit type that `name`, the key of entry `node`, refers to. Standard names have priority, except
    /// those that are replaceable.
    pub(crate) fn find(&self, name: &str, node: &Node) -> Result<UnitSource, Reported> {
        let is_standard = UnitType::standard_names().any(|standard| standard == name);
        if is_standard && !is_replaceable(name) {
            return Ok(UnitSource::Standard(name.into()));
        }
        if let Origin::Texts(files) = self.origin
            && let Some(index) = files.iter().position(|file| file.keys.iter().any(|key| key == name))
        {
            return Ok(UnitSource::Text { index, name: files[index].name.clone() });
        }
        let candidates = self.candidates(name)?;
        if let Some(path) = candidates.iter().find(|path| path.is_file()) {
            // Canonical, so that two names of one file are equal.
            let path = path.canonicalize().unwrap_or_else(|_| path.clone());
            self.note_key(&path, name);
            return Ok(UnitSource::File(path));
        }
        if is_standard {
            return Ok(UnitSource::Standard(name.into()));
        }
        let tried: Vec<_> = match self.origin {
            Origin::Texts(files) => files.iter().map(|file| format!("{}.json", file.name)).collect(),
            Origin::Folder(_) => candidates.iter().map(|path| shown_path(path)).collect(),
        };
        let tried = if tried.is_empty() {
            "no unit file came with the scenario".to_owned()
        } else {
            format!("tried {}", tried.join(", "))
        };
        let hint = did_you_mean(name, UnitType::standard_names());
        let conflict = format!("is neither a standard unit type nor a unit file ({tried}); {hint}");
        Err(node.wrong_key(&conflict))
    }

    /// Reads the type of `source`, which entry `node` of the scenario names.
    pub(crate) fn load(&self, source: &UnitSource, node: &Node) -> Result<UnitType, Reported> {
        let loaded = match source {
            UnitSource::Standard(name) => {
                return UnitType::standard(name).ok_or_else(|| node.invalid("a standard type"));
            }
            UnitSource::File(path) => self.load_file(path),
            UnitSource::Text { index, .. } => {
                let Origin::Texts(files) = self.origin else {
                    return Err(node.invalid("a standard type"));
                };
                let UnitFile { name, text, .. } = &files[*index];
                UnitType::read(text, name, &source.to_string(), self.report)
            }
        };
        // A problem of the scenario too: it says why the unit file was read.
        loaded.inspect_err(|_| {
            node.wrong_key(&format!("refers to an invalid unit file, {source}"));
        })
    }

    fn note_key(&self, path: &Path, key: &str) {
        let mut found = self.found.borrow_mut();
        let known = found.iter().position(|(known, _)| known == path);
        let index = known.unwrap_or_else(|| {
            let name = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
            found.push((path.into(), UnitFile { name, keys: Vec::new(), text: String::new() }));
            found.len() - 1
        });
        let keys = &mut found[index].1.keys;
        if !keys.iter().any(|known| known == key) {
            keys.push(key.into());
        }
    }

    /// Reads a file that [`find`](Self::find) found.
    fn load_file(&self, path: &Path) -> Result<UnitType, Reported> {
        let text = read_text(path, MAX_UNIT_BYTES, self.report)?;
        let mut found = self.found.borrow_mut();
        let file = found.iter_mut().find(|(known, _)| known == path).map(|(_, file)| file);
        let name = file.as_ref().map_or_else(String::new, |file| file.name.clone());
        let unit_type = UnitType::read(&text, &name, &shown_path(path), self.report);
        if let Some(file) = file {
            file.text = text;
        }
        unit_type
    }

    /// The paths that `name` may refer to.
    ///
    /// # Errors
    /// The one of `custom_unit_path`: without it, a file could be found in the wrong folder.
    fn candidates(&self, name: &str) -> Result<Vec<PathBuf>, Reported> {
        let Origin::Folder(base_dir) = self.origin else {
            return Ok(Vec::new());
        };
        let custom = self.custom_unit_path.as_ref().map_err(|reported| *reported)?;
        Ok(unit_file_candidates(base_dir, custom.as_deref(), name))
    }
}

/// The paths of the unit file that `key` of a scenario file may mean, by descending priority: in its
/// `custom_unit_path`, which is itself relative to the folder of the scenario file or to the working
/// directory, then in that folder, then in the working directory.
pub fn unit_file_candidates(folder: &Path, custom_unit_path: Option<&Path>, key: &str) -> Vec<PathBuf> {
    let name = if key.ends_with(".json") { key.to_owned() } else { format!("{key}.json") };
    let mut candidates = Vec::new();
    if let Some(custom) = custom_unit_path {
        candidates.push(folder.join(custom).join(&name));
        candidates.push(custom.join(&name));
    }
    candidates.push(folder.join(&name));
    candidates.push(PathBuf::from(name));
    // Adjacent paths are equal for absolute paths and for a scenario file in the working directory.
    candidates.dedup();
    candidates
}
