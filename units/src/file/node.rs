//! A JSON value and its path in the file, so that every error can say where the mistake is.

use super::error::nearest;
use super::{FileError, Json, did_you_mean, shortened};
use crate::Keyword;

/// The range that a number must lie in.
#[derive(Clone, Copy, Debug)]
pub struct Range {
    low: f64,
    high: f64,
    /// Whether `low` itself is outside.
    is_left_open: bool,
}

impl Range {
    /// `[low, high]`: both ends are inside.
    pub const fn closed(low: f64, high: f64) -> Range {
        Range { low, high, is_left_open: false }
    }

    /// `(low, high]`: `low` is outside, `high` inside.
    pub const fn left_open(low: f64, high: f64) -> Range {
        Range { low, high, is_left_open: true }
    }

    fn contains(&self, value: f64) -> bool {
        value <= self.high && if self.is_left_open { value > self.low } else { value >= self.low }
    }

    /// The range in words: `a number from 0 to 10`, `a number above 0 and at most 10`.
    pub fn expected(&self) -> String {
        let Range { low, high, .. } = self;
        if self.is_left_open {
            format!("a number above {low} and at most {high}")
        } else {
            format!("a number from {low} to {high}")
        }
    }
}

/// A value of a file and the path of keys that leads to it.
#[derive(Clone, Debug)]
pub struct Node<'a> {
    file: &'a str,
    key: String,
    json: &'a Json,
}

impl<'a> Node<'a> {
    /// The whole of a file's content.
    pub fn root(file: &'a str, json: &'a Json) -> Node<'a> {
        Node { file, key: String::new(), json }
    }

    /// Path of the value in its file, as in `groups[1].units.MARINE`.
    pub fn key(&self) -> &str {
        &self.key
    }

    /// The value itself.
    pub fn json(&self) -> &'a Json {
        self.json
    }

    /// The error that this value is not what it must be.
    pub fn invalid(&self, expected: impl Into<String>) -> FileError {
        FileError::Invalid {
            file: self.file.into(),
            key: self.key.clone(),
            value: self.json.to_string(),
            expected: expected.into(),
        }
    }

    /// The error that this value contradicts others; `conflict` completes a sentence that begins with the
    /// key.
    pub fn conflict(&self, conflict: String) -> FileError {
        FileError::Conflict { file: self.file.into(), key: self.key.clone(), conflict }
    }

    /// A number within `range`.
    pub fn number(&self, range: Range) -> Result<f64, FileError> {
        match self.json {
            Json::Number(value) if range.contains(*value) => Ok(*value),
            _ => Err(self.invalid(range.expected())),
        }
    }

    /// A whole number from `from` to `to`.
    pub fn integer(&self, from: u32, to: u32) -> Result<u32, FileError> {
        match self.json {
            Json::Number(value)
                if value.fract() == 0.0 && Range::closed(from.into(), to.into()).contains(*value) =>
            {
                Ok(*value as u32)
            }
            _ => Err(self.invalid(format!("a whole number from {from} to {to}"))),
        }
    }

    /// `true` or `false`.
    pub fn bool(&self) -> Result<bool, FileError> {
        match self.json {
            Json::Bool(value) => Ok(*value),
            _ => Err(self.invalid("true or false")),
        }
    }

    /// A line of text that is not empty and has at most `most` bytes.
    pub fn text(&self, most: usize) -> Result<&'a str, FileError> {
        match self.json {
            Json::String(value) if (1..=most).contains(&value.len()) && !value.contains(char::is_control) => {
                Ok(value)
            }
            _ => Err(self.invalid(format!("a string of 1 to {most} bytes, on one line"))),
        }
    }

    /// A string that is one of `valid`.
    pub fn one_of(&self, valid: &[&'static str]) -> Result<&'static str, FileError> {
        let text = if let Json::String(text) = self.json { text } else { "" };
        valid.iter().find(|name| **name == text).copied().ok_or_else(|| {
            let hint = nearest(text, valid).map(|name| format!("; did you mean `{name}`?"));
            self.invalid(format!("one of {}{}", valid.join(", "), hint.unwrap_or_default()))
        })
    }

    /// The value of this string, a keyword of `T`.
    pub fn keyword<T: Keyword>(&self) -> Result<T, FileError> {
        let names: Vec<_> = T::names().collect();
        let name = self.one_of(&names)?;
        T::from_name(name).ok_or_else(|| self.invalid(format!("one of {}", names.join(", "))))
    }

    /// The value of `name`, which is the key of this entry and a keyword of `T`.
    pub fn key_as_keyword<T: Keyword>(&self, name: &str) -> Result<T, FileError> {
        T::from_name(name).ok_or_else(|| self.unknown_key(name, T::names()))
    }

    /// The items of a list.
    pub fn items(&self) -> Result<Vec<Node<'a>>, FileError> {
        let Json::Array(items) = self.json else {
            return Err(self.invalid("a list"));
        };
        let node = |(i, json)| Node { file: self.file, key: format!("{}[{i}]", self.key), json };
        Ok(items.iter().enumerate().map(node).collect())
    }

    /// The entries of an object whose keys are free, in file order.
    pub fn entries(&self) -> Result<Vec<(&'a str, Node<'a>)>, FileError> {
        let Json::Object(entries) = self.json else {
            return Err(self.invalid("an object, { ... }"));
        };
        Ok(entries.iter().map(|(key, json)| (key.as_str(), self.child(key, json))).collect())
    }

    /// An object that may have these keys and no others.
    pub fn object(&self, known: &[&str]) -> Result<Object<'a>, FileError> {
        for (key, node) in self.entries()? {
            if !known.contains(&key) {
                return Err(node.unknown_key(key, known.iter().copied()));
            }
        }
        Ok(Object { node: self.clone() })
    }

    fn unknown_key<'w>(&self, name: &str, valid: impl IntoIterator<Item = &'w str>) -> FileError {
        let hint = did_you_mean(name, valid);
        FileError::UnknownKey { file: self.file.into(), key: self.key.clone(), hint }
    }

    fn child(&self, key: &str, json: &'a Json) -> Node<'a> {
        let key = shortened(key);
        let path = if self.key.is_empty() { key } else { format!("{}.{key}", self.key) };
        Node { file: self.file, key: path, json }
    }
}

/// An object whose keys have been checked against those that its format knows.
#[derive(Clone, Debug)]
pub struct Object<'a> {
    node: Node<'a>,
}

impl<'a> Object<'a> {
    /// The value of an optional key.
    pub fn get(&self, key: &str) -> Option<Node<'a>> {
        let Json::Object(entries) = self.node.json else { return None };
        entries.iter().find(|(name, _)| name == key).map(|(name, json)| self.node.child(name, json))
    }

    /// The value of a required key; `expected` says in the error what the value must be.
    pub fn require(&self, key: &str, expected: &str) -> Result<Node<'a>, FileError> {
        self.get(key).ok_or_else(|| self.missing(key, expected))
    }

    /// The error that `key` is missing.
    pub fn missing(&self, key: &str, expected: &str) -> FileError {
        let prefix = if self.node.key.is_empty() { String::new() } else { format!("{}.", self.node.key) };
        FileError::Missing {
            file: self.node.file.into(),
            key: format!("{prefix}{key}"),
            expected: expected.into(),
        }
    }
}
