//! A JSON value and its path in the file, so that every problem can say where the mistake is. Methods that
//! return a `Result` have told the report what is wrong when they fail.
#![allow(clippy::missing_errors_doc)]

mod scalar;

pub use scalar::Scalar;

use super::hint::nearest;
use super::json::{Entry, Json, Source, Value};
use super::{AnyKey, Key, Kind, Presence, Range, Report, Reported, did_you_mean, shortened};
use crate::Keyword;

/// The content of a file.
#[derive(Debug)]
pub struct Document<'a> {
    source: Source<'a>,
    root: Json,
}

impl<'a> Document<'a> {
    /// Reads one JSON value from `text`; `file` is what problems call it, and `report` gets them.
    ///
    /// # Errors
    /// [`Reported`] if the text is not JSON.
    pub fn parse(text: &'a str, file: &'a str, report: &'a Report) -> Result<Document<'a>, Reported> {
        let source = Source::new(text, file, report);
        Ok(Document { root: source.parse()?, source })
    }

    /// The whole content.
    pub fn root(&self) -> Node<'_> {
        Node { source: &self.source, path: String::new(), key_at: self.root.at, json: &self.root }
    }
}

/// A value of a file and the path of keys that leads to it.
///
/// The methods that return an error have added the problem to the report.
#[derive(Clone, Debug)]
pub struct Node<'a> {
    source: &'a Source<'a>,
    path: String,
    /// Where the key of this entry is; of a value without a key, where the value is.
    key_at: usize,
    json: &'a Json,
}

impl<'a> Node<'a> {
    /// Path of the value in its file, as in `groups[1].units.MARINE`.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// Adds the problem that this value is not what it must be.
    pub fn invalid(&self, expected: &str) -> Reported {
        let subject = match self.path.as_str() {
            "" => "the whole file".into(),
            path => format!("`{path}`"),
        };
        let message = format!("{subject} is {}, but must be {expected}", self.json.value);
        self.source.problem(self.json.at, &self.path, message)
    }

    /// Adds the problem that this value contradicts others; `conflict` completes a sentence that begins with
    /// the key.
    pub fn conflict(&self, conflict: &str) -> Reported {
        self.source.problem(self.json.at, &self.path, format!("`{}` {conflict}", self.path))
    }

    /// Adds the problem that the key of this entry is wrong; `conflict` completes a sentence that begins with
    /// the key.
    pub fn wrong_key(&self, conflict: &str) -> Reported {
        self.source.problem(self.key_at, &self.path, format!("`{}` {conflict}", self.path))
    }

    /// Adds the problem that this object has no key `name`; `expected` says what its value must be.
    pub fn missing(&self, name: &str, expected: &str) -> Reported {
        let path = self.path_of(name);
        let message = format!("`{path}` is missing; it must be {expected}");
        self.source.problem(self.json.at, &path, message)
    }

    /// A number within `range`.
    pub fn number(&self, range: Range) -> Result<f64, Reported> {
        self.number_or(range, &range.expected())
    }

    /// A number within `range`; the problem of other values is that they must be `expected`.
    pub fn number_or(&self, range: Range, expected: &str) -> Result<f64, Reported> {
        match self.json.value {
            Value::Number(value) if range.contains(value) => Ok(value),
            _ => Err(self.invalid(expected)),
        }
    }

    /// A whole number from `from` to `to`.
    pub fn integer(&self, from: u32, to: u32) -> Result<u32, Reported> {
        match self.json.value {
            Value::Number(value)
                if value.fract() == 0.0 && Range::closed(from.into(), to.into()).contains(value) =>
            {
                Ok(value as u32)
            }
            _ => Err(self.invalid(&format!("a whole number from {from} to {to}"))),
        }
    }

    /// The number, if this is a whole one from 0 on.
    pub fn as_whole(&self) -> Option<u32> {
        let Value::Number(value) = self.json.value else { return None };
        (value.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&value)).then_some(value as u32)
    }

    /// `true` or `false`.
    pub fn bool(&self) -> Result<bool, Reported> {
        match self.json.value {
            Value::Bool(value) => Ok(value),
            _ => Err(self.invalid("true or false")),
        }
    }

    /// The text, if this is a string.
    pub fn as_str(&self) -> Option<&'a str> {
        if let Value::String(text) = &self.json.value { Some(text) } else { None }
    }

    /// Whether this is a list.
    pub fn is_list(&self) -> bool {
        matches!(self.json.value, Value::Array(_))
    }

    /// Whether this is an object.
    pub fn is_object(&self) -> bool {
        matches!(self.json.value, Value::Object(_))
    }

    /// A line of text that is not empty and has at most `most` bytes.
    pub fn text(&self, most: usize) -> Result<&'a str, Reported> {
        let is_line = |text: &str| (1..=most).contains(&text.len()) && !text.contains(char::is_control);
        let refused = || self.invalid(&format!("a string of 1 to {most} bytes, on one line"));
        self.as_str().filter(|text| is_line(text)).ok_or_else(refused)
    }

    /// A string that is one of `valid`.
    pub fn one_of(&self, valid: &[&'static str]) -> Result<&'static str, Reported> {
        let text = self.as_str().unwrap_or_default();
        valid.iter().find(|name| **name == text).copied().ok_or_else(|| {
            let hint = nearest(text, valid).map(|name| format!("; did you mean `{name}`?"));
            self.invalid(&format!("one of {}{}", valid.join(", "), hint.unwrap_or_default()))
        })
    }

    /// The value of this string, a keyword of `T`.
    pub fn keyword<T: Keyword>(&self) -> Result<T, Reported> {
        let names: Vec<_> = T::names().collect();
        let name = self.one_of(&names)?;
        T::from_name(name).ok_or_else(|| self.invalid(&format!("one of {}", names.join(", "))))
    }

    /// The value of `name`, which is the key of this entry and a keyword of `T`.
    pub fn key_as_keyword<T: Keyword>(&self, name: &str) -> Result<T, Reported> {
        T::from_name(name).ok_or_else(|| self.unknown_key(name, T::names()))
    }

    /// The items of a list.
    pub fn items(&self) -> Result<Vec<Node<'a>>, Reported> {
        let Value::Array(items) = &self.json.value else {
            return Err(self.invalid("a list"));
        };
        let node = |(i, json): (usize, &'a Json)| {
            let path = format!("{}[{i}]", self.path);
            Node { source: self.source, path, key_at: json.at, json }
        };
        Ok(items.iter().enumerate().map(node).collect())
    }

    /// The entries of an object whose keys are free, in file order.
    pub fn entries(&self) -> Result<Vec<(&'a str, Node<'a>)>, Reported> {
        let Value::Object(entries) = &self.json.value else {
            return Err(self.invalid("an object, { ... }"));
        };
        Ok(entries.iter().map(|entry| (entry.key.as_str(), self.child(entry))).collect())
    }

    /// An object that may have these keys. Others are added to the report, and the rest can be read.
    pub fn object(&self, known: &[&dyn AnyKey]) -> Result<Object<'a>, Reported> {
        for (key, node) in self.entries()? {
            if !known.iter().any(|known| known.name() == key) {
                node.unknown_key(key, known.iter().map(|known| known.name()));
            }
        }
        Ok(Object { node: self.clone() })
    }

    fn unknown_key<'w>(&self, name: &str, valid: impl IntoIterator<Item = &'w str>) -> Reported {
        let message = format!("unknown key `{}`; {}", self.path, did_you_mean(name, valid));
        self.source.problem(self.key_at, &self.path, message)
    }

    fn child(&self, entry: &'a Entry) -> Node<'a> {
        let path = self.path_of(&entry.key);
        Node { source: self.source, path, key_at: entry.key_at, json: &entry.json }
    }

    fn path_of(&self, key: &str) -> String {
        let key = shortened(key);
        if self.path.is_empty() { key } else { format!("{}.{key}", self.path) }
    }
}

/// An object whose keys have been checked against those that its format knows.
#[derive(Clone, Debug)]
pub struct Object<'a> {
    node: Node<'a>,
}

impl<'a> Object<'a> {
    /// The value of a key, if it is there.
    pub fn get<K: Kind>(&self, key: &Key<K>) -> Option<Node<'a>> {
        let Value::Object(entries) = &self.node.json.value else { return None };
        entries.iter().find(|entry| entry.key == key.name).map(|entry| self.node.child(entry))
    }

    /// The value of a key that must be there.
    pub fn require<K: Kind>(&self, key: &Key<K>) -> Result<Node<'a>, Reported> {
        self.get(key).ok_or_else(|| self.missing(key.name, &key.expected()))
    }

    /// Reads a key that is required or has a default.
    pub fn read<K: Scalar>(&self, key: &Key<K>) -> Result<K::Value, Reported> {
        match (self.get(key), &key.presence) {
            (None, Presence::Default(value)) => Ok(value.clone()),
            _ => key.kind.read(&self.require(key)?),
        }
    }

    /// Reads a key that may be left out.
    pub fn read_optional<K: Scalar>(&self, key: &Key<K>) -> Result<Option<K::Value>, Reported> {
        self.get(key).map(|node| key.kind.read(&node)).transpose()
    }

    /// Adds the problem that `name` is missing; `expected` says what its value must be.
    pub fn missing(&self, name: &str, expected: &str) -> Reported {
        self.node.missing(name, expected)
    }
}
