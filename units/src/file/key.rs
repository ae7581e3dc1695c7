//! The keys of a file's objects, each declared once: the reader and the JSON Schema both use the declaration.
//!
//! A key has a [`Kind`]: what its value can be, in a schema and in the words of problems. A kind that is a
//! [`Scalar`](super::Scalar) is also read by itself; values that depend on others have the kind [`Shape`] and
//! a reader.

use crate::Keyword;
use serde_json::json;
use std::marker::PhantomData;

/// A JSON Schema, or a part of one.
pub type Schema = serde_json::Value;

/// What the value of a key can be.
pub trait Kind {
    /// What the value is read as.
    type Value: Clone;
    /// The schema of the value.
    fn schema(&self) -> Schema;
    /// What the value must be, in the words of problems.
    fn expected(&self) -> String;
    /// A value as the file has it.
    fn to_json(&self, value: &Self::Value) -> serde_json::Value;
}

/// Whether a key must be there.
#[derive(Clone, Copy, Debug)]
pub enum Presence<V> {
    /// It must.
    Required,
    /// It can be left out; what that means is up to the reader.
    Optional,
    /// It can be left out, which means this value.
    Default(V),
}

/// A key of an object.
#[derive(Clone, Copy, Debug)]
pub struct Key<K: Kind> {
    /// The key itself.
    pub name: &'static str,
    /// What its value can be.
    pub kind: K,
    /// Whether it must be there.
    pub presence: Presence<K::Value>,
    /// What the value means and its unit: the description in the schema.
    pub meaning: &'static str,
    /// What it must be if it is missing, where that says more than the kind.
    expected: Option<&'static str>,
}

impl<K: Kind> Key<K> {
    /// A key that must be there.
    pub const fn required(name: &'static str, kind: K, meaning: &'static str) -> Key<K> {
        Key { name, kind, presence: Presence::Required, meaning, expected: None }
    }

    /// A key that must be there; the problem that it is missing says that it must be `expected`.
    pub const fn required_as(
        name: &'static str,
        kind: K,
        expected: &'static str,
        meaning: &'static str,
    ) -> Key<K> {
        Key { name, kind, presence: Presence::Required, meaning, expected: Some(expected) }
    }

    /// A key that can be left out.
    pub const fn optional(name: &'static str, kind: K, meaning: &'static str) -> Key<K> {
        Key { name, kind, presence: Presence::Optional, meaning, expected: None }
    }

    /// A key that can be left out, which means `default`.
    pub const fn with_default(
        name: &'static str,
        kind: K,
        default: K::Value,
        meaning: &'static str,
    ) -> Key<K> {
        Key { name, kind, presence: Presence::Default(default), meaning, expected: None }
    }

    /// What the key must be, in the problem that it is missing.
    pub(super) fn expected(&self) -> String {
        self.expected.map_or_else(|| self.kind.expected(), str::to_owned)
    }
}

/// A key of any kind.
pub trait AnyKey {
    /// The key itself.
    fn name(&self) -> &'static str;
    /// Whether it must be there.
    fn is_required(&self) -> bool;
    /// The schema of its value, with the meaning and the default.
    fn schema(&self) -> Schema;
}

impl<K: Kind> AnyKey for Key<K> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn is_required(&self) -> bool {
        matches!(self.presence, Presence::Required)
    }

    fn schema(&self) -> Schema {
        let mut schema = self.kind.schema();
        schema["description"] = self.meaning.into();
        if let Presence::Default(value) = &self.presence {
            schema["default"] = self.kind.to_json(value);
        }
        schema
    }
}

/// The schema of an object that has these keys and no others.
pub fn object_schema(keys: &[&dyn AnyKey]) -> Schema {
    let properties: serde_json::Map<_, _> =
        keys.iter().map(|key| (key.name().to_owned(), key.schema())).collect();
    let required: Vec<&str> = keys.iter().filter(|key| key.is_required()).map(|key| key.name()).collect();
    json!({
        "type": "object", "properties": properties, "required": required, "additionalProperties": false,
    })
}

/// `$schema`, by which a file names its schema for editors. The readers do not use it.
pub const SCHEMA_KEY: Key<Text> = Key::optional(
    "$schema",
    Text { max_bytes: 4096 },
    "Path or address of this schema, by which an editor finds it; without a meaning for battles.",
);

/// The dialect of all schemas.
pub const SCHEMA_DIALECT: &str = "https://json-schema.org/draft/2020-12/schema";

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

    pub(super) fn contains(&self, value: f64) -> bool {
        value <= self.high && if self.is_left_open { value > self.low } else { value >= self.low }
    }
}

impl Kind for Range {
    type Value = f64;

    fn schema(&self) -> Schema {
        let low = if self.is_left_open { "exclusiveMinimum" } else { "minimum" };
        json!({ "type": "number", low: short(self.low), "maximum": short(self.high) })
    }

    /// `a number from 0 to 10`, `a number above 0 and at most 10`.
    fn expected(&self) -> String {
        let Range { low, high, .. } = self;
        if self.is_left_open {
            format!("a number above {low} and at most {high}")
        } else {
            format!("a number from {low} to {high}")
        }
    }

    fn to_json(&self, value: &f64) -> serde_json::Value {
        short(*value)
    }
}

/// A whole number without a decimal point, as people write it.
fn short(value: f64) -> serde_json::Value {
    if value.fract() == 0.0 && value.abs() < 1e9 { json!(value as i64) } else { json!(value) }
}

/// A whole number from `from` to `to`.
#[derive(Clone, Copy, Debug)]
pub struct Whole {
    /// The smallest value.
    pub from: u32,
    /// The largest value.
    pub to: u32,
}

impl Kind for Whole {
    type Value = u32;

    fn schema(&self) -> Schema {
        json!({ "type": "integer", "minimum": self.from, "maximum": self.to })
    }

    fn expected(&self) -> String {
        format!("a whole number from {} to {}", self.from, self.to)
    }

    fn to_json(&self, value: &u32) -> serde_json::Value {
        json!(value)
    }
}

/// `true` or `false`.
#[derive(Clone, Copy, Debug)]
pub struct Flag;

impl Kind for Flag {
    type Value = bool;

    fn schema(&self) -> Schema {
        json!({ "type": "boolean" })
    }

    fn expected(&self) -> String {
        "true or false".into()
    }

    fn to_json(&self, value: &bool) -> serde_json::Value {
        json!(value)
    }
}

/// A line of text that is not empty.
#[derive(Clone, Copy, Debug)]
pub struct Text {
    /// The largest length in UTF-8.
    pub max_bytes: usize,
}

impl Kind for Text {
    type Value = String;

    fn schema(&self) -> Schema {
        // A schema can only limit the number of characters, and each has at least one byte.
        json!({
            "type": "string", "minLength": 1, "maxLength": self.max_bytes,
            "pattern": r"^[^\u0000-\u001f\u007f-\u009f]*$",
        })
    }

    fn expected(&self) -> String {
        format!("a string of 1 to {} bytes, on one line", self.max_bytes)
    }

    fn to_json(&self, value: &String) -> serde_json::Value {
        json!(value)
    }
}

/// A keyword of `T`.
#[derive(Clone, Copy, Debug)]
pub struct Word<T>(pub PhantomData<T>);

impl<T: Keyword> Kind for Word<T> {
    type Value = T;

    fn schema(&self) -> Schema {
        json!({ "enum": T::names().collect::<Vec<_>>() })
    }

    fn expected(&self) -> String {
        format!("one of {}", T::names().collect::<Vec<_>>().join(", "))
    }

    fn to_json(&self, value: &T) -> serde_json::Value {
        json!(value.name())
    }
}

/// A list of keywords of `T`, which may be empty.
#[derive(Clone, Copy, Debug)]
pub struct Words<T>(pub PhantomData<T>);

impl<T: Keyword> Kind for Words<T> {
    type Value = Vec<T>;

    fn schema(&self) -> Schema {
        json!({ "type": "array", "items": Word::<T>(PhantomData).schema() })
    }

    fn expected(&self) -> String {
        format!("a list of keywords out of {}", T::names().collect::<Vec<_>>().join(", "))
    }

    fn to_json(&self, value: &Vec<T>) -> serde_json::Value {
        json!(value.iter().map(|word| word.name()).collect::<Vec<_>>())
    }
}

/// A value that depends on others; its reader is not here.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    /// The schema of the value.
    pub schema: fn() -> Schema,
    /// What the value must be, in the problem that it is missing.
    pub expected: &'static str,
}

impl Kind for Shape {
    type Value = std::convert::Infallible;

    fn schema(&self) -> Schema {
        (self.schema)()
    }

    fn expected(&self) -> String {
        self.expected.into()
    }

    fn to_json(&self, value: &Self::Value) -> serde_json::Value {
        match *value {}
    }
}
