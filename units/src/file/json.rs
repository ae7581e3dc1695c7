//! A JSON text as values that know where they are in the text.
//!
//! serde_json reads the text; its `RawValue` is a piece of the text, so that the piece's address is the
//! position. A list or object is read as its pieces, which are then read themselves: every level of nesting
//! is scanned once more, at most [`MAX_DEPTH`] times, and files nest three or four deep.

use super::syntax::{explain, without_position};
use super::{Problem, Report, Reported, shortened};
use serde::Deserializer;
use serde::de::{MapAccess, Visitor};
use serde_json::value::RawValue;
use std::collections::HashSet;
use std::fmt;

/// How deep lists and objects may be nested; it bounds the stack of the reader.
const MAX_DEPTH: usize = 128;

/// A JSON value and its position in its text.
#[derive(Clone, Debug, PartialEq)]
pub struct Json {
    /// Index of the value's first byte.
    pub(super) at: usize,
    pub(super) value: Value,
}

/// Numbers are f64, which holds every integer that a unit or scenario file may use.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Null,
    Bool(bool),
    Number(f64),
    String(String),
    Array(Vec<Json>),
    Object(Vec<Entry>),
}

/// An entry of an object.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Entry {
    pub(super) key: String,
    /// Index of the key's first byte, its quotation mark.
    pub(super) key_at: usize,
    pub(super) json: Json,
}

/// The value as problems show it: on one line; of lists and objects only the size.
impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Value::Null => f.write_str("null"),
            Value::Bool(value) => write!(f, "{value}"),
            // Debug, since Display would write 1e300 and 1e-300 with all of their zeros.
            Value::Number(value) if *value != 0.0 && !(1e-6..1e15).contains(&value.abs()) => {
                write!(f, "{value:?}")
            }
            Value::Number(value) => write!(f, "{value}"),
            Value::String(value) => write!(f, "\"{}\"", shortened(value)),
            Value::Array(items) => write!(f, "a list of length {}", items.len()),
            Value::Object(entries) => write!(f, "an object of size {}", entries.len()),
        }
    }
}

/// A text without the byte order mark with which some editors on Windows start a file, and which no editor
/// counts as a column.
pub fn without_mark(text: &str) -> &str {
    text.strip_prefix('\u{feff}').unwrap_or(text)
}

/// The text of a file and what problems call the file.
#[derive(Debug)]
pub(super) struct Source<'a> {
    pub(super) file: &'a str,
    text: &'a str,
    pub(super) report: &'a Report,
}

impl<'a> Source<'a> {
    pub(super) fn new(text: &'a str, file: &'a str, report: &'a Report) -> Source<'a> {
        report.note_file(file);
        Source { file, text: without_mark(text), report }
    }

    /// Reads the whole text. A duplicate key is a problem, and its first value counts.
    pub(super) fn parse(&self) -> Result<Json, Reported> {
        let raw: &RawValue = serde_json::from_str(self.text).map_err(|error| {
            let at = if error.is_eof() { self.text.len() } else { self.index(error.line(), error.column()) };
            self.problem(at, "", explain(self.text, at, &error))
        })?;
        self.value(raw, MAX_DEPTH)
    }

    /// Adds a problem of the byte at index `at`.
    pub(super) fn problem(&self, at: usize, path: &str, message: String) -> Reported {
        // A closure: to count the lines of a large file takes time, and only the first problems are kept.
        self.report.add(|| {
            let at = (0..=at).rev().find(|&at| self.text.is_char_boundary(at)).unwrap_or(0);
            let before = &self.text[..at];
            let line = before.matches('\n').count() + 1;
            let column = before.rsplit('\n').next().map_or(0, |line| line.chars().count()) + 1;
            let (file, path) = (self.file.into(), path.into());
            Problem { file, line: Some(line), column: Some(column), path, message }
        })
    }

    /// The index of a byte of which serde_json gives the line and the column, in bytes from 1.
    fn index(&self, line: usize, column: usize) -> usize {
        let before: usize = self.text.split_inclusive('\n').take(line - 1).map(str::len).sum();
        (before + column.saturating_sub(1)).min(self.text.len())
    }

    /// The index of a piece of the text.
    fn index_of(&self, piece: &str) -> usize {
        piece.as_ptr() as usize - self.text.as_ptr() as usize
    }

    fn value(&self, raw: &'a RawValue, depth: usize) -> Result<Json, Reported> {
        let (text, at) = (raw.get(), self.index_of(raw.get()));
        let refused = |error: serde_json::Error| self.problem(at, "", without_position(&error));
        let inner_depth = || {
            let message = || format!("lists and objects are nested more than {MAX_DEPTH} deep");
            depth.checked_sub(1).ok_or_else(|| self.problem(at, "", message()))
        };
        let value = match text.as_bytes()[0] {
            b'[' => {
                let depth = inner_depth()?;
                let pieces: Vec<&RawValue> = serde_json::from_str(text).map_err(refused)?;
                Value::Array(pieces.into_iter().map(|raw| self.value(raw, depth)).collect::<Result<_, _>>()?)
            }
            b'{' => {
                let depth = inner_depth()?;
                let pieces = serde_json::Deserializer::from_str(text).deserialize_map(Entries);
                Value::Object(self.entries(pieces.map_err(refused)?, depth)?)
            }
            b'"' => Value::String(serde_json::from_str(text).map_err(refused)?),
            b't' | b'f' => Value::Bool(text == "true"),
            b'n' => Value::Null,
            _ => Value::Number(serde_json::from_str(text).map_err(refused)?),
        };
        Ok(Json { at, value })
    }

    fn entries(&self, pieces: Vec<Piece<'a>>, depth: usize) -> Result<Vec<Entry>, Reported> {
        let mut seen = HashSet::new();
        let mut entries = Vec::new();
        for (raw_key, raw) in pieces {
            let Json { at: key_at, value: Value::String(key) } = self.value(raw_key, 0)? else { continue };
            let json = self.value(raw, depth)?;
            if seen.insert(key.clone()) {
                entries.push(Entry { key, key_at, json });
            } else {
                let key = shortened(&key);
                self.problem(key_at, &key, format!("key `{key}` is duplicate"));
            }
        }
        Ok(entries)
    }
}

/// An entry of an object as pieces of the text.
type Piece<'a> = (&'a RawValue, &'a RawValue);

/// Reads an object as its entries in file order, duplicates too.
struct Entries;

impl<'de> Visitor<'de> for Entries {
    type Value = Vec<Piece<'de>>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Self::Value, A::Error> {
        let mut pieces = Vec::new();
        while let Some(piece) = entries.next_entry()? {
            pieces.push(piece);
        }
        Ok(pieces)
    }
}
