//! A value together with its place in the file, so that every complaint can say where it is.

use super::error::nearest;
use super::{FileError, Json, did_you_mean, shortened};
use crate::Word;

/// The range a number must lie in; `above` excludes `from` itself.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Lower end.
    pub from: f64,
    /// Upper end, included.
    pub to: f64,
    /// Whether `from` itself is excluded.
    pub above: bool,
}

impl Limits {
    /// `from..=to`.
    pub const fn from_to(from: f64, to: f64) -> Limits {
        Limits { from, to, above: false }
    }

    /// More than `from`, at most `to`.
    pub const fn above_to(from: f64, to: f64) -> Limits {
        Limits { from, to, above: true }
    }

    fn contains(&self, value: f64) -> bool {
        value <= self.to && if self.above { value > self.from } else { value >= self.from }
    }

    /// The limits in words: `a number from 0 to 10`, `a number above 0 and at most 10`.
    pub fn expected(&self) -> String {
        let from = if self.above { "above" } else { "from" };
        let to = if self.above { "and at most" } else { "to" };
        format!("a number {from} {} {to} {}", self.from, self.to)
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

    /// The complaint that this value is not what it should be.
    pub fn invalid(&self, expected: impl Into<String>) -> FileError {
        FileError::Invalid {
            file: self.file.into(),
            key: self.key.clone(),
            value: self.json.to_string(),
            expected: expected.into(),
        }
    }

    /// The complaint that this value is at odds with others: what it does, in words.
    pub fn conflict(&self, conflict: String) -> FileError {
        FileError::Conflict { file: self.file.into(), key: self.key.clone(), conflict }
    }

    /// A number within `limits`.
    pub fn number(&self, limits: Limits) -> Result<f64, FileError> {
        match self.json {
            Json::Number(value) if limits.contains(*value) => Ok(*value),
            _ => Err(self.invalid(limits.expected())),
        }
    }

    /// A whole number from `from` to `to`.
    pub fn integer(&self, from: u32, to: u32) -> Result<u32, FileError> {
        match self.json {
            Json::Number(value)
                if value.fract() == 0.0 && Limits::from_to(from.into(), to.into()).contains(*value) =>
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

    /// What this string, one of the words of `T`, stands for.
    pub fn word<T: Word>(&self) -> Result<T, FileError> {
        let text = if let Json::String(text) = self.json { text } else { "" };
        find_word(text).ok_or_else(|| {
            let words = words::<T>();
            let hint = nearest(text, &words).map(|word| format!("; did you mean `{word}`?"));
            self.invalid(format!("one of {}{}", words.join(", "), hint.unwrap_or_default()))
        })
    }

    /// What `name`, the key of this entry and one of the words of `T`, stands for.
    pub fn key_word<T: Word>(&self, name: &str) -> Result<T, FileError> {
        find_word(name).ok_or_else(|| self.unknown_key(name, words::<T>()))
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

    /// The value of a key that must be there; `expected` tells a reader what to write.
    pub fn require(&self, key: &str, expected: &str) -> Result<Node<'a>, FileError> {
        self.get(key).ok_or_else(|| self.missing(key, expected))
    }

    /// The complaint that `key` is not there.
    pub fn missing(&self, key: &str, expected: &str) -> FileError {
        let prefix = if self.node.key.is_empty() { String::new() } else { format!("{}.", self.node.key) };
        FileError::Missing {
            file: self.node.file.into(),
            key: format!("{prefix}{key}"),
            expected: expected.into(),
        }
    }
}

fn words<T: Word>() -> Vec<&'static str> {
    T::WORDS.iter().map(|(word, _)| *word).collect()
}

fn find_word<T: Word>(text: &str) -> Option<T> {
    T::WORDS.iter().find(|(word, _)| *word == text).map(|(_, value)| *value)
}
