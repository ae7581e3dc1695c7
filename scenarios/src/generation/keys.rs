//! The keys of `teams` and `start_positions`, and their schemas. `read` reads the values.

use crate::terrain::ON_ANY_MAP;
use serde_json::json;
use smaclite_units::Keyword;
use smaclite_units::file::{AnyKey, Key, Kind, Range, Schema, Shape, Word, object_schema};
use std::marker::PhantomData;

/// A distribution of teams.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum TeamsKind {
    Weighted,
    All,
    Fixed,
}

impl Keyword for TeamsKind {
    const KEYWORDS: &'static [(&'static str, TeamsKind)] = &[
        ("weighted_teams", TeamsKind::Weighted),
        ("all_teams", TeamsKind::All),
        ("fixed", TeamsKind::Fixed),
    ];
}

/// A distribution of start positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum StartsKind {
    Reflect,
    Surrounded,
    SurroundedAndReflect,
    Uniform,
}

impl Keyword for StartsKind {
    const KEYWORDS: &'static [(&'static str, StartsKind)] = &[
        ("reflect_position", StartsKind::Reflect),
        ("surrounded", StartsKind::Surrounded),
        ("surrounded_and_reflect", StartsKind::SurroundedAndReflect),
        ("uniform", StartsKind::Uniform),
    ];
}

/// Every key of `teams`.
pub(crate) const TEAMS_KEYS: [&dyn AnyKey; 5] =
    [&TEAMS_KIND, &UNIT_TYPES, &WEIGHTS, &EXCEPTION_UNIT_TYPES, &TEAMS_LIST];

/// Every key of `start_positions`.
pub(crate) const STARTS_KEYS: [&dyn AnyKey; 4] = [&STARTS_KIND, &P, &ALLIES_AREA, &ENEMIES_AREA];

pub(crate) const TEAMS_KIND: Key<Word<TeamsKind>> = Key::required(
    "distribution",
    Word(PhantomData),
    "weighted_teams: independent draws by weight; all_teams: every multiset of types is equally probable; \
     fixed: one of several teams.",
);
pub(crate) const UNIT_TYPES: Key<Shape> = Key::optional(
    "unit_types",
    Shape { schema: names_schema, expected: "a list of unit types" },
    "The unit types of weighted_teams and all_teams.",
);
pub(crate) const WEIGHT: Range = Range::left_open(0.0, 1e6);
pub(crate) const WEIGHTS: Key<Shape> = Key::optional(
    "weights",
    Shape { schema: weights_schema, expected: "a list with a number above 0 for each of `unit_types`" },
    "The weight of each of `unit_types` in weighted_teams; they are divided by their sum. Types that are no \
     exceptions must have at least 0.001 of it.",
);
/// The least share of the weights that types without exceptions have. It bounds how often a team is drawn
/// again: a single unit 1000 times on average.
pub(crate) const LEAST_SHARE: f64 = 0.001;
pub(crate) const EXCEPTION_UNIT_TYPES: Key<Shape> = Key::optional(
    "exception_unit_types",
    Shape { schema: names_schema, expected: "a list of unit types" },
    "Unit types that do not make a team alone: such a team is drawn again.",
);
pub(crate) const TEAMS_LIST: Key<Shape> = Key::optional(
    "teams",
    Shape { schema: teams_list_schema, expected: "a list of teams, each a list of unit types" },
    "The teams of the distribution fixed, each with a type for every unit.",
);
pub(crate) const STARTS_KIND: Key<Word<StartsKind>> = Key::required(
    "distribution",
    Word(PhantomData),
    "reflect_position: allies in the west half, enemies mirrored; surrounded: allies in the centre, enemies \
     in groups on the diagonals; surrounded_and_reflect: one of both; uniform: each faction in an area.",
);
pub(crate) const P: Key<Range> = Key::with_default(
    "p",
    Range::closed(0.0, 1.0),
    0.5,
    "The probability of reflect_position in surrounded_and_reflect.",
);
pub(crate) const ALLIES_AREA: Key<Shape> = Key::optional(
    "allies",
    Shape { schema: area_schema, expected: "[west, south, east, north], an area in squares" },
    "The area of the allies in uniform: [west, south, east, north], in squares.",
);
pub(crate) const ENEMIES_AREA: Key<Shape> = Key::optional(
    "enemies",
    Shape { schema: area_schema, expected: "[west, south, east, north], an area in squares" },
    "The area of the enemies in uniform: [west, south, east, north], in squares.",
);

pub(crate) fn teams_schema() -> Schema {
    object_schema(&TEAMS_KEYS)
}

pub(crate) fn starts_schema() -> Schema {
    object_schema(&STARTS_KEYS)
}

fn names_schema() -> Schema {
    json!({ "type": "array", "items": { "type": "string", "minLength": 1 } })
}

fn weights_schema() -> Schema {
    json!({ "type": "array", "items": WEIGHT.schema(), "minItems": 1 })
}

fn teams_list_schema() -> Schema {
    json!({ "type": "array", "items": names_schema(), "minItems": 1 })
}

fn area_schema() -> Schema {
    json!({ "type": "array", "items": ON_ANY_MAP.schema(), "minItems": 4, "maxItems": 4 })
}
