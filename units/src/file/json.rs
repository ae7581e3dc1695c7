//! A JSON value whose objects keep the order of their keys; a duplicate key is an error.

use super::{FileError, shortened};
use serde::de::{Deserialize, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use std::collections::HashSet;
use std::fmt;

/// A JSON value. Numbers are f64, which holds every integer that a unit or scenario file may use.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)] // JSON's own six kinds
pub enum Json {
    Null,
    Bool(bool),
    Number(f64),
    String(String),
    Array(Vec<Json>),
    Object(Vec<(String, Json)>),
}

impl Json {
    /// Reads one JSON value from `text`; `file` is what error messages call it.
    ///
    /// # Errors
    /// [`FileError::Syntax`] with line and column, also for a duplicate key in an object.
    pub fn parse(text: &str, file: &str) -> Result<Json, FileError> {
        // Some editors on Windows start a file with a byte order mark.
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        serde_json::from_str(text).map_err(|error| FileError::Syntax {
            file: file.into(),
            line: error.line(),
            column: error.column(),
            reason: without_position(&error.to_string()),
        })
    }
}

/// serde_json ends its messages with the line and column, which [`FileError::Syntax`] already has.
fn without_position(message: &str) -> String {
    message.rsplit_once(" at line ").map_or(message, |(reason, _)| reason).into()
}

/// The value as error messages show it: on one line; of lists and objects only the size.
impl fmt::Display for Json {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Json::Null => f.write_str("null"),
            Json::Bool(value) => write!(f, "{value}"),
            // Debug, since Display would write 1e300 with all of its zeros.
            Json::Number(value) if value.abs() >= 1e15 => write!(f, "{value:?}"),
            Json::Number(value) => write!(f, "{value}"),
            Json::String(value) => write!(f, "\"{}\"", shortened(value)),
            Json::Array(items) => write!(f, "a list of length {}", items.len()),
            Json::Object(entries) => write!(f, "an object of size {}", entries.len()),
        }
    }
}

impl<'de> Deserialize<'de> for Json {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Json, D::Error> {
        deserializer.deserialize_any(JsonVisitor)
    }
}

struct JsonVisitor;

impl<'de> Visitor<'de> for JsonVisitor {
    type Value = Json;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_unit<E>(self) -> Result<Json, E> {
        Ok(Json::Null)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Json, E> {
        Ok(Json::Bool(value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Json, E> {
        Ok(Json::Number(value as f64))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Json, E> {
        Ok(Json::Number(value as f64))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Json, E> {
        Ok(Json::Number(value))
    }

    fn visit_str<E>(self, value: &str) -> Result<Json, E> {
        Ok(Json::String(value.into()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Json, A::Error> {
        let mut array = Vec::new();
        while let Some(item) = items.next_element()? {
            array.push(item);
        }
        Ok(Json::Array(array))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Json, A::Error> {
        let mut object = Vec::new();
        let mut seen = HashSet::new();
        while let Some((key, value)) = entries.next_entry::<String, Json>()? {
            if !seen.insert(key.clone()) {
                return Err(A::Error::custom(format_args!("key `{}` is duplicate", shortened(&key))));
            }
            object.push((key, value));
        }
        Ok(Json::Object(object))
    }
}
