//! The problems of files, and the report that collects them while files are read.
//!
//! A reader that finds a problem adds it to the [`Report`] and gets a [`Reported`] in return, its error. So a
//! reader can go on with the other values, and an error can never be without a message.

use serde::Serialize;
use std::cell::{Cell, RefCell};
use std::fmt;

/// The largest number of problems that are kept; of further ones only the number is.
const MAX_PROBLEMS: usize = 100;

/// Something that is wrong with a file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Problem {
    /// The file as it was named.
    pub file: String,
    /// Line of the mistake, from 1; none if the file could not be read.
    pub line: Option<usize>,
    /// Column of the mistake in characters, from 1; none if the file could not be read.
    pub column: Option<usize>,
    /// Path of the key, as in `groups[1].units.MARINE`; empty for the file's whole content.
    pub path: String,
    /// One line: the key, the value and what is accepted.
    pub message: String,
}

/// `FILE:LINE:COLUMN: message`, the form in which editors and terminals make a link.
impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.file)?;
        for number in [self.line, self.column].into_iter().flatten() {
            write!(f, ":{number}")?;
        }
        write!(f, ": {}", self.message)
    }
}

/// Why a file was refused: all problems of the file, and of the files that it names. There is at least one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problems {
    found: Vec<Problem>,
    n_problems: usize,
}

impl Problems {
    /// The first 100 problems that were found, file by file, in the order of the files' lines.
    pub fn list(&self) -> &[Problem] {
        &self.found
    }

    /// The same without lines and columns in this file.
    #[must_use]
    pub fn without_places(mut self, file: &str) -> Problems {
        for problem in self.found.iter_mut().filter(|problem| problem.file == file) {
            (problem.line, problem.column) = (None, None);
        }
        self
    }

    /// The number of all problems, also of those that are not in the list.
    pub fn n_problems(&self) -> usize {
        self.n_problems
    }
}

/// One line per problem; a last line says how many are not in the list.
impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, problem) in self.found.iter().enumerate() {
            write!(f, "{}{problem}", if i > 0 { "\n" } else { "" })?;
        }
        match self.n_problems - self.found.len() {
            0 => Ok(()),
            more => write!(f, "\n{}: and {more} more problems", self.found[0].file),
        }
    }
}

impl std::error::Error for Problems {}

/// The error of a reader that has added at least one problem to the [`Report`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reported(());

/// Collects the problems of the files that are read together.
#[derive(Debug, Default)]
pub struct Report {
    found: RefCell<Vec<Problem>>,
    n_problems: Cell<usize>,
    /// The files, in the order in which they were read.
    files: RefCell<Vec<String>>,
}

impl Report {
    /// Notes that `file` is read now: its problems are listed before those of files that are read later.
    pub(super) fn note_file(&self, file: &str) {
        let mut files = self.files.borrow_mut();
        if !files.iter().any(|known| known == file) {
            files.push(file.into());
        }
    }

    /// Adds a problem.
    pub fn add(&self, problem: impl FnOnce() -> Problem) -> Reported {
        let mut found = self.found.borrow_mut();
        if found.len() < MAX_PROBLEMS {
            found.push(problem());
        }
        self.n_problems.set(self.n_problems.get() + 1);
        Reported(())
    }

    /// Adds the problem that `file` cannot be read.
    pub fn add_unreadable(&self, file: String, reason: impl fmt::Display) -> Reported {
        self.note_file(&file);
        let message = format!("cannot be read: {reason}");
        self.add(|| Problem { file, line: None, column: None, path: String::new(), message })
    }

    /// The value that was read, if there were no problems.
    ///
    /// # Errors
    /// [`Problems`] if there were any, whatever `value` is.
    pub fn finish<T>(self, value: Result<T, Reported>) -> Result<T, Problems> {
        let (mut found, n_problems) = (self.found.into_inner(), self.n_problems.get());
        match value {
            Ok(value) if n_problems == 0 => Ok(value),
            _ => {
                let files = self.files.into_inner();
                let file_index = |problem: &Problem| files.iter().position(|file| *file == problem.file);
                found.sort_by_key(|problem| (file_index(problem), problem.line, problem.column));
                Err(Problems { found, n_problems })
            }
        }
    }
}
