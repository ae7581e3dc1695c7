//! Custom scenario files: what is accepted, where unit files are found, and the message for everything
//! refused.

use smaclite_scenarios::{Faction, Problems, Rewards, Scenario, ScenarioFiles, UnitFile};
use std::fs;
use std::path::Path;

/// A valid file; each case replaces, leaves out or adds keys.
const REQUIRED: [(&str, &str); 9] = [
    ("name", r#""duel""#),
    ("num_allied_units", "1"),
    ("num_enemy_units", "2"),
    (
        "groups",
        r#"[{"x": 9, "y": 16, "faction": "ALLY", "units": {"ZEALOT": 1}},
            {"x": 23, "y": 16, "faction": "ENEMY", "units": {"STALKER": 1, "MARINE": 1}}]"#,
    ),
    ("attack_point", "[9, 16]"),
    ("terrain_preset", r#""SIMPLE""#),
    ("num_unit_types", "0"),
    ("ally_has_shields", "true"),
    ("enemy_has_shields", "false"),
];

/// The valid file with `changes`, pairs of key and value; an empty value leaves the key out.
fn file(changes: &[(&str, &str)]) -> String {
    let changed = |key: &str| changes.iter().any(|(name, _)| *name == key);
    let kept = REQUIRED.iter().filter(|(key, _)| !changed(key));
    let entries: Vec<String> = kept
        .chain(changes.iter().filter(|(_, value)| !value.is_empty()))
        .map(|(key, value)| format!("\"{key}\": {value}"))
        .collect();
    format!("{{{}}}", entries.join(", "))
}

fn read(changes: &[(&str, &str)]) -> Result<Scenario, String> {
    Scenario::from_json(&file(changes), "duel.json", Path::new("")).map_err(messages)
}

/// The messages of all problems, one per line, without files and positions.
fn messages(problems: Problems) -> String {
    let messages: Vec<_> = problems.list().iter().map(|problem| problem.message.as_str()).collect();
    messages.join("\n")
}

#[test]
fn units_get_ids_and_types_in_listed_order() {
    let duel = read(&[]).unwrap();
    let names: Vec<_> = duel.unit_types.iter().map(|unit_type| unit_type.name.as_str()).collect();
    assert_eq!(names, ["ZEALOT", "STALKER", "MARINE"]);
    let units: Vec<_> =
        duel.units.iter().map(|unit| (unit.unit_type, unit.faction, unit.id_in_faction)).collect();
    assert_eq!(units, [(0, Faction::Ally, 0), (1, Faction::Enemy, 0), (2, Faction::Enemy, 1)]);
    assert_eq!((duel.episode_limit, duel.num_unit_types, duel.type_ids), (None, 0, vec![0, 0, 0]));
}

#[test]
fn type_ids_may_name_types_that_are_not_there() {
    let ids = r#"{"MARINE": 0, "ZEALOT": 3, "MEDIVAC": 1, "STALKER": 2}"#;
    let duel = read(&[("num_unit_types", "4"), ("unit_type_ids", ids)]).unwrap();
    assert_eq!((duel.num_unit_types, duel.type_ids), (4, vec![3, 2, 0]));
}

#[test]
fn one_type_to_tell_apart_is_none() {
    let duel = read(&[("num_unit_types", "1"), ("unit_type_ids", r#"{"MARINE": 0}"#)]).unwrap();
    assert_eq!((duel.num_unit_types, duel.type_ids), (0, vec![0, 0, 0]));
}

#[test]
fn inline_terrain_has_row_0_first() {
    let rows = ["___X", "____", "XXXX"].map(String::from);
    let groups = r#"[{"x": 1, "y": 1, "faction": "ALLY", "units": {"ZEALOT": 1}},
                     {"x": 3, "y": 1, "faction": "ENEMY", "units": {"ZEALOT": 1}}]"#;
    let split = r#"[["_", "_", "_", "X"], ["__", "__"], "XXXX"]"#;
    for terrain in [format!("{rows:?}"), split.to_owned()] {
        let changes = [
            ("terrain_preset", ""),
            ("terrain", terrain.as_str()),
            ("width", "4"),
            ("height", "3"),
            ("groups", groups),
            ("num_enemy_units", "1"),
            ("attack_point", "[4, 3]"),
        ];
        let map = read(&changes).unwrap().terrain;
        assert_eq!((map.width(), map.height()), (4, 3));
        assert!(!map.is_walkable(3, 0) && map.is_walkable(3, 1) && !map.is_walkable(0, 2));
        assert!(!map.is_walkable(0, -1) && !map.is_walkable(4, 1) && !map.is_walkable(0, 3));
    }
}

/// Changes of the file, and the messages of its problems, one per line.
type Case<'a> = (&'a [(&'a str, &'a str)], &'a str);

fn check(cases: &[Case]) {
    for (changes, message) in cases {
        assert_eq!(read(changes).expect_err(message), *message);
    }
}

#[test]
fn bad_keys_and_values() {
    check(&[
        (&[("grups", "[]")], "unknown key `grups`; did you mean `groups`?"),
        (&[("name", "")], "`name` is missing; it must be the scenario's name"),
        (&[("ally_has_shields", "1")], "`ally_has_shields` is 1, but must be true or false"),
        (&[("attack_point", "[9]")], "`attack_point` is a list of length 1, but must be two numbers, [x, y]"),
        (&[("attack_point", "[9, 33]")], "`attack_point[1]` is 33, but must be a number from 0 to 32"),
        (
            &[("march_to", r#""agents""#)],
            r#"`march_to` is "agents", but must be "AGENTS", or the two ends of a line, [[x, y], [x, y]]"#,
        ),
        (
            &[("march_to", "[[9, 16]]")],
            "`march_to` is a list of length 1, but must be \"AGENTS\", or the two ends of a line, \
             [[x, y], [x, y]]",
        ),
        (&[("march_to", "[[9, 16], [9, 33]]")], "`march_to[1][1]` is 33, but must be a number from 0 to 32"),
        (
            &[("march_to", "[1, 2]")],
            "`march_to[0]` is 1, but must be a list\n`march_to[1]` is 2, but must be a list",
        ),
        (&[("episode_limit", "0")], "`episode_limit` is 0, but must be a whole number from 1 to 4294967295"),
    ]);
}

#[test]
fn bad_terrain() {
    let side = ("width", "2");
    let inline = |rows| [("terrain_preset", ""), ("terrain", rows), side, ("height", "2")];
    check(&[
        (
            &[("terrain_preset", "\"SIMPEL\"")],
            "`terrain_preset` is \"SIMPEL\", but must be one of ALL_GREEN, CHECKERBOARD, \
             CORRIDOR, FLAT, NARROW, OCTAGON, PENTAGON, RAVINE, SIMPLE; did you mean `SIMPLE`?",
        ),
        (
            &[("terrain_preset", "")],
            "`terrain_preset` is missing; it must be one of ALL_GREEN, CHECKERBOARD, CORRIDOR, FLAT, NARROW, \
             OCTAGON, PENTAGON, RAVINE, SIMPLE; or `terrain` must define the map",
        ),
        (
            &[("terrain", "[]")],
            "`terrain_preset` is \"SIMPLE\", but must be left out, because `terrain` defines the map",
        ),
        (&[("width", "40")], "`width` is 40, but must be 32, the size of the terrain presets"),
        (&[("height", "2000")], "`height` is 2000, but must be a whole number from 1 to 1024"),
        (
            &[("terrain_preset", ""), ("terrain", "[]")],
            "`terrain` is a list of length 0, but must be a list of 32 rows, the value of `height` \
             (32 if it is missing)",
        ),
        (
            &inline(r#"["__", "_"]"#),
            "`terrain[1]` is \"_\", but must be a row of 2 squares, the value of `width`; it has 1",
        ),
        (
            &inline(r#"["__", "_."]"#),
            "`terrain[1]` is \"_.\", but must be made of `_` (walkable) and `X` (blocked), without '.'",
        ),
        (&inline(r#"["__", 3]"#), "`terrain[1]` is 3, but must be a string of `_` and `X`"),
        (
            &inline(r#"["__", ["_", 1]]"#),
            "`terrain[1][1]` is 1, but must be a string of 1 to 1024 bytes, on one line",
        ),
    ]);
}

#[test]
fn bad_groups() {
    let enemies = r#"{"x": 23, "y": 16, "faction": "ENEMY", "units": {"STALKER": 1, "MARINE": 1}}"#;
    let one = |group: &str| format!("[{group}, {enemies}]");
    let at = |x: &str, units: &str| format!(r#"{{"x": {x}, "y": 16, "faction": "ALLY", "units": {units}}}"#);
    let cases = [
        (
            one(&at("40", r#"{"ZEALOT": 1}"#)),
            "`groups[0]` puts a ZEALOT at (40, 16), outside the 32 x 32 map",
        ),
        (
            // One problem per group, and the units are counted.
            one(&at("40", r#"{"ZEALOT": 2}"#)),
            "`num_allied_units` is 1, but must be 2, the number of ALLY units in `groups`\n\
             `groups[0]` puts a ZEALOT at (39.5, 15.975), outside the 32 x 32 map",
        ),
        (
            format!("[{}, {enemies}, {}]", at("9", r#"{"ZEALOT": 1}"#), at("9", r#"{"MARINE": 1}"#)),
            "`num_allied_units` is 1, but must be 2, the number of ALLY units in `groups`\n\
             `groups[2]` puts a MARINE at (9, 16), where another GROUND unit starts; move the group",
        ),
        (
            one(&at("9", r#"{"ZEALOT": -1}"#)),
            "`groups[0].units.ZEALOT` is -1, but must be a whole number from 1 to 1000",
        ),
        (
            one(&at("9", r#"{"ZEALOT": 1000, "MARINE": 1}"#)),
            "`groups[0].units.MARINE` raises the number of units to 1001; at most 1000 are allowed",
        ),
        (
            one(&at("9", "{}")),
            "`groups[0].units` is an object of size 0, but must be an object with at least one unit type",
        ),
        (
            one(&at("\"9\"", r#"{"ZEALOT": 1}"#)),
            "`groups[0].x` is \"9\", but must be a number from -1000000 to 1000000",
        ),
        (
            one(&at("9", r#"{"ZEALOT": 1}"#).replace("ALLY", "ALY")),
            "`groups[0].faction` is \"ALY\", but must be one of ALLY, ENEMY; did you mean `ALLY`?",
        ),
        (
            one(&at("9", r#"{"ZEALOT": 1}"#).replace("faction", "side")),
            "`groups[0].faction` is missing; it must be ALLY or ENEMY\n\
             unknown key `groups[0].side`; expected one of x, y, faction, units",
        ),
        (
            one(&at("9", r#"{"ZEALOTT": 1}"#)),
            "`groups[0].units.ZEALOTT` is neither a standard unit type nor a unit file \
             (tried ZEALOTT.json); did you mean `ZEALOT`?",
        ),
        (
            format!("[{enemies}]"),
            "`groups` is a list of length 1, but must be a list with at least one group of faction ALLY",
        ),
    ];
    for (groups, message) in &cases {
        check(&[(&[("groups", groups)], message)]);
    }
}

#[test]
fn bad_counts_and_ids() {
    let ids = |ids| [("num_unit_types", "3"), ("unit_type_ids", ids)];
    check(&[
        (
            &[("num_enemy_units", "3")],
            "`num_enemy_units` is 3, but must be 2, the number of ENEMY units in `groups`",
        ),
        (&[("num_allied_units", "0")], "`num_allied_units` is 0, but must be a whole number from 1 to 1000"),
        (
            &[("num_unit_types", "3")],
            "`unit_type_ids` is missing; it must be an object of unit types and their ids, 0 to 2",
        ),
        (
            &ids(r#"{"ZEALOT": 0, "STALKER": 1}"#),
            "`unit_type_ids` is an object of size 2, but must be an object of size 3, the value of \
             `num_unit_types`",
        ),
        (
            &ids(r#"{"ZEALOT": 0, "STALKER": 1, "MARINE": 3}"#),
            "`unit_type_ids.MARINE` is 3, but must be a whole number from 0 to 2",
        ),
        (
            &ids(r#"{"ZEALOT": 0, "STALKER": 1, "MARINE": 1}"#),
            "`unit_type_ids.MARINE` is 1, but must be an id from 0 to 2 that no other type has",
        ),
        (
            &ids(r#"{"ZEALOT": 0, "STALKER": 1, "MEDIVAC": 2}"#),
            "`unit_type_ids.MARINE` is missing; it must be an id from 0 to 2, because `groups` or `teams` \
             contains the type",
        ),
    ]);
}

const SCOUT: &str = r#"{"hp": 45, "armor": 0, "damage": 6, "cooldown": 3, "speed": 3.15, "attack_range": 3,
                        "size": 3, "attributes": [], "valid_targets": []}"#;

/// A folder with `units/scout.json`, `scout.json` of half the health, and a scenario that names `unit`.
fn folder(unit: &str, custom_unit_path: &str) -> (tempfile::TempDir, Result<Scenario, String>) {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("units")).unwrap();
    fs::write(folder.path().join("units/scout.json"), SCOUT).unwrap();
    fs::write(folder.path().join("scout.json"), SCOUT.replace("45", "20")).unwrap();
    let groups = REQUIRED[3].1.replace("\"ZEALOT\": 1", &format!("{unit:?}: 1"));
    let changes = [("groups", groups.as_str()), ("custom_unit_path", custom_unit_path)];
    let path = folder.path().join("duel.json");
    fs::write(&path, file(&changes)).unwrap();
    let loaded = Scenario::resolve(path.to_str().unwrap()).map_err(|error| error.to_string());
    (folder, loaded)
}

#[test]
fn unit_files_are_found() {
    let cases = [
        ("scout", r#""units""#, 45.0),
        ("scout.json", r#""./units/""#, 45.0),
        ("units/scout", "", 45.0),
        ("scout", "", 20.0),
        ("units/scout", r#""elsewhere""#, 45.0),
    ];
    for (unit, custom_unit_path, hp) in cases {
        let (_folder, loaded) = folder(unit, custom_unit_path);
        let scout = &loaded.unwrap().unit_types[0];
        assert_eq!((scout.name.as_str(), scout.hp), ("scout", hp), "{unit} in {custom_unit_path}");
    }
}

/// The published environment has no HYDRALISK, so scenarios for it bring a file of that name. That file is
/// used, although HYDRALISK is a standard type here; for the other standard types files are not read.
#[test]
fn a_hydralisk_file_comes_before_the_standard_type() {
    let (folder, standard) = folder("HYDRALISK", "");
    assert_eq!(standard.unwrap().unit_types[0].hp, 80.0);
    fs::write(folder.path().join("HYDRALISK.json"), SCOUT).unwrap();
    fs::write(folder.path().join("STALKER.json"), SCOUT).unwrap();
    let scenario = Scenario::load(&folder.path().join("duel.json")).unwrap();
    let hp_of = |name| scenario.unit_types.iter().find(|unit_type| unit_type.name == name).unwrap().hp;
    assert_eq!((hp_of("HYDRALISK"), hp_of("STALKER")), (45.0, 80.0));
}

/// The example files of the SMAClite paper's appendix.
#[test]
fn the_papers_example_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let units = folder.path().join("smaclite/env/units/smaclite_units");
    fs::create_dir_all(&units).unwrap();
    let unit = r#"{"hp": 45, "armor": 0, "damage": 6, "cooldown": 3, "speed": 3.15, "attack_range": 3,
                   "size": 3, "attributes": ["LIGHT", "BIOLOGICAL"], "minimum_scan_range": 100,
                   "valid_targets": ["GROUND", "AIR"]}"#;
    fs::write(units.join("example_custom_unit.json"), unit).unwrap();
    let text = r#"{"name": "10m_vs_11m", "custom_unit_path": "smaclite/env/units/smaclite_units",
        "num_allied_units": 10, "num_enemy_units": 11,
        "groups": [{"x": 9, "y": 16, "faction": "ALLY", "units": {"example_custom_unit": 10}},
                   {"x": 23, "y": 16, "faction": "ENEMY", "units": {"example_custom_unit": 11}}],
        "attack_point": [9, 16], "terrain_preset": "NARROW", "num_unit_types": 0,
        "ally_has_shields": false, "enemy_has_shields": false}"#;
    let scenario = Scenario::from_json(text, "example.json", folder.path()).unwrap();
    assert_eq!((scenario.n_agents(), scenario.n_enemies()), (10, 11));
    assert_eq!(scenario.unit_types[0].minimum_scan_range, 100.0);
}

#[test]
fn two_names_of_a_file_are_one_type() {
    let units = r#"{"scout": 1, "units/../scout.json": 1}"#;
    let (folder, _) = folder("scout", "");
    let groups = REQUIRED[3].1.replace(r#"{"ZEALOT": 1}"#, units);
    let text = file(&[("groups", &groups), ("num_allied_units", "2")]);
    let scenario = Scenario::from_json(&text, "duel.json", folder.path()).unwrap();
    assert_eq!(scenario.unit_types.len(), 3);
    assert_eq!(scenario.units[0].unit_type, scenario.units[1].unit_type);
}

#[test]
fn a_bad_unit_file_is_named_with_its_scenario() {
    let (folder, _) = folder("scout", "");
    fs::write(folder.path().join("scout.json"), SCOUT.replace("45", "-45")).unwrap();
    let error = Scenario::load(&folder.path().join("duel.json")).unwrap_err().to_string();
    let (scout, duel) = (folder.path().join("scout.json"), folder.path().join("duel.json"));
    let (scout, duel) = (scout.display(), duel.display());
    let expected = format!(
        "{duel}:1:249: `groups[0].units.scout` refers to an invalid unit file, {scout}\n\
         {scout}:1:8: `hp` is -45, but must be a number from 0.001 to 1000000"
    );
    assert_eq!(error, expected);
}

/// Two problems of a unit file that two groups name, and problems in each part of the scenario.
#[test]
fn all_problems_of_a_scenario_and_its_unit_files_are_found() {
    let text = r#"{
  "name": "duel", "num_allied_units": 1, "num_enemy_units": 0,
  "groups": [
    { "x": 9, "y": 16, "faction": "ALY", "units": { "scout": 1, "ZEALTO": 2 } },
    { "x": 99, "y": 16, "faction": "ENEMY", "units": { "scout": 1.5, "MARINE": 1 }, "colour": "red" },
    { "x": 99, "faction": "ENEMY", "units": {} }
  ],
  "attack_point": [9, "y"],
  "terrain": ["___", "__X_"], "width": 3, "height": 2000,
  "num_unit_types": 2, "unit_type_ids": { "scout": 2, "MARIN": 0 },
  "ally_has_shields": 1
}"#;
    let scout = SCOUT.replace("45", "0").replace("armor", "armour");
    let scout = UnitFile { name: "scout".into(), keys: vec!["scout".into()], text: scout };
    let files = ScenarioFiles { source: "duel.json".into(), text: text.into(), unit_files: vec![scout] };
    let problems = files.scenario().unwrap_err();
    let found: Vec<_> = problems
        .list()
        .iter()
        .map(|problem| (problem.file.as_str(), problem.line.unwrap(), problem.path.as_str()))
        .collect();
    let duel = |line, path| ("duel.json", line, path);
    let expected = [
        duel(1, "enemy_has_shields"),
        duel(2, "num_enemy_units"),
        duel(4, "groups[0].faction"),
        duel(4, "groups[0].units.scout"),
        duel(4, "groups[0].units.ZEALTO"),
        duel(5, "groups[1].units.scout"),
        duel(5, "groups[1].colour"),
        duel(6, "groups[2].y"),
        duel(6, "groups[2].units"),
        duel(8, "attack_point[1]"),
        duel(9, "terrain[1]"),
        duel(9, "height"),
        duel(10, "unit_type_ids.scout"),
        duel(10, "unit_type_ids.MARIN"),
        duel(11, "ally_has_shields"),
        ("scout.json", 1, "armor"),
        ("scout.json", 1, "hp"),
        ("scout.json", 1, "armour"),
    ];
    assert_eq!(found, expected);
}

/// Without the folder that `custom_unit_path` names, another file could be meant.
#[test]
fn unit_files_are_not_searched_with_an_invalid_path() {
    let (_folder, loaded) = folder("scoutt", "1");
    let error = loaded.unwrap_err();
    assert!(error.contains("`custom_unit_path` is 1, ") && error.lines().count() == 1, "{error}");
}

#[test]
fn names_and_paths_that_lead_nowhere() {
    let cases = [
        (
            "2s3zz",
            "`2s3zz` is neither a standard scenario nor the path of a file, as in `./my_scenario.json`; did \
             you mean `2s3z`?",
        ),
        ("no/where.json", "no/where.json: cannot be read: No such file or directory"),
    ];
    for (name, message) in cases {
        assert_eq!(Scenario::resolve(name).unwrap_err().to_string(), message);
    }
}

/// A scenario with one unit per faction, on a square map of this side where every other square is blocked.
fn on_a_checkerboard(side: usize, unit: &str) -> String {
    let row =
        |y: usize| (0..side).map(|x| if (x + y).is_multiple_of(2) { '_' } else { 'X' }).collect::<String>();
    let rows: Vec<String> = (0..side).map(row).collect();
    let group =
        |x, faction| format!(r#"{{"x": {x}, "y": 0, "faction": {faction:?}, "units": {{{unit:?}: 1}}}}"#);
    let groups = format!("[{}, {}]", group(0, "ALLY"), group(2, "ENEMY"));
    let (side, rows) = (side.to_string(), format!("{rows:?}"));
    let map = [("terrain_preset", ""), ("terrain", &rows), ("width", &side), ("height", &side)];
    let units = [("groups", groups.as_str()), ("num_enemy_units", "1"), ("attack_point", "[0, 0]")];
    file(&[&map[..], &units[..]].concat())
}

/// A speed of 315, mistyped for 3.15, once allocated terabytes for obstacle edges in sight.
#[test]
fn a_unit_that_would_see_too_many_obstacles_is_refused() {
    let (folder, _) = folder("scout", "");
    let load = |side, scout: &str| {
        fs::write(folder.path().join("scout.json"), scout).unwrap();
        Scenario::from_json(&on_a_checkerboard(side, "scout"), "duel.json", folder.path())
            .map_err(|error| error.to_string())
    };
    let fast = SCOUT.replace("3.15", "315");
    let error = load(1024, &fast).unwrap_err();
    assert!(error.starts_with("duel.json:1:1052889: `groups[0].units.scout` refers to "), "{error}");
    let expected = "scout.json, where `speed` is 315, but must be at most 87.5 on this map: ground units see \
                    obstacles within `speed` plus half of `size`, and within more than 89 squares there are \
                    too many";
    assert!(error.ends_with(expected), "{error}");
    let error = load(1024, &SCOUT.replace("\"size\": 3", "\"size\": 300")).unwrap_err();
    assert!(
        error.contains("scout.json, where `size` is 300, but must be at most 178 on this map"),
        "{error}"
    );

    load(1024, SCOUT).unwrap();
    load(1024, &SCOUT.replace("3.15", "87.5")).unwrap();
    load(64, &fast).unwrap();
    let flying = fast.replacen('{', "{\"plane\": \"AIR\", ", 1);
    load(1024, &flying).unwrap();
}

/// A name of 1 MB was accepted and became part of every response of the pool.
#[test]
fn a_scenario_has_a_short_name() {
    let named = |name: &str| read(&[("name", &format!("{name:?}"))]).map(|scenario| scenario.name);
    assert_eq!(named(&"n".repeat(100)), Ok("n".repeat(100)));
    let shown = "n".repeat(60);
    let error = format!("`name` is \"{shown}...\", but must be a string of 1 to 100 bytes, on one line");
    assert_eq!(named(&"n".repeat(101)), Err(error));
    let error = "`name` is \"two?lines\", but must be a string of 1 to 100 bytes, on one line";
    assert_eq!(named("two\nlines"), Err(error.into()));
}

/// The files of the valid scenario with `changes`.
fn texts(changes: &[(&str, &str)], unit_files: Vec<UnitFile>) -> ScenarioFiles {
    ScenarioFiles { source: "duel.json".into(), text: file(changes), unit_files }
}

/// Units that start inside walls, and sides that nothing connects, were valid without a word.
#[test]
fn what_is_probably_a_mistake_is_a_warning() {
    let check = |changes: &[(&str, &str)], expected: &[&str]| {
        let files = texts(changes, Vec::new());
        files.scenario().expect("a valid scenario");
        let warnings = files.warnings();
        let messages: Vec<&str> = warnings.iter().map(|warning| warning.message.as_str()).collect();
        assert_eq!(messages, expected, "{changes:?}");
        assert!(warnings.iter().all(|warning| warning.file == "duel.json" && warning.line.is_some()));
    };
    let groups = |ally: &str, enemy: &str| {
        let group = |place: &str, faction: &str| {
            let (at, units) = place.split_once(' ').expect("a place and units");
            format!("{{{at}, \"faction\": \"{faction}\", \"units\": {{{units}}}}}")
        };
        format!("[{}, {}]", group(ally, "ALLY"), group(enemy, "ENEMY"))
    };
    let one = ("num_enemy_units", "1");
    let walled = groups(r#""x":9,"y":30 "ZEALOT":1"#, r#""x":23,"y":16 "ZEALOT":1"#);
    let in_wall = "`groups[0]` puts a ZEALOT at (9, 30), on a blocked square that it may never leave";
    check(&[("groups", &walled), one], &[in_wall]);
    let three = groups(r#""x":9,"y":30 "ZEALOT":3"#, r#""x":23,"y":16 "ZEALOT":1"#);
    let [allies, more] = [("num_allied_units", "3"), ("groups", three.as_str())];
    let warnings = texts(&[allies, more, one], Vec::new()).warnings();
    assert!(warnings[0].message.ends_with("never leave, and 2 more"), "{warnings:?}");
    // What flies may start on walls, and reaches everything.
    let flying = groups(r#""x":9,"y":30 "MEDIVAC":1"#, r#""x":23,"y":30 "MEDIVAC":1"#);
    check(&[("groups", &flying), one], &[]);

    let rows = ["______", "______", "______", "XXXXXX", "______", "______"];
    let sides = |rows: &[&str]| {
        let (width, height) = (rows[0].len().to_string(), rows.len().to_string());
        [("width", width), ("height", height), ("terrain", format!("{rows:?}"))]
    };
    let on_map = |rows: &[&str], units: &str, expected: &[&str]| {
        let groups = groups(&format!(r#""x":2,"y":1.5 {units}"#), r#""x":2,"y":5 "ZEALOT":1"#);
        let sides = sides(rows);
        let mut changes: Vec<(&str, &str)> = sides.iter().map(|(key, text)| (*key, text.as_str())).collect();
        changes.extend([("terrain_preset", ""), ("attack_point", "[1, 1]"), ("groups", &groups), one]);
        check(&changes, expected);
    };
    let separated = "`groups` are separated by walls: no path connects the agents with the enemies";
    on_map(&rows, r#""ZEALOT":1"#, &[separated]);
    on_map(&rows, r#""MEDIVAC":1"#, &[]);
    let with_gap = ["______", "______", "______", "XXX_XX", "______", "______"];
    on_map(&with_gap, r#""ZEALOT":1"#, &[]);
    let with_corner = ["______", "______", "______", "XXX_XX", "___X__", "_____X"];
    on_map(&with_corner, r#""ZEALOT":1"#, &[separated]);

    // A zealot cannot reach what flies.
    let helpless = groups(r#""x":9,"y":16 "MARINE":1,"ZEALOT":1"#, r#""x":23,"y":16 "MEDIVAC":1"#);
    let no_target =
        "`groups[0].units.ZEALOT` can attack none of the enemies: its `valid_targets` lack their planes";
    check(&[("num_allied_units", "2"), ("groups", &helpless), one], &[no_target]);
}

#[test]
fn an_invalid_scenario_has_problems_and_no_warnings() {
    assert_eq!(texts(&[("num_enemy_units", "7")], Vec::new()).warnings(), []);
    let (_, files) = ScenarioFiles::resolve("2s3z").unwrap();
    assert!(files.is_standard() && !texts(&[], Vec::new()).is_standard());
}

/// A generated scenario with one key replaced, and its problems.
fn generated_problems(from: &str, to: &str) -> String {
    let (_, files) = ScenarioFiles::resolve("terran_10_vs_11").unwrap();
    assert!(files.text.contains(from), "{from}");
    let text = files.text.replace(from, to);
    ScenarioFiles { text, ..files }.scenario().map_or_else(|problems| problems.to_string(), |_| String::new())
}

#[test]
fn bad_distributions_are_named_with_line_and_column() {
    for (from, to, expected) in [
        (
            "[0.45, 0.45, 0.1]",
            "[0.45, 0.45]",
            ":8:20: `teams.weights` is a list of length 2, but must be a list of 3",
        ),
        (
            "[0.45, 0.45, 0.1]",
            "[0.45, 0, 0.1]",
            ":8:27: `teams.weights[1]` is 0, but must be a number above 0",
        ),
        (
            "[0.45, 0.45, 0.1]",
            "[1e-300, 0.001, 1e6]",
            ":8:20: `teams.weights` must give the types that are not in `exception_unit_types` at least",
        ),
        (
            "[\"MEDIVAC\"]",
            "[\"ZEALOT\"]",
            ":9:34: `teams.exception_unit_types[0]` is \"ZEALOT\", but must be one of `unit_types`",
        ),
        (
            "[\"MEDIVAC\"]",
            "[\"MEDIVAC\", \"MARINE\", \"MARAUDER\"]",
            "must leave out at least one of `unit_types`",
        ),
        ("weighted_teams", "weighted_team", "did you mean `weighted_teams`?"),
        ("\"weighted_teams\"", "\"all_teams\"", "`teams.weights` is a key of another distribution"),
        ("\"p\": 0.5", "\"p\": 2", "`start_positions.p` is 2, but must be a number from 0 to 1"),
        (
            "\"surrounded_and_reflect\"",
            "\"reflect_position\"",
            "`start_positions.p` is a key of another distribution",
        ),
        (
            "\"attack_nearest\"",
            "\"nearest\"",
            "`opponent` is \"nearest\", but must be one of attack_move, attack_nearest",
        ),
        (
            "\"use_unit_ranges\": true",
            "\"prob_obs_enemy\": 1.5",
            "`smacv2.prob_obs_enemy` is 1.5, but must be a number from 0 to 1",
        ),
        ("\"use_unit_ranges\": true", "\"use_ranges\": true", "unknown key `smacv2.use_ranges`"),
        ("\"use_unit_ranges\": true", "\"obs_starcraft\": false", "leaves nothing to observe"),
        ("\"use_unit_ranges\": true", "\"reward_win\": -1000", "`reward_win` must be at least 0"),
        (
            "\"use_unit_ranges\": true",
            "\"health\": {\"lower_bound\": 1, \"upper_bound\": 0}",
            "`lower_bound` that is at most `upper_bound`",
        ),
        (
            "\"use_unit_ranges\": true",
            "\"health\": {\"lower_bound\": 1, \"upper_bound\": 1}",
            "`smacv2.health` must have a `lower_bound` below 1",
        ),
        ("\"MEDIVAC\": 2", "\"MARINES\": 2", "did you mean `MARINE`?"),
    ] {
        let problems = generated_problems(from, to);
        assert!(problems.contains(expected), "{to}: {problems:?} does not contain {expected:?}");
    }
    let types = "\"unit_types\": [\"MARINE\", \"MARAUDER\", \"MEDIVAC\"]";
    let all = &*format!("\"distribution\": \"all_teams\", {types} }}, \"x\": {{");
    let problems = generated_problems("\"distribution\": \"weighted_teams\",", all);
    assert!(problems.contains("`num_allied_units` is 10 and `num_enemy_units` 11"), "{problems}");
}

/// Units that found no place once began at one point, also off the map.
#[test]
fn units_that_do_not_fit_on_the_map_are_refused() {
    let with = |side: usize, starts: &str| {
        let rows = vec![format!("\"{}\"", "_".repeat(side)); side].join(", ");
        let map = format!("\"width\": {side}, \"height\": {side}, \"terrain\": [{rows}], \"name\"");
        let (_, files) = ScenarioFiles::resolve("terran_10_vs_11").unwrap();
        let begin = files.text.find("\"start_positions\"").unwrap();
        let end = begin + files.text[begin..].find('}').unwrap() + 1;
        let mut text = files.text.clone();
        text.replace_range(begin..end, &format!("\"start_positions\": {starts}"));
        let text = text.replace("\"terrain_preset\": \"FLAT\",", "").replace("\"name\"", &map);
        ScenarioFiles { text, ..files }.scenario()
    };
    let expected = "`start_positions` must leave room for 21 units on the map, of which none overlap";
    for starts in ["surrounded", "reflect_position", "surrounded_and_reflect"] {
        let starts = format!("{{\"distribution\": \"{starts}\"}}");
        for side in [1, 2, 3] {
            let problems = with(side, &starts).map_or_else(|found| found.to_string(), |_| String::new());
            assert!(problems.contains(expected), "{side}, {starts}: {problems:?}");
        }
        for side in [10, 16] {
            let scenario = with(side, &starts).unwrap_or_else(|problems| panic!("{side}: {problems}"));
            let plane_and_place = |i: usize| {
                let unit = &scenario.units[i];
                (scenario.unit_types[unit.unit_type].plane, unit.position)
            };
            let is_apart = |i: usize| (0..i).all(|other| plane_and_place(i) != plane_and_place(other));
            assert!((0..21).all(is_apart), "{side}, {starts}");
        }
    }
}

/// Only scaling needs a greatest return above 0, and the published code scales by any.
#[test]
fn smacv2_has_negative_points_where_they_are_not_scaled_by() {
    for options in
        ["\"reward_win\": -1000, \"reward_scale\": false", "\"reward_win\": -1000, \"published\": true"]
    {
        assert_eq!(generated_problems("\"use_unit_ranges\": true", options), "");
    }
}

/// Such weights once kept every reader drawing teams of medivacs alone for ever.
#[test]
fn rare_types_are_drawn_beside_exceptions_and_without_any() {
    for (weights, exceptions, expected) in [
        ("[0.0011, 1e-300, 1]", "[\"MEDIVAC\"]", ""),
        ("[1e-300, 1e-300, 1e6]", "[]", ""),
        ("[1e-300, 1e-300, 1e6]", "[\"MEDIVAC\"]", "`teams.weights` must give"),
    ] {
        let (_, files) = ScenarioFiles::resolve("terran_10_vs_11").unwrap();
        let text = files.text.replace("[0.45, 0.45, 0.1]", weights).replace("[\"MEDIVAC\"]", exceptions);
        let problems = ScenarioFiles { text, ..files }
            .scenario()
            .map_or_else(|found| found.to_string(), |_| String::new());
        assert!(problems.contains(expected) && problems.is_empty() == expected.is_empty(), "{problems}");
    }
}

#[test]
fn teams_take_the_place_of_groups() {
    let problems = generated_problems("\"start_positions\": {", "\"groups\": [], \"start_positions\": {");
    assert!(problems.contains("`groups` must be left out"), "{problems}");
    let without = "\"start\": {";
    let problems = generated_problems("\"start_positions\": {", without);
    assert!(problems.contains("`start_positions` is missing"), "{problems}");
}

/// Changed keys once sorted the units of all groups by name, which gave them other ids: MMM was another
/// battle.
#[test]
fn changed_keys_leave_everything_else_as_it_is() {
    for name in Scenario::standard_names().chain(Scenario::generated_names()) {
        let (scenario, files) = ScenarioFiles::resolve(name).unwrap();
        let changed = files.with_keys([("episode_limit".to_owned(), 7.into())]).scenario().unwrap();
        assert_eq!(changed, Scenario { episode_limit: Some(7), ..scenario }, "{name}");
    }
}

#[test]
fn reward_options_are_read_and_added_to_those_of_the_file() {
    let (_, files) = ScenarioFiles::resolve("3m").unwrap();
    let with = |files: &ScenarioFiles, rewards| files.with_keys([("rewards".to_owned(), rewards)]);
    let once = with(&files, serde_json::json!({ "reward_win": 50, "reward_sparse": true }));
    let twice = with(&once, serde_json::json!({ "reward_sparse": false, "reward_defeat": -1.5 }));
    let expected = Rewards { win: 50.0, defeat: -1.5, ..Rewards::DEFAULT };
    assert_eq!(twice.scenario().unwrap().rewards, expected);
    assert_eq!(with(&twice, serde_json::Value::Null).scenario().unwrap().rewards, Rewards::DEFAULT);
    let message = |rewards| with(&files, rewards).scenario().unwrap_err().to_string();
    for (rewards, expected) in [
        (serde_json::json!({ "win": 1 }), "unknown key `rewards.win`"),
        (serde_json::json!({ "reward_scale_rate": 0 }), "`rewards.reward_scale_rate` is 0, but must be"),
        (serde_json::json!({ "reward_win": -1 }), "`reward_win` must be at least 0"),
        (serde_json::json!([]), "`rewards`"),
    ] {
        let message = message(rewards);
        assert!(message.contains(expected), "{message}");
    }
    let both = files.with_keys(["rewards", "smacv2"].map(|key| (key.to_owned(), serde_json::json!({}))));
    let message = both.scenario().unwrap_err().to_string();
    assert!(message.contains("`rewards` must be left out beside `smacv2`"), "{message}");
}
