//! `log.csv`: a header, and one line per update. A value that does not exist yet is empty.

use crate::tensors::{FileError, read_text};
use crate::training::Record;
use std::borrow::Cow;
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// The file, open for appending.
pub(crate) struct CsvLog {
    path: PathBuf,
    file: File,
}

impl CsvLog {
    /// Opens the log of a run that continues after these lines, and removes all others. A process that is
    /// killed meanwhile leaves the old file.
    pub fn open(path: &Path, kept: &KeptLines) -> Result<CsvLog, FileError> {
        let error = |source| FileError::Write { path: path.to_owned(), source };
        crate::tensors::write(path, kept.text.as_bytes())?;
        let file = OpenOptions::new().append(true).open(path).map_err(error)?;
        Ok(CsvLog { path: path.to_owned(), file })
    }

    /// Appends a line, after the header if it is the first.
    pub fn append(&mut self, record: &Record) -> Result<(), FileError> {
        let columns = record.columns();
        let text_of = |value: f64| if value.is_nan() { String::new() } else { value.to_string() };
        let line: Vec<String> = columns.iter().map(|(_, value)| text_of(*value)).collect();
        let mut text = line.join(",") + "\n";
        let mut append = || -> io::Result<()> {
            if self.file.metadata()?.len() == 0 {
                text =
                    columns.iter().map(|(name, _)| quoted(name)).collect::<Vec<_>>().join(",") + "\n" + &text;
            }
            self.file.write_all(text.as_bytes())
        };
        append().map_err(|source| FileError::Write { path: self.path.clone(), source })
    }

    /// Waits until the lines are on the disk.
    pub fn sync(&self) -> Result<(), FileError> {
        self.file.sync_data().map_err(|source| FileError::Write { path: self.path.clone(), source })
    }
}

/// A name as a field of the header: those of maps are the users'.
fn quoted(name: &str) -> Cow<'_, str> {
    match name.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", name.replace('"', "\"\"")).into(),
        false => name.into(),
    }
}

/// The header and the lines of the updates that a run has made.
pub(crate) struct KeptLines {
    text: String,
    /// Steps before the last of these updates; `None` if there is none.
    pub steps_before: Option<u64>,
}

impl KeptLines {
    /// Reads the lines of the first `updates` updates. Those after them are of updates that are made again.
    ///
    /// # Errors
    /// If one is missing: each was written before the checkpoint that says that its update was made.
    pub fn read(path: &Path, updates: u64) -> Result<KeptLines, FileError> {
        let Some(before) = updates.checked_sub(1) else {
            return Ok(KeptLines { text: String::new(), steps_before: None });
        };
        let whole = read_text(path)?;
        let mut lines = whole.split_inclusive('\n').filter(|line| line.ends_with('\n'));
        let mut text = lines.next().unwrap_or_default().to_owned();
        let mut steps_before = 0;
        for update in 1..=updates {
            let line = lines.next().unwrap_or_default();
            let mut numbers = line.trim_end().split(',').map(|number| number.parse::<u64>().ok());
            let (Some(Some(of_line)), Some(Some(steps))) = (numbers.next(), numbers.next()) else {
                return Err(missing(path, update, updates));
            };
            if of_line != update {
                return Err(missing(path, update, updates));
            }
            if update == before {
                steps_before = steps;
            }
            text += line;
        }
        Ok(KeptLines { text, steps_before: Some(steps_before) })
    }
}

fn missing(path: &Path, update: u64, updates: u64) -> FileError {
    let why = format!("it has no line of update {update}, but the checkpoint is of {updates} updates");
    FileError::Damaged { path: path.to_owned(), why }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The file was emptied and then written again: a process that was killed in between, or a full disk,
    /// left a log without its beginning.
    #[test]
    fn a_log_that_is_opened_again_is_replaced_by_a_whole_one() {
        let folder = tempfile::tempdir().unwrap();
        let (path, old) = (folder.path().join("log.csv"), folder.path().join("old.csv"));
        let text = "update,steps\n1,100\n2,200\n3,";
        std::fs::write(&path, text).unwrap();
        std::fs::hard_link(&path, &old).unwrap();
        CsvLog::open(&path, &KeptLines::read(&path, 1).unwrap()).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "update,steps\n1,100\n");
        assert_eq!(std::fs::read_to_string(&old).unwrap(), text, "nothing wrote into the old file");
    }

    #[test]
    fn a_line_that_is_missing_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.csv");
        let read = |text: &str, updates| {
            std::fs::write(&path, text).unwrap();
            KeptLines::read(&path, updates)
        };
        let whole = "update,steps\n1,100\n2,200\n3,290\n";
        for (updates, before) in [(0, None), (1, Some(0)), (2, Some(100)), (3, Some(200))] {
            assert_eq!(read(whole, updates).unwrap().steps_before, before);
        }
        for (text, missing) in [
            ("", 1),
            ("update,steps\n", 1),
            ("1,100\n2,200\n3,290\n", 1),
            ("update,steps\n1,100\n3,290\n", 2),
            ("update,steps\n1,100\n2,200\n", 3),
            ("update,steps\n1,100\n2,200\n3,290", 3),
        ] {
            let error = read(text, 3).err().unwrap().to_string();
            let expected = format!("has no line of update {missing}, but the checkpoint is of 3 updates");
            assert!(error.contains("log.csv` is damaged") && error.contains(&expected), "{text:?}: {error}");
        }
    }
}
