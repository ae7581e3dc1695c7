//! Custom scenario files: what is accepted, where unit files are found, and the message for everything
//! refused.

use serde_json::value::RawValue;
use smaclite_scenarios::{Faction, Problems, Rewards, Scenario, ScenarioFiles, UnitFile};
use std::path::Path;

mod drawn;
#[path = "../../../units/tests/messages/mod.rs"]
mod messages;
mod unit_files;

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
    check(&[("groups", &flying), one, drawn], &[harmless]);
    let healers = ("teams", r#"{"distribution": "fixed", "teams": [["MARINE"], ["MEDIVAC"]]}"#);
    let alone = "`teams.teams[1]` has no type that attacks, so none of its battles can be won";
    check(&[("groups", ""), one, healers, drawn], &[alone]);

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
    let drawn = [("num_allied_units", "2"), ("groups", &other_order), starts, one];
    check(&drawn, &[no_target]);
    check(&[&drawn[..], &[("attack_point", "")]].concat(), &[no_target]); // drawn positions need none
}

#[test]
fn an_invalid_scenario_has_problems_and_no_warnings() {
    assert_eq!(texts(&[("num_enemy_units", "7")], Vec::new()).warnings(), []);
    let (_, files) = ScenarioFiles::resolve("2s3z").unwrap();
    assert!(files.is_standard() && !texts(&[], Vec::new()).is_standard());
}

/// Changed keys once sorted the units of all groups by name, which gave them other ids: MMM was another
/// battle.
#[test]
fn changed_keys_leave_everything_else_as_it_is() {
    for name in Scenario::standard_names().chain(Scenario::generated_names()) {
        let (scenario, files) = ScenarioFiles::resolve(name).unwrap();
        let changed = files.with_keys([("episode_limit".to_owned(), 7)]).scenario().unwrap();
        assert_eq!(changed, Scenario { episode_limit: Some(7), ..scenario }, "{name}");
    }
}

/// Groups given to `make` were sorted by name, too: their units had other ids than those of the same groups
/// in a file.
#[test]
fn a_changed_key_says_what_it_says_in_a_file() {
    let groups = r#"[
        { "x": 9, "y": 9, "faction": "ALLY", "units": { "ZEALOT": 2, "STALKER": 1 } },
        { "x": 20, "y": 9, "faction": "ENEMY", "units": { "ZEALOT": 1 } }
    ]"#;
    let changes = [("groups", groups), ("num_allied_units", "3"), ("num_enemy_units", "1")];
    let in_file = texts(&changes, Vec::new()).scenario().unwrap();
    let given = changes.map(|(key, value)| (key.to_owned(), RawValue::from_string(value.into()).unwrap()));
    assert_eq!(texts(&[], Vec::new()).with_keys(given).scenario().unwrap(), in_file);
    assert_eq!(in_file.unit_types[in_file.units[0].unit_type].name, "ZEALOT");
}

/// Changed keys of a file that begins with a byte order mark had no effect.
#[test]
fn keys_of_a_file_with_a_byte_order_mark_change() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("marked.json");
    std::fs::write(&path, format!("\u{feff}{}", file(&[]))).unwrap();
    let (_, read) = ScenarioFiles::load(&path).unwrap();
    let marked = ScenarioFiles { text: format!("\u{feff}{}", file(&[])), ..texts(&[], Vec::new()) };
    for files in [read, marked] {
        let changed = files.with_keys([("episode_limit".to_owned(), 7)]).scenario().unwrap();
        assert_eq!(changed.episode_limit, Some(7));
    }
}

/// What knows types by their names took one for the other.
#[test]
fn two_unit_types_of_one_name_are_refused() {
    let scout = |key: &str| UnitFile {
        name: key.rsplit('/').next().expect("a name").into(),
        keys: vec![key.into()],
        text: unit_files::SCOUT.into(),
    };
    let message = |[one, other]: [&str; 2]| {
        let units = format!(r#"{{ "{one}": 1, "{other}": 1 }}"#);
        let groups = format!(
            r#"[{{ "x": 9, "y": 9, "faction": "ALLY", "units": {units} }},
                {{ "x": 20, "y": 9, "faction": "ENEMY", "units": {{ "ZEALOT": 1 }} }}]"#
        );
        let changes = [("groups", groups.as_str()), ("num_allied_units", "2"), ("num_enemy_units", "1")];
        texts(&changes, [one, other].map(scout).into()).scenario().map_or_else(all, |_| String::new())
    };
    for (keys, what) in [
        (
            ["a/scout", "b/scout"],
            "b/scout` refers to scout.json, but scout.json is another type of the name scout",
        ),
        (
            ["MARINE", "a/MARINE"],
            "a/MARINE` refers to MARINE.json, but MARINE is another type of the name MARINE",
        ),
        (
            ["a/MARINE", "MARINE"],
            "MARINE` refers to MARINE, but MARINE.json is another type of the name MARINE",
        ),
    ] {
        let expected = format!("`groups[0].units.{what} in this scenario; rename a unit file");
        assert_eq!(message(keys), expected);
    }
    assert_eq!(message(["MARINE", "a/scout"]), "");
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
    // Those of the teams were drawn for the groups, too, whose own positions then meant nothing.
    let again = drawn.with_keys([("groups".to_owned(), groups)]);
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
    // Of two values of an option given together the second counted, which is an error in a file.
    let twice = RawValue::from_string(r#"{ "reward_win": 1, "reward_win": 2 }"#.into()).unwrap();
    for files in [&files, &once] {
        let twice = files.with_keys([("rewards".to_owned(), &twice)]);
        let message = twice.scenario().unwrap_err().to_string();
        assert!(message.contains("key `reward_win` is duplicate"), "{message}");
    }
    let both = files.with_keys(["rewards", "smacv2"].map(|key| (key.to_owned(), serde_json::json!({}))));
    let message = both.scenario().unwrap_err().to_string();
    assert!(message.contains("`rewards` must be left out beside `smacv2`"), "{message}");
}
