//! `log.csv`: a header, and one line per update. A value that does not exist yet is empty.

use crate::tensors::{FileError, read_text};
use crate::training::Record;
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// The file, open for appending.
pub(crate) struct CsvLog {
    path: PathBuf,
    file: File,
}

impl CsvLog {
    /// Opens the log of a run that has made `updates` updates, and removes lines after those: they are of
    /// updates that are made again. A process that is killed meanwhile leaves the old file.
    pub fn open(path: &Path, updates: u64) -> Result<CsvLog, FileError> {
        let error = |source| FileError::Write { path: path.to_owned(), source };
        let kept = if updates == 0 { String::new() } else { kept(&read_text(path)?, updates) };
        crate::tensors::write(path, kept.as_bytes())?;
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
                text = columns.iter().map(|(name, _)| &**name).collect::<Vec<_>>().join(",") + "\n" + &text;
            }
            self.file.write_all(text.as_bytes())
        };
        append().map_err(|source| FileError::Write { path: self.path.clone(), source })
    }
}

/// The header and the lines of the first updates.
fn kept(text: &str, updates: u64) -> String {
    let is_kept = |line: &&str| {
        let update = line.split(',').next().and_then(|update| update.parse::<u64>().ok());
        line.ends_with('\n') && update.is_none_or(|update| update <= updates)
    };
    text.split_inclusive('\n').filter(is_kept).collect()
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
        CsvLog::open(&path, 1).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "update,steps\n1,100\n");
        assert_eq!(std::fs::read_to_string(&old).unwrap(), text, "nothing wrote into the old file");
    }
}
