//! The reader of unit files: which keys there are, their defaults, and what is refused.

use crate::file::{Json, read_text};
use crate::{UnitError, UnitType};
use std::path::Path;

impl UnitType {
    /// Reads a unit file's text. `name` becomes the type's name; `source` is what error messages call the file.
    ///
    /// # Errors
    /// [`UnitError`] for the first thing that is wrong: see the README's table of keys.
    pub fn from_json(text: &str, name: &str, source: &str) -> Result<UnitType, UnitError> {
        let _ = (Json::parse(text, source)?, name);
        unimplemented!()
    }

    /// Reads a unit file; the type is named after the file's stem.
    ///
    /// # Errors
    /// As [`from_json`](Self::from_json), and for a file that cannot be read.
    pub fn load(path: &Path) -> Result<UnitType, UnitError> {
        let name = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        UnitType::from_json(&read_text(path)?, &name, &path.display().to_string())
    }
}
