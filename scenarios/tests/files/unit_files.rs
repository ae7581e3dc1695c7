//! Unit types of a scenario: where their files are found, and what is said of bad ones.

use crate::{file, groups};
use smaclite_scenarios::{Scenario, ScenarioFiles, UnitFile};
use std::fs;

pub const SCOUT: &str = r#"{"hp": 45, "armor": 0, "damage": 6, "cooldown": 3, "speed": 3.15,
    "attack_range": 3,
                        "size": 3, "attributes": [], "valid_targets": []}"#;

/// A folder with `units/scout.json`, `scout.json` of half the health, and a scenario that names `unit`.
fn folder(unit: &str, custom_unit_path: &str) -> (tempfile::TempDir, Result<Scenario, String>) {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("units")).unwrap();
    fs::write(folder.path().join("units/scout.json"), SCOUT).unwrap();
    fs::write(folder.path().join("scout.json"), SCOUT.replace("45", "20")).unwrap();
    let groups = groups().replace("\"ZEALOT\": 1", &format!("{unit:?}: 1"));
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
    let groups = groups().replace(r#"{"ZEALOT": 1}"#, units);
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
        "{duel}:2:56: `groups[0].units.scout` refers to an invalid unit file, {scout}\n\
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
