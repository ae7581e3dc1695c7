//! The keys of a unit file and the JSON Schema that they make. `parse` reads the values.

use crate::file::{
    AnyKey, Flag, Key, Kind, Range, SCHEMA_DIALECT, SCHEMA_KEY, Schema, Shape, Whole, Word, Words,
    object_schema,
};
use crate::{Attribute, CombatType, Keyword, Plane, UnitType};
use serde_json::json;
use std::marker::PhantomData;

/// Every key of a unit file, in the order in which files have them.
pub(crate) const KEYS: [&dyn AnyKey; 35] = [
    &SCHEMA_KEY,
    &HP,
    &SHIELD,
    &HP_REGEN,
    &ENERGY,
    &INITIAL_ENERGY,
    &STARTING_ENERGY,
    &ARMOR,
    &DAMAGE,
    &ATTACKS,
    &BONUSES,
    &COOLDOWN,
    &SPEED,
    &ATTACK_RANGE,
    &MINIMUM_SCAN_RANGE,
    &SIGHT_RANGE,
    &TARGETING_RANGE,
    &SIZE,
    &PLANE,
    &COMBAT_TYPE,
    &VALID_TARGETS,
    &ATTRIBUTES,
    &TARGETER,
    &TARGETER_KWARGS,
    &DAMAGE_POINT,
    &BACKSWING,
    &MIN_RANDOM_DELAY,
    &MAX_RANDOM_DELAY,
    &RANGE_SLOP,
    &HIT_INTERVAL,
    &PROJECTILE_SPEED,
    &EFFECT_DELAY,
    &ACCELERATION,
    &TURN_RATE,
    &EXPLODES_WHEN_KILLED,
];

/// No useful value comes near these limits; they keep the simulator's f32 arithmetic finite. What is divided
/// by (health, sight ranges and cooldowns) has a least value for that.
const MAX_VALUE: f64 = 1e6;
/// The least health, sight range and size of a unit type.
pub const MIN_POSITIVE: f64 = 1e-3;
const MAX_SIZE: f64 = 1024.0;
const MAX_ATTACKS: u32 = 1000;

pub(crate) const NON_NEGATIVE: Range = Range::closed(0.0, MAX_VALUE);
const POSITIVE: Range = Range::closed(MIN_POSITIVE, MAX_VALUE);

/// Longer phases of an attack than this have no use.
const SECONDS: Range = Range::closed(0.0, 60.0);
const DELAY: Range = Range::closed(-60.0, 60.0);

pub(crate) const HP: Key<Range> = Key::required("hp", POSITIVE, "Maximum and starting health.");
pub(crate) const SHIELD: Key<Range> =
    Key::with_default("shield", NON_NEGATIVE, 0.0, "Maximum and starting shield; 0 for none.");
pub(crate) const HP_REGEN: Key<Range> =
    Key::with_default("hp_regen", NON_NEGATIVE, 0.0, "Health regained per second.");
pub(crate) const ENERGY: Key<Range> =
    Key::with_default("energy", NON_NEGATIVE, 0.0, "Maximum energy; 0 for none.");
pub(crate) const INITIAL_ENERGY: Key<Range> = Key::with_default(
    "initial_energy",
    NON_NEGATIVE,
    0.0,
    "Energy at the start of an episode, at most `energy`.",
);
/// The paper calls the key `initial_energy`, existing files `starting_energy`.
pub(crate) const STARTING_ENERGY: Key<Range> = Key::optional(
    "starting_energy",
    NON_NEGATIVE,
    "Another name of `initial_energy`. If both are there, they are equal.",
);
pub(crate) const ARMOR: Key<Range> =
    Key::required("armor", NON_NEGATIVE, "Subtracted from the part of each hit that reaches health.");
pub(crate) const DAMAGE: Key<Range> =
    Key::required("damage", NON_NEGATIVE, "Damage of one hit before bonuses and armor.");
pub(crate) const ATTACKS: Key<Whole> =
    Key::with_default("attacks", Whole { from: 1, to: MAX_ATTACKS }, 1, "Number of hits per attack.");
pub(crate) const BONUSES: Key<Shape> = Key::optional(
    "bonuses",
    Shape { schema: bonuses_schema, expected: "an object of attributes and damages" },
    "Additional damage of each hit to units with an attribute.",
);
pub(crate) const COOLDOWN: Key<Shape> = Key::required(
    "cooldown",
    Shape { schema: cooldown_schema, expected: "0 or a number from 0.001 to 1000000" },
    "Time between attacks, in seconds; 0 lets the unit attack in every tick.",
);
pub(crate) const SPEED: Key<Range> = Key::required(
    "speed",
    NON_NEGATIVE,
    "Maximum speed, in squares per second; 0 for a unit that never moves.",
);
pub(crate) const ATTACK_RANGE: Key<Shape> = Key::required(
    "attack_range",
    Shape { schema: attack_range_schema, expected: "a number from 0 to 1000000 or \"MELEE\"" },
    "Range of the attack between the edges of the two units, in squares; MELEE is 0.1.",
);
pub(crate) const MINIMUM_SCAN_RANGE: Key<Range> = Key::with_default(
    "minimum_scan_range",
    NON_NEGATIVE,
    5.0,
    "Range in which the unit looks for a target by itself, in squares.",
);
pub(crate) const SIGHT_RANGE: Key<Range> = Key::with_default(
    "sight_range",
    POSITIVE,
    9.0,
    "How far agents of this type see where a scenario has SMACv2's `use_unit_ranges`, in squares.",
);
pub(crate) const TARGETING_RANGE: Key<Range> = Key::with_default(
    "targeting_range",
    NON_NEGATIVE,
    6.0,
    "Distance between the centres within which agents of this type can target others where a scenario has \
     SMACv2's `use_unit_ranges`, in squares.",
);
pub(crate) const SIZE: Key<Range> =
    Key::required("size", Range::closed(MIN_POSITIVE, MAX_SIZE), "Diameter, in squares.");
pub(crate) const PLANE: Key<Word<Plane>> = Key::with_default(
    "plane",
    Word(PhantomData),
    Plane::Ground,
    "The layer that the unit lives in. Obstacles stop only GROUND; every unit can attack COLOSSUS.",
);
pub(crate) const COMBAT_TYPE: Key<Word<CombatType>> = Key::with_default(
    "combat_type",
    Word(PhantomData),
    CombatType::Damage,
    "Whether the unit attacks or heals. A healer also has the targeter HEAL.",
);
pub(crate) const VALID_TARGETS: Key<Words<Plane>> =
    Key::required("valid_targets", Words(PhantomData), "The planes whose units this unit can attack.");
pub(crate) const ATTRIBUTES: Key<Words<Attribute>> = Key::required(
    "attributes",
    Words(PhantomData),
    "The attributes of the unit, to which the bonuses of others refer.",
);
pub(crate) const TARGETER: Key<Word<TargeterKind>> = Key::with_default(
    "targeter",
    Word(PhantomData),
    TargeterKind::Standard,
    "What an attack hits: its target; all enemies around the attacker, which dies; all enemies that a beam \
     across the target touches. HEAL heals its target.",
);
pub(crate) const TARGETER_KWARGS: Key<Shape> = Key::optional(
    "targeter_kwargs",
    Shape { schema: || json!({ "type": "object" }), expected: "an object of parameters of the targeter" },
    "Parameters of the targeter, in squares: `radius` of KAMIKAZE, `width` and `height` of LASER_BEAM.",
);

// How the unit moves and attacks under rules `starcraft`.

pub(crate) const DAMAGE_POINT: Key<Range> = Key::with_default(
    "damage_point",
    SECONDS,
    0.0,
    "Under rules `starcraft`: time from the start of an attack to its effect, in seconds.",
);
pub(crate) const BACKSWING: Key<Range> = Key::with_default(
    "backswing",
    SECONDS,
    0.0,
    "Under rules `starcraft`: time after the damage point in which the unit does not walk unless it gets \
     another order, in seconds.",
);
pub(crate) const MIN_RANDOM_DELAY: Key<Range> = Key::with_default(
    "min_random_delay",
    DELAY,
    0.0,
    "Under rules `starcraft`: the least time that is added, at random, to `cooldown` after each attack, in \
     seconds.",
);
pub(crate) const MAX_RANDOM_DELAY: Key<Range> = Key::with_default(
    "max_random_delay",
    DELAY,
    0.0,
    "Under rules `starcraft`: the greatest such time, at least `min_random_delay`, in seconds.",
);
pub(crate) const RANGE_SLOP: Key<Range> = Key::with_default(
    "range_slop",
    NON_NEGATIVE,
    0.0,
    "Under rules `starcraft`: an attack that has begun, and the next one on the same target, reach so much \
     farther than `attack_range`, in squares.",
);
pub(crate) const HIT_INTERVAL: Key<Range> = Key::with_default(
    "hit_interval",
    SECONDS,
    0.0,
    "Under rules `starcraft`: time between the hits of one attack, in seconds, rounded up to ticks of 1/16 \
     s; a new order ends them, and so does a target out of reach.",
);
pub(crate) const PROJECTILE_SPEED: Key<Range> = Key::with_default(
    "projectile_speed",
    NON_NEGATIVE,
    0.0,
    "Under rules `starcraft`: speed of what the unit fires, in squares per second; 0 for at once.",
);
pub(crate) const EFFECT_DELAY: Key<Range> = Key::with_default(
    "effect_delay",
    SECONDS,
    0.0,
    "Under rules `starcraft`: time from the damage point to the hits of LASER_BEAM, in seconds.",
);
pub(crate) const ACCELERATION: Key<Range> = Key::with_default(
    "acceleration",
    NON_NEGATIVE,
    0.0,
    "Under rules `starcraft`: acceleration, in squares per second per second; 0 for full speed at once.",
);
pub(crate) const TURN_RATE: Key<Range> = Key::with_default(
    "turn_rate",
    NON_NEGATIVE,
    0.0,
    "Under rules `starcraft`: how fast the unit turns to what it attacks, in degrees per second; 0 for at \
     once. It walks in any direction at once.",
);
pub(crate) const EXPLODES_WHEN_KILLED: Key<Flag> = Key::with_default(
    "explodes_when_killed",
    Flag,
    false,
    "Under rules `starcraft`: whether a unit with targeter KAMIKAZE also explodes when it is killed.",
);

pub(crate) const RADIUS: Key<Range> =
    Key::required("radius", NON_NEGATIVE, "Radius of the blast around the attacker's centre, in squares.");
pub(crate) const WIDTH: Key<Range> =
    Key::required("width", NON_NEGATIVE, "Length of the beam across the line of fire, in squares.");
pub(crate) const HEIGHT: Key<Range> =
    Key::required("height", NON_NEGATIVE, "Depth of the beam along the line of fire, in squares.");

/// The keywords of `targeter`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum TargeterKind {
    Standard,
    Kamikaze,
    LaserBeam,
    Heal,
}

impl Keyword for TargeterKind {
    const KEYWORDS: &'static [(&'static str, TargeterKind)] = &[
        ("STANDARD", TargeterKind::Standard),
        ("KAMIKAZE", TargeterKind::Kamikaze),
        ("LASER_BEAM", TargeterKind::LaserBeam),
        ("HEAL", TargeterKind::Heal),
    ];
}

impl TargeterKind {
    /// The keys of `targeter_kwargs`, all required.
    pub(crate) fn parameters(self) -> &'static [&'static dyn AnyKey] {
        match self {
            TargeterKind::Standard | TargeterKind::Heal => &[],
            TargeterKind::Kamikaze => &[&RADIUS],
            TargeterKind::LaserBeam => &[&WIDTH, &HEIGHT],
        }
    }
}

impl UnitType {
    /// Every key of a unit file, in the order in which files have them.
    pub fn keys() -> &'static [&'static dyn AnyKey] {
        &KEYS
    }

    /// The keywords of `targeter`, with the keys of `targeter_kwargs` for each, all required.
    pub fn targeters() -> impl Iterator<Item = (&'static str, &'static [&'static dyn AnyKey])> {
        TargeterKind::KEYWORDS.iter().map(|(name, kind)| (*name, kind.parameters()))
    }

    /// The JSON Schema (draft 2020-12) of unit files.
    ///
    /// It accepts every valid file. It cannot express that `initial_energy` is at most `energy` and equal to
    /// `starting_energy`.
    pub fn schema() -> Schema {
        let mut schema = object_schema(&KEYS);
        schema["$schema"] = SCHEMA_DIALECT.into();
        schema["title"] = "Unit type".into();
        schema["description"] =
            "A unit type of smaclite-pool, named after its file. Distances are in squares of \
            the map, times in seconds."
                .into();
        let mut rules = TargeterKind::KEYWORDS.iter().map(|(_, kind)| kwargs_rule(*kind)).collect::<Vec<_>>();
        // Healers have the targeter HEAL, and no other units have it.
        let (is_healer, heals) = (has("combat_type", "HEALING"), has("targeter", "HEAL"));
        rules.push(json!({ "if": is_healer, "then": heals }));
        rules.push(json!({ "if": heals, "then": is_healer }));
        schema["allOf"] = rules.into();
        schema
    }
}

/// The schema of objects whose key `name` is there and has this value.
fn has(name: &str, value: &str) -> Schema {
    json!({ "properties": { name: { "const": value } }, "required": [name] })
}

/// The rule of `targeter_kwargs` for one targeter.
fn kwargs_rule(kind: TargeterKind) -> Schema {
    let name = kind.name();
    if kind.parameters().is_empty() {
        // STANDARD is also the targeter of a file that names none.
        let mut condition = has("targeter", name);
        if kind == TargeterKind::Standard {
            condition = json!({ "properties": { "targeter": { "const": name } } });
        }
        let no_kwargs = json!({ "properties": { "targeter_kwargs": { "maxProperties": 0 } } });
        return json!({ "if": condition, "then": no_kwargs });
    }
    let kwargs = object_schema(kind.parameters());
    json!({
        "if": has("targeter", name),
        "then": { "properties": { "targeter_kwargs": kwargs }, "required": ["targeter_kwargs"] },
    })
}

fn bonuses_schema() -> Schema {
    let names: Vec<_> = Attribute::names().collect();
    json!({
        "type": "object", "propertyNames": { "enum": names }, "additionalProperties": NON_NEGATIVE.schema(),
    })
}

fn cooldown_schema() -> Schema {
    let mut schema = NON_NEGATIVE.schema();
    schema["anyOf"] = json!([{ "const": 0 }, { "minimum": MIN_POSITIVE }]);
    schema
}

fn attack_range_schema() -> Schema {
    json!({ "anyOf": [NON_NEGATIVE.schema(), { "const": "MELEE" }] })
}
