//! The keys of a scenario file and the JSON Schema that they make. `read`, `groups` and `terrain` read the
//! values.

use crate::generation::keys::{starts_schema, teams_schema};
use crate::rewards::REWARD_KEYS;
use crate::smacv2::SMACV2_KEYS;
use crate::terrain::ON_ANY_MAP;
use crate::{Faction, MAX_SIDE, MAX_UNITS, March, Scenario, Terrain};
use serde_json::json;
use smaclite_units::UnitType;
use smaclite_units::file::{
    AnyKey, Flag, Key, Kind, Range, SCHEMA_DIALECT, SCHEMA_KEY, Schema, Shape, Text, Whole, Word,
    object_schema,
};
use std::marker::PhantomData;

/// Every key of a scenario file, in the order in which files have them.
pub(crate) const KEYS: [&dyn AnyKey; 23] = [
    &SCHEMA_KEY,
    &NAME,
    &CUSTOM_UNIT_PATH,
    &NUM_ALLIED_UNITS,
    &NUM_ENEMY_UNITS,
    &GROUPS,
    &TEAMS,
    &START_POSITIONS,
    &ATTACK_POINT,
    &MARCH_TO,
    &OPPONENT,
    &TERRAIN_PRESET,
    &TERRAIN,
    &WIDTH,
    &HEIGHT,
    &TERRAIN_HEIGHT,
    &NUM_UNIT_TYPES,
    &UNIT_TYPE_IDS,
    &ALLY_HAS_SHIELDS,
    &ENEMY_HAS_SHIELDS,
    &EPISODE_LIMIT,
    &SMACV2,
    &REWARDS,
];

/// Every key of a group.
pub(crate) const GROUP_KEYS: [&dyn AnyKey; 4] = [&X, &Y, &FACTION, &UNITS];

/// Side of every terrain preset, and the default of `width` and `height`.
pub(crate) const DEFAULT_SIDE: u32 = 32;

/// A number of units.
const COUNT: Whole = Whole { from: 1, to: MAX_UNITS };
const SIDE: Whole = Whole { from: 1, to: MAX_SIDE };
/// Wider than any map; the positions of the units are checked against the map itself.
const COORDINATE: Range = Range::closed(-1e6, 1e6);

pub(crate) const NAME: Key<Text> = Key::required_as(
    "name",
    Text { max_bytes: 100 },
    "the scenario's name",
    "Name of the scenario, at most 100 bytes.",
);
/// No system takes longer paths.
pub(crate) const CUSTOM_UNIT_PATH: Key<Text> = Key::optional(
    "custom_unit_path",
    Text { max_bytes: 4096 },
    "Folder of unit files, relative to this file or to the working directory. They are also found beside \
     this file.",
);
pub(crate) const NUM_ALLIED_UNITS: Key<Whole> = Key::required_as(
    "num_allied_units",
    COUNT,
    "the number of units of that faction",
    "Number of agents. With `groups`, it is that of their units of faction ALLY.",
);
pub(crate) const NUM_ENEMY_UNITS: Key<Whole> = Key::required_as(
    "num_enemy_units",
    COUNT,
    "the number of units of that faction",
    "Number of enemies. With `groups`, it is that of their units of faction ENEMY.",
);
pub(crate) const GROUPS: Key<Shape> = Key::optional(
    "groups",
    Shape { schema: groups_schema, expected: "a list of groups with `x`, `y`, `faction` and `units`" },
    "The units. Their order defines their ids. Each faction has at least one group. Required without \
     `teams`.",
);
/// Names of unit types are names of files.
pub(crate) const MAX_TYPE_NAME: usize = 255;
pub(crate) const TEAMS: Key<Shape> = Key::optional(
    "teams",
    Shape { schema: teams_schema, expected: "an object with a `distribution`" },
    "Instead of `groups`: the distribution from which the teams of each episode are drawn.",
);
pub(crate) const START_POSITIONS: Key<Shape> = Key::optional(
    "start_positions",
    Shape { schema: starts_schema, expected: "an object with a `distribution`" },
    "The distribution from which the start positions of each episode are drawn; without it, units start \
     where their groups are.",
);
pub(crate) const OPPONENT: Key<Word<March>> = Key::optional(
    "opponent",
    Word(PhantomData),
    "Who plays the enemies unless the user says otherwise: attack_move, the default, to the attack point, or \
     attack_nearest, to the nearest agent.",
);
pub(crate) const TERRAIN_HEIGHT: Key<Shape> = Key::optional(
    "terrain_height",
    Shape { schema: heights_schema, expected: "a list of rows, each a list of numbers from 0 to 255" },
    "The height of each square as `obs_terrain_height` of `smacv2` shows it, from 0 to 255; rows as in \
     `terrain`. 127 everywhere without it. Battles do not depend on it.",
);
pub(crate) const SMACV2: Key<Shape> = Key::optional(
    "smacv2",
    Shape { schema: || object_schema(&SMACV2_KEYS), expected: "an object of options" },
    "Lets agents observe, act and be rewarded as in SMACv2, with these options of SMACv2's environment.",
);
pub(crate) const REWARDS: Key<Shape> = Key::optional(
    "rewards",
    Shape { schema: || object_schema(&REWARD_KEYS), expected: "an object of reward options" },
    "What agents are rewarded for: SMAC's reward options. Not beside `smacv2`, which has these itself.",
);
pub(crate) const ATTACK_POINT: Key<Shape> = Key::optional(
    "attack_point",
    Shape { schema: attack_point_schema, expected: "[x, y], the point that the enemies march to" },
    "[x, y] on the map, in squares: the point that the enemies march to; they attack what they meet. \
     Required without `start_positions`, where the default is the centre of the map.",
);
pub(crate) const MARCH_TO: Key<Shape> = Key::optional(
    "march_to",
    Shape { schema: march_to_schema, expected: "\"AGENTS\", or the two ends of a line, [[x, y], [x, y]]" },
    "Under rules `starcraft`: where the enemies march to instead of the attack point. \"AGENTS\" is the \
     nearest agent; of a line, [[x, y], [x, y]], each episode draws a point. The other rules take no notice.",
);
pub(crate) const TERRAIN_PRESET: Key<Shape> = Key::optional(
    "terrain_preset",
    Shape { schema: preset_schema, expected: "the name of a preset" },
    "A map of the standard scenarios, 32 x 32 squares; instead of `terrain`.",
);
pub(crate) const TERRAIN: Key<Shape> = Key::optional(
    "terrain",
    Shape { schema: terrain_schema, expected: "a list of rows" },
    "The map: one row per square of `height`, the southernmost first, each a string of `width` squares; `_` \
     is a walkable square and X a blocked one.",
);
pub(crate) const WIDTH: Key<Whole> =
    Key::with_default("width", SIDE, DEFAULT_SIDE, "Size of the map from west to east, in squares.");
pub(crate) const HEIGHT: Key<Whole> =
    Key::with_default("height", SIDE, DEFAULT_SIDE, "Size of the map from south to north, in squares.");
pub(crate) const NUM_UNIT_TYPES: Key<Whole> = Key::required_as(
    "num_unit_types",
    Whole { from: 0, to: MAX_UNITS },
    "0, or the number of types to tell apart in observations",
    "Length of the one-hot encoding of the unit type in observations; 0 and 1 for none.",
);
pub(crate) const UNIT_TYPE_IDS: Key<Shape> = Key::optional(
    "unit_type_ids",
    Shape { schema: || json!({}), expected: "an object of unit types and their ids" },
    "The index of each unit type in the one-hot encoding, from 0 to `num_unit_types` - 1. Without an effect \
     if `num_unit_types` is 0 or 1.",
);
pub(crate) const ALLY_HAS_SHIELDS: Key<Flag> =
    Key::required("ally_has_shields", Flag, "Whether observations and state have the shields of allies.");
pub(crate) const ENEMY_HAS_SHIELDS: Key<Flag> =
    Key::required("enemy_has_shields", Flag, "Whether observations and state have the shields of enemies.");
pub(crate) const EPISODE_LIMIT: Key<Whole> = Key::optional(
    "episode_limit",
    Whole { from: 1, to: u32::MAX },
    "Steps after which an episode is truncated. Without it, a battle lasts until all units of one side are \
     dead.",
);

pub(crate) const X: Key<Range> = Key::required_as(
    "x",
    COORDINATE,
    "the group's centre, in squares from the west edge",
    "The group's centre, in squares from the west edge. All units of the group start on the map.",
);
pub(crate) const Y: Key<Range> = Key::required_as(
    "y",
    COORDINATE,
    "the group's centre, in squares from the south edge",
    "The group's centre, in squares from the south edge. All units of the group start on the map.",
);
pub(crate) const FACTION: Key<Word<Faction>> = Key::required_as(
    "faction",
    Word(PhantomData),
    "ALLY or ENEMY",
    "ALLY for units that agents control, ENEMY for those of the opponent.",
);
pub(crate) const UNITS: Key<Shape> = Key::required(
    "units",
    Shape { schema: units_schema, expected: "an object of unit types and their counts" },
    "Unit types and their counts. A type is a standard one or the name of a unit file without `.json`.",
);

impl Scenario {
    /// Every key of a scenario file, in the order in which files have them.
    pub fn keys() -> &'static [&'static dyn AnyKey] {
        &KEYS
    }

    /// The JSON Schema (draft 2020-12) of scenario files.
    ///
    /// It accepts every valid file. It cannot express what depends on several values or on other files: the
    /// numbers of units and rows, positions on the map, ids and unit files.
    pub fn schema() -> Schema {
        let mut schema = object_schema(&KEYS);
        schema["$schema"] = SCHEMA_DIALECT.into();
        schema["title"] = "Scenario".into();
        schema["description"] =
            "A scenario of smaclite-pool: units, start positions and a map. Positions are in squares of the \
             map, x from the west, y from the south."
                .into();
        schema["oneOf"] = json!([{ "required": [TERRAIN_PRESET.name] }, { "required": [TERRAIN.name] }]);
        schema["anyOf"] = json!([
            { "required": [GROUPS.name, ATTACK_POINT.name], "not": { "required": [TEAMS.name] } },
            { "required": [GROUPS.name, START_POSITIONS.name], "not": { "required": [TEAMS.name] } },
            { "required": [TEAMS.name, START_POSITIONS.name], "not": { "required": [GROUPS.name] } },
        ]);
        let preset_size = json!({ "const": DEFAULT_SIDE });
        schema["allOf"] = json!([
            {
                "if": { "required": [TERRAIN_PRESET.name] },
                "then": { "properties": { WIDTH.name: preset_size, HEIGHT.name: preset_size } },
            },
            {
                "if": { "properties": { NUM_UNIT_TYPES.name: { "minimum": 2 } } },
                "then": {
                    "properties": { UNIT_TYPE_IDS.name: ids_schema() }, "required": [UNIT_TYPE_IDS.name],
                },
            },
        ]);
        schema
    }
}

fn heights_schema() -> Schema {
    let row = json!({ "type": "array", "items": { "type": "integer", "minimum": 0, "maximum": 255 } });
    json!({ "type": "array", "items": row, "minItems": 1, "maxItems": MAX_SIDE })
}

fn groups_schema() -> Schema {
    // At least one per faction.
    let has = |faction: &str| json!({ "contains": { "properties": { FACTION.name: { "const": faction } } } });
    json!({ "type": "array", "items": object_schema(&GROUP_KEYS), "allOf": [has("ALLY"), has("ENEMY")] })
}

/// Names of unit types and values of this schema. The standard types are named for the completion of editors.
fn types_schema(value: &Schema) -> Schema {
    let standard: serde_json::Map<_, _> =
        UnitType::standard_names().map(|name| (name.to_owned(), value.clone())).collect();
    json!({ "type": "object", "properties": standard, "additionalProperties": value })
}

fn units_schema() -> Schema {
    let mut schema = types_schema(&COUNT.schema());
    schema["minProperties"] = 1.into();
    schema
}

fn ids_schema() -> Schema {
    types_schema(&Whole { from: 0, to: MAX_UNITS - 1 }.schema())
}

fn attack_point_schema() -> Schema {
    json!({ "type": "array", "items": ON_ANY_MAP.schema(), "minItems": 2, "maxItems": 2 })
}

fn march_to_schema() -> Schema {
    let line = json!({ "type": "array", "items": attack_point_schema(), "minItems": 2, "maxItems": 2 });
    json!({ "anyOf": [{ "const": "AGENTS" }, line] })
}

fn preset_schema() -> Schema {
    json!({ "enum": Terrain::preset_names().collect::<Vec<_>>() })
}

/// A row is one string, or a list of strings that are joined.
fn terrain_schema() -> Schema {
    let squares = json!({ "type": "string", "pattern": "^[_X]+$", "maxLength": MAX_SIDE });
    let row = json!({ "anyOf": [squares, { "type": "array", "items": squares, "minItems": 1 }] });
    json!({ "type": "array", "items": row, "minItems": 1, "maxItems": MAX_SIDE })
}
