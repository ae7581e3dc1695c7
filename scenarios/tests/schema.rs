//! The JSON Schemas of scenario and unit files accept what the readers accept, and refuse what they refuse,
//! up to what a schema cannot express.

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::{Index, select};
use serde_json::{Value, json};
use smaclite_scenarios::{Problem, Problems, Scenario, ScenarioFiles};
use smaclite_units::UnitType;
use std::path::Path;

/// A change of a document: of which of its values, and to what.
#[derive(Clone, Debug)]
enum Change {
    Replace(Index, Value),
    Remove(Index),
    /// Adds a key to an object or an item to a list.
    Add(Index, &'static str, Value),
}

/// Every key of the two formats, and some that are not.
const NAMES: &[&str] = &[
    "$schema",
    "ALLY",
    "ARMORED",
    "MARINE",
    "ZEALOT",
    "armor",
    "attack_point",
    "attributes",
    "bonuses",
    "colour",
    "combat_type",
    "custom_unit_path",
    "energy",
    "episode_limit",
    "groups",
    "height",
    "hp",
    "initial_energy",
    "march_to",
    "name",
    "num_unit_types",
    "radius",
    "size",
    "starting_energy",
    "targeter",
    "targeter_kwargs",
    "terrain",
    "terrain_preset",
    "unit_type_ids",
    "units",
    "width",
    "x",
];

/// Values at the limits of the ranges, words, and values of the wrong type.
fn value() -> impl Strategy<Value = Value> {
    let numbers =
        [-1e7, -1.0, 0.0, 1e-9, 0.5, 1.0, 2.0, 3.0, 32.0, 999.0, 1000.0, 1001.0, 1024.0, 1024.5, 1e6];
    let integers =
        [-1_i64, 0, 1, 2, 3, 16, 32, 40, 1000, 1001, 1024, 1025, 1_000_000, 4_294_967_295, 1 << 32];
    let words = [
        "",
        "MELEE",
        "GROUND",
        "COLOSSUS",
        "LIGHT",
        "DAMAGE",
        "HEALING",
        "STANDARD",
        "KAMIKAZE",
        "LASER_BEAM",
        "HEAL",
        "ALLY",
        "ENEMY",
        "SIMPLE",
        "_X_",
        "_ _",
        "two\nlines",
        "ALY",
        "ground",
    ];
    let names = [99, 100, 101].map(|n| json!("n".repeat(n)));
    let others = [
        json!(null),
        json!(true),
        json!([]),
        json!({}),
        json!(["GROUND", "AIR"]),
        json!(["LIGHT"]),
        json!([9, 16]),
        json!([9]),
        json!({ "radius": 2 }),
        json!({ "width": 2, "height": 1 }),
        json!({ "MARINE": 1 }),
        json!({ "MARINE": 0, "ZEALOT": 1 }),
        json!(["___", "_X_"]),
        json!([["_", "__"], "_X_"]),
        json!([[], "___"]),
    ];
    prop_oneof![
        select(numbers.to_vec()).prop_map(|number| json!(number)),
        select(integers.to_vec()).prop_map(|number| json!(number)),
        select(words.to_vec()).prop_map(|word| json!(word)),
        select(names.to_vec()),
        select(others.to_vec()),
    ]
}

fn change() -> impl Strategy<Value = Change> {
    prop_oneof![
        3 => (any::<Index>(), value()).prop_map(|(at, value)| Change::Replace(at, value)),
        1 => any::<Index>().prop_map(Change::Remove),
        2 => (any::<Index>(), select(NAMES), value())
            .prop_map(|(at, name, value)| Change::Add(at, name, value)),
    ]
}

/// The JSON pointers of all values in `value`.
fn pointers(value: &Value, at: &str, found: &mut Vec<String>) {
    found.push(at.into());
    match value {
        Value::Object(entries) => {
            entries.iter().for_each(|(key, value)| pointers(value, &format!("{at}/{key}"), found));
        }
        Value::Array(items) => {
            items.iter().enumerate().for_each(|(i, item)| pointers(item, &format!("{at}/{i}"), found));
        }
        _ => {}
    }
}

fn apply(document: &mut Value, change: &Change) {
    let (Change::Replace(index, _) | Change::Remove(index) | Change::Add(index, ..)) = change;
    let mut found = Vec::new();
    pointers(document, "", &mut found);
    let pointer = index.get(&found);
    match change {
        Change::Replace(_, value) => *document.pointer_mut(pointer).unwrap() = value.clone(),
        Change::Add(_, name, value) => match document.pointer_mut(pointer).unwrap() {
            Value::Object(entries) => drop(entries.insert((*name).into(), value.clone())),
            Value::Array(items) => items.push(value.clone()),
            _ => {}
        },
        Change::Remove(_) => {
            let Some((parent, last)) = pointer.rsplit_once('/') else { return };
            match document.pointer_mut(parent).unwrap() {
                Value::Object(entries) => drop(entries.remove(last)),
                Value::Array(items) => drop(items.remove(last.parse().unwrap())),
                _ => {}
            }
        }
    }
}

/// Whether a problem depends on several values or on other files, which a schema cannot express.
fn is_inexpressible(problem: &Problem) -> bool {
    let Problem { path, message, .. } = problem;
    let has = |parts: &[&str]| parts.iter().any(|part| message.contains(part));
    has(&[
        "at most `energy`",
        "the value of its alias",
        "units in `groups`",
        "outside the ",
        "where another ",
        "raises the number of units",
        "neither a standard unit type nor a unit file",
        "an object of size",
        "left out, because another key",
        "that no other type has",
        "because `groups` contains the type",
        "rows, the value of `height`",
        "squares, the value of `width`",
        "must give the types that are not in",
        "must leave room for",
    ]) || path.starts_with("attack_point[")
        || path.starts_with("march_to[")
        || path.starts_with("unit_type_ids.")
}

fn check(validator: &jsonschema::Validator, document: &Value, read: Result<(), Problems>) {
    let errors: Vec<String> = validator.iter_errors(document).map(|error| error.to_string()).collect();
    match read {
        Ok(()) => assert_eq!(errors, [""; 0], "the reader accepts {document:#}"),
        Err(problems) if errors.is_empty() => {
            let expressible: Vec<_> =
                problems.list().iter().filter(|problem| !is_inexpressible(problem)).collect();
            assert!(expressible.is_empty(), "the schema accepts {document:#}\n{expressible:#?}");
        }
        Err(_) => {}
    }
}

fn validator(schema: &Value) -> jsonschema::Validator {
    jsonschema::draft202012::meta::validate(schema).expect("a valid schema");
    jsonschema::draft202012::new(schema).expect("a schema")
}

thread_local! {
    static UNIT: jsonschema::Validator = validator(&UnitType::schema());
    static SCENARIO: jsonschema::Validator = validator(&Scenario::schema());
}

fn check_unit(document: &Value) {
    let read = UnitType::from_json(&document.to_string(), "fuzzed", "fuzzed.json").map(drop);
    UNIT.with(|validator| check(validator, document, read));
}

fn check_scenario(document: &Value) {
    let read = Scenario::from_json(&document.to_string(), "fuzzed.json", Path::new("/nonexistent")).map(drop);
    SCENARIO.with(|validator| check(validator, document, read));
}

/// The standard unit types: among them a healer, a kamikaze and a beam.
fn units() -> Vec<Value> {
    let standard = UnitType::standard_names().map(|name| UnitType::standard_file(name).unwrap());
    standard.map(|text| serde_json::from_str(text).unwrap()).collect()
}

fn scenarios() -> Vec<Value> {
    let groups = json!([
        { "x": 1, "y": 1, "faction": "ALLY", "units": { "MARINE": 1, "ZEALOT": 1 } },
        { "x": 3, "y": 1, "faction": "ENEMY", "units": { "ZEALOT": 2 } },
    ]);
    let drawn = json!({
        "$schema": "scenario.schema.json", "name": "drawn", "num_allied_units": 2, "num_enemy_units": 2,
        "groups": groups, "attack_point": [1, 1], "terrain": ["____", "__X_", ["_", "___"]], "width": 4,
        "height": 3, "num_unit_types": 2, "unit_type_ids": { "MARINE": 1, "ZEALOT": 0 },
        "ally_has_shields": true, "enemy_has_shields": true, "episode_limit": 10, "custom_unit_path": "units",
    });
    let mut preset = drawn.clone();
    let entries = preset.as_object_mut().unwrap();
    ["terrain", "width", "height", "unit_type_ids"].iter().for_each(|key| drop(entries.remove(*key)));
    entries.insert("terrain_preset".into(), json!("SIMPLE"));
    entries.insert("num_unit_types".into(), json!(0));
    vec![drawn, preset]
}

#[test]
fn the_schemas_accept_the_standard_files() {
    let standard = Scenario::standard_names().map(|name| ScenarioFiles::resolve(name).unwrap().1.text);
    let standard: Vec<Value> = standard.map(|text| serde_json::from_str(&text).unwrap()).collect();
    for scenario in standard.iter().chain(&scenarios()) {
        SCENARIO.with(|schema| assert!(schema.is_valid(scenario), "{scenario:#}"));
        check_scenario(scenario);
    }
    for unit in units() {
        UNIT.with(|schema| assert!(schema.is_valid(&unit), "{unit:#}"));
        check_unit(&unit);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

    #[test]
    fn unit_files_and_their_schema(unit in select(units()), changes in vec(change(), 1..4)) {
        let mut document = unit;
        changes.iter().for_each(|change| apply(&mut document, change));
        check_unit(&document);
    }

    #[test]
    fn scenario_files_and_their_schema(scenario in select(scenarios()), changes in vec(change(), 1..4)) {
        let mut document = scenario;
        changes.iter().for_each(|change| apply(&mut document, change));
        check_scenario(&document);
    }
}
