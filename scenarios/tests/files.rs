//! Custom scenario files: what is accepted, where unit files are found, and the message for everything
//! refused.

use smaclite_scenarios::{Faction, Problems, Rewards, Scenario, ScenarioFiles, UnitFile};
use std::fs;
use std::path::Path;

#[path = "../../units/tests/messages/mod.rs"]
mod messages;

fn valid() -> Vec<(String, String)> {
    messages::valid("Scenario files")
}

/// The valid file of the page with `changes`; an empty value leaves the key out.
fn file(changes: &[(&str, &str)]) -> String {
    messages::file(&valid(), changes)
}

/// The groups of the valid file.
fn groups() -> String {
    let valid = valid();
    valid.into_iter().find(|(key, _)| key == "groups").expect("groups").1
}

fn read(changes: &[(&str, &str)]) -> Result<Scenario, String> {
    Scenario::from_json(&file(changes), "duel.json", Path::new("")).map_err(all)
}

/// The messages of all problems, one per line, without files and positions.
fn all(problems: Problems) -> String {
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

#[test]
fn errors_say_what_is_accepted() {
    for part in ["Scenario files", "Maps", "Counts and types"] {
        for row in messages::rows(part) {
            let text = messages::file(&valid(), &messages::changes(&row[0]));
            let error =
                Scenario::from_json(&text, "duel.json", Path::new("")).map_err(all).expect_err(&row[1]);
            assert_eq!(error, row[1], "{}", row[0]);
        }
    }
}

#[test]
fn bad_groups() {
    let all = groups();
    let (allies, enemies) =
        all[1..].split_once("},\n").map(|(allies, rest)| (format!("{allies}}}"), rest)).unwrap();
    let enemies = enemies.trim_end_matches([']', '\n', ' ']);
    for row in messages::rows("Groups") {
        let groups = format!("[{}, {enemies}]", messages::code(&row[0]));
        assert_eq!(read(&[("groups", &groups)]).expect_err(&row[1]), row[1], "{}", row[0]);
    }
    let three = format!("[{allies}, {enemies}, {}]", allies.replace("ZEALOT", "MARINE"));
    let message = "`num_allied_units` is 1, but must be 2, the number of ALLY units in `groups`\n\
                   `groups[2]` puts a MARINE at (9, 16), where another GROUND unit starts; move the group";
    assert_eq!(read(&[("groups", &three)]), Err(message.into()));
    let one_side = format!("[{enemies}]");
    let message =
        "`groups` is a list of length 1, but must be a list with at least one group of faction ALLY";
    assert_eq!(read(&[("groups", &one_side)]), Err(message.into()));
}

const SCOUT: &str = r#"{"hp": 45, "armor": 0, "damage": 6, "cooldown": 3, "speed": 3.15, "attack_range": 3,
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
    let in_wall = "`groups[0]` puts a ZEALOT at (9, 30), on a blocked square that it may never leave; rules \
                   `starcraft` choose free squares";
    check(&[("groups", &walled), one], &[in_wall]);
    // No battle begins there.
    let drawn = ("start_positions", r#"{"distribution": "surrounded"}"#);
    check(&[("groups", &walled), one, drawn], &[]);
    let three = groups(r#""x":9,"y":30 "ZEALOT":3"#, r#""x":23,"y":16 "ZEALOT":1"#);
    let [allies, more] = [("num_allied_units", "3"), ("groups", three.as_str())];
    let warnings = texts(&[allies, more, one], Vec::new()).warnings();
    assert!(warnings[0].message.contains("never leave, and 2 more; rules"), "{warnings:?}");
    // What flies may start on walls, and reaches everything. Medivacs alone only heal.
    let harmless = "`groups` have no agent that attacks, so no battle can be won";
    let flying = groups(r#""x":9,"y":30 "MEDIVAC":1"#, r#""x":23,"y":30 "MEDIVAC":1"#);
    check(&[("groups", &flying), one], &[harmless]);

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
    on_map(&rows, r#""MEDIVAC":1"#, &[harmless]);
    let with_gap = ["______", "______", "______", "XXX_XX", "______", "______"];
    on_map(&with_gap, r#""ZEALOT":1"#, &[]);
    let with_corner = ["______", "______", "______", "XXX_XX", "___X__", "_____X"];
    on_map(&with_corner, r#""ZEALOT":1"#, &[separated]);

    // A zealot cannot reach what flies.
    let helpless = groups(r#""x":9,"y":16 "MARINE":1,"ZEALOT":1"#, r#""x":23,"y":16 "MEDIVAC":1"#);
    let no_target =
        "`groups[0].units.ZEALOT` can attack none of the enemies: its `valid_targets` lack their planes";
    check(&[("num_allied_units", "2"), ("groups", &helpless), one], &[no_target]);
    // Where starts are drawn, the units of the scenario have another order than those of the file.
    let other_order = groups(r#""x":9,"y":16 "ZEALOT":1,"MARINE":1"#, r#""x":23,"y":16 "MEDIVAC":1"#);
    let starts = ("start_positions", r#"{"distribution": "surrounded"}"#);
    check(&[("num_allied_units", "2"), ("groups", &other_order), starts, one], &[no_target]);
}

/// Only agents of groups were looked at.
#[test]
fn drawn_agents_that_can_attack_none_of_the_enemies_are_a_warning() {
    // It flies, and shoots at what is on the ground.
    let unit = SCOUT.replace("\"valid_targets\": []", r#""plane": "AIR", "valid_targets": ["GROUND"]"#);
    let bomber = || vec![UnitFile { name: "bomber".into(), keys: vec!["bomber".into()], text: unit.clone() }];
    let starts = ("start_positions", r#"{"distribution": "surrounded"}"#);
    let warnings = |teams: &str| -> Vec<String> {
        let changes = [("groups", ""), ("teams", teams), starts, ("num_enemy_units", "1")];
        let files = texts(&changes, bomber());
        files.scenario().expect("a valid scenario");
        files.warnings().into_iter().map(|warning| warning.message).collect()
    };
    let message = |key: &str| {
        let why = "which can attack none of the enemies: its `valid_targets` lack their planes";
        vec![format!("`teams.{key}` is a bomber, {why}")]
    };
    let all = r#"{"distribution": "all_teams", "unit_types": ["MEDIVAC", "bomber"]}"#;
    assert_eq!(warnings(all), message("unit_types[1]"));
    let fixed = r#"{"distribution": "fixed", "teams": [["MARINE"], ["bomber"], ["bomber"]]}"#;
    assert_eq!(warnings(fixed), message("teams[1][0]"));
    assert_eq!(warnings(&all.replace("MEDIVAC", "MARINE")), Vec::<String>::new());
}

/// Such a battle was over before its first step, and a recording of it was empty.
#[test]
fn sides_of_healers_alone_are_refused_with_the_interface_of_smacv2() {
    let [medivac, marine] = ["MEDIVAC", "MARINE"].map(|name| format!("\"units\": {{\"{name}\": 1}}"));
    let groups = |allies: &str, enemies: &str| {
        format!(
            r#"[{{"x": 9, "y": 16, "faction": "ALLY", {allies}}},
                {{"x": 23, "y": 16, "faction": "ENEMY", {enemies}}}]"#
        )
    };
    let refused = |changes: &[(&str, &str)], smacv2| {
        let one = [("num_enemy_units", "1"), ("smacv2", smacv2)];
        read(&[&one, changes].concat()).map_or_else(|problems| problems, |_| String::new())
    };
    let why = "healers alone, which have lost with `smacv2`; add a unit that fights";
    for (allies, enemies, side) in [(&medivac, &marine, "the agents"), (&marine, &medivac, "the enemies")] {
        let groups = groups(allies, enemies);
        assert_eq!(refused(&[("groups", &groups)], "{}"), format!("`groups` gives {side} {why}"));
        assert_eq!(refused(&[("groups", &groups)], ""), "");
    }
    let starts = ("start_positions", r#"{"distribution": "surrounded"}"#);
    let drawn = |teams: &str| refused(&[("groups", ""), ("teams", teams), starts], "{}");
    let weighted = r#"{"distribution": "weighted_teams", "unit_types": ["MEDIVAC"], "weights": [1]}"#;
    assert_eq!(drawn(weighted), format!("`teams.unit_types` gives both sides {why}"));
    let all = r#"{"distribution": "all_teams", "unit_types": ["MEDIVAC"]}"#;
    assert_eq!(drawn(all), format!("`teams.unit_types` gives both sides {why}"));
    let fixed = r#"{"distribution": "fixed", "teams": [["MARINE"], ["MEDIVAC"]]}"#;
    assert_eq!(drawn(fixed), format!("`teams.teams[1]` gives both sides {why}"));
    assert_eq!(drawn(r#"{"distribution": "fixed", "teams": [["MARINE"], ["ZEALOT"]]}"#), "");
    assert_eq!(drawn(&all.replace("[\"MEDIVAC\"", "[\"MEDIVAC\", \"MARINE\"")), "");
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
    for row in messages::rows("Generated scenarios") {
        let problems = generated_problems(&messages::code(&row[0]), &messages::code(&row[1]));
        let (_, message) = problems.split_once(".json:").expect(&row[2]);
        assert_eq!(message, row[2], "{}", row[1]);
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

/// Only `teams` replaced `groups`: a map could be given only beside `terrain_preset=null`.
#[test]
fn a_changed_key_replaces_the_one_that_excludes_it() {
    let rows = vec!["_".repeat(32); 32];
    let groups = serde_json::json!([
        { "x": 9, "y": 9, "faction": "ALLY", "units": { "MARINE": 3 } },
        { "x": 20, "y": 9, "faction": "ENEMY", "units": { "MARINE": 3 } },
    ]);
    let teams = serde_json::json!({ "distribution": "all_teams", "unit_types": ["MARINE"] });
    let starts = serde_json::json!({ "distribution": "surrounded" });
    let (_, files) = ScenarioFiles::resolve("3m").unwrap();
    let drawn = [("teams".to_owned(), teams), ("start_positions".to_owned(), starts)];
    let drawn = files.with_keys(drawn);
    assert!(drawn.scenario().unwrap().generation.is_some());
    let removed = serde_json::Value::Null;
    let again = drawn.with_keys([("groups".to_owned(), groups), ("start_positions".to_owned(), removed)]);
    assert!(again.scenario().unwrap().generation.is_none());
    // A place in the changed text would be one in no file.
    let in_wall = again.with_keys([("terrain".to_owned(), serde_json::json!(vec!["X".repeat(32); 32]))]);
    let warnings = in_wall.warnings();
    assert!(!warnings.is_empty() && warnings.iter().all(|warning| warning.line.is_none()), "{warnings:?}");
    let terrain = |rows: &[String]| ("terrain".to_owned(), serde_json::json!(rows));
    let preset = || ("terrain_preset".to_owned(), serde_json::Value::from("SIMPLE"));
    let sides = ["width", "height"].map(|side| (side.to_owned(), 40.into()));
    let larger = vec!["_".repeat(40); 40];
    let map = files.with_keys([terrain(&larger)].into_iter().chain(sides));
    assert_eq!(map.scenario().unwrap().terrain.width(), 40);
    assert_eq!(map.with_keys([preset()]).scenario().unwrap(), files.scenario().unwrap());
    for both in [[terrain(&rows), preset()], [preset(), terrain(&rows)]] {
        let message = files.with_keys(both).scenario().unwrap_err().to_string();
        assert!(message.contains("must be left out, because `terrain` defines the map"), "{message}");
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
