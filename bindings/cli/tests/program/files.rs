//! Scenario and unit files by the program: new, check, schema, serve.

use crate::kit::{Place, error, json, json_lines, output, run, warnings};
use serde_json::{Value, json};
use smaclite_scenarios::{Scenario, Terrain};
use std::fs;

/// A folder with `sniper.json`, which has two problems, and `duel.json`, which has one more.
fn invalid_files() -> Place {
    let folder = Place::new();
    output(&folder, "new unit sniper.json --like STALKER");
    output(&folder, "new scenario duel.json --agents 2xsniper --enemies 3xZEALOT,1xMEDIVAC");
    folder.change("sniper.json", |text| text.replace("\"hp\": 80", "\"hp\": 0"));
    folder.change("sniper.json", |text| text.replace("\"speed\"", "\"sped\""));
    folder.change("duel.json", |text| text.replace("\"MEDIVAC\": 1", "\"MEDIVAK\": 1"));
    folder
}

#[test]
fn check_reports_every_problem_with_its_position() {
    let folder = &invalid_files();
    output(folder, "new scenario valid.json");
    let message = error(folder, "check duel.json valid.json sniper.json", 1);
    let sniper = folder.join("sniper.json").canonicalize().expect("a path");
    let sniper = sniper.display();
    let of_the_unit = |file: &str| {
        format!(
            "{file}:1:1: `speed` is missing; it must be a number from 0 to 1000000\n\
             {file}:2:11: `hp` is 0, but must be a number from 0.001 to 1000000\n\
             {file}:8:5: unknown key `sped`; did you mean `speed`?\n"
        )
    };
    let expected = format!(
        "duel.json:6:58: `groups[0].units.sniper` refers to an invalid unit file, {sniper}\n\
         duel.json:7:73: `groups[1].units.MEDIVAK` is neither a standard unit type nor a unit file (tried \
         MEDIVAK.json); did you mean `MEDIVAC`?\n{}{}smaclite-pool: invalid files: 2 of 3\n",
        of_the_unit(&sniper.to_string()),
        of_the_unit("sniper.json")
    );
    assert_eq!(message, expected);
    // Other commands say the same.
    let shown = error(folder, "show duel.json", 1);
    assert!(shown.contains(&of_the_unit(&sniper.to_string())), "{shown}");
}

#[test]
fn check_prints_json() {
    let folder = &invalid_files();
    output(folder, "new scenario valid.json");
    folder.write("broken.json", "{\"hp\": 1,\n}");
    let done = run(folder, "check --json valid.json sniper.json broken.json absent.json");
    assert_eq!(done.status.code(), Some(1));
    let printed = String::from_utf8(done.stdout).expect("text");
    let lines = json_lines(&printed);
    let problem = |file, position: Option<(u32, u32)>, path, message| {
        let (line, column) = position.unzip();
        json!({ "file": file, "line": line, "column": column, "path": path, "message": message })
    };
    let expected = [
        json!({
            "file": "valid.json", "valid": true, "kind": "scenario", "n_agents": 3, "n_enemies": 3,
            "n_actions": 9, "obs_size": 30, "state_size": 48, "episode_limit": 120, "problems": [],
            "n_problems": 0, "warnings": [],
        }),
        json!({
            "file": "sniper.json", "valid": false, "kind": "unit", "n_problems": 3, "problems": [
                problem("sniper.json", Some((1, 1)), "speed",
                    "`speed` is missing; it must be a number from 0 to 1000000"),
                problem("sniper.json", Some((2, 11)), "hp",
                    "`hp` is 0, but must be a number from 0.001 to 1000000"),
                problem("sniper.json", Some((8, 5)), "sped", "unknown key `sped`; did you mean `speed`?"),
            ],
        }),
        json!({
            "file": "broken.json", "valid": false, "kind": null, "n_problems": 1,
            "problems": [problem("broken.json", Some((2, 1)), "", "remove the comma before `}`")],
        }),
        json!({
            "file": "absent.json", "valid": false, "kind": null, "n_problems": 1,
            "problems": [problem("absent.json", None, "",
                "cannot be read: No such file or directory")],
        }),
    ];
    assert_eq!(lines, expected);
}

/// `check` found nothing wrong with units inside walls, two of which could never move.
#[test]
fn check_warns_of_what_is_probably_a_mistake() {
    let folder = &Place::new();
    output(folder, "new scenario wall.json");
    // In the wall of the north.
    folder.change("wall.json", |text| text.replace("\"x\": 9, \"y\": 16", "\"x\": 9, \"y\": 28"));
    let expected = "warning: `groups[0]` puts a MARINE at (";
    for command in ["check wall.json", "record wall.json --out a.smreplay"] {
        let message = warnings(folder, command);
        assert!(message.starts_with("wall.json:") && message.contains(expected), "{command}: {message}");
    }
    let printed: Value = json(folder, "check wall.json --json");
    assert_eq!((&printed["valid"], &printed["warnings"][0]["path"]), (&json!(true), &json!("groups[0]")));
}

#[test]
fn new_files_are_valid_on_every_map() {
    let folder = &Place::new();
    for map in Terrain::preset_names().filter(|map| *map != "CHECKERBOARD") {
        let file = format!("{map}.json");
        output(folder, &format!("new scenario {file} --map {map} --agents 5xSTALKER,7xZEALOT"));
        let scenario = Scenario::load(&folder.join(file)).expect("a scenario");
        assert_eq!(scenario.terrain, Terrain::preset(map).expect("a preset"));
        for unit in &scenario.units {
            let [x, y] = unit.position.map(|coordinate| coordinate as i64);
            assert!(scenario.terrain.is_walkable(x, y), "{map}: a unit starts on a blocked square");
        }
        let options = format!("{map}.json --policy nearest --out {map}.smreplay");
        let recorded = output(folder, &format!("record {options}"));
        assert!(recorded.contains("won after "), "{map}: no way to the enemies: {recorded}");
    }
}

#[test]
fn a_new_generated_scenario_draws_the_units_that_were_asked_for() {
    let folder = &Place::new();
    let options = "--generated --agents 3xSTALKER,2xZEALOT --enemies 7xZEALOT --map FLAT";
    output(folder, &format!("new scenario a.json {options}"));
    let scenario = Scenario::load(&folder.join("a.json")).expect("a scenario");
    assert_eq!((scenario.n_agents(), scenario.n_enemies()), (5, 7));
    let shown = output(folder, "show a.json --samples 3 --seed 5");
    assert_eq!(
        shown
            .matches("drawn for each episode: STALKER 60 %, ZEALOT 40 %; reflected (50 %) or surrounded")
            .count(),
        3
    );
    assert!(shown.contains("seed 5\n") && shown.contains("seed 7\n"), "{shown}");
    assert_eq!(output(folder, "show a.json --samples 3 --seed 5"), shown, "a seed gives the same draws");
    output(folder, "show a.json --samples 4 --png draws.png");
    folder.fails("show 2s3z --samples 2", 1, "--samples is for generated scenarios; `2s3z` is none");
    let fair = "`teams.distribution` is \"fair\", but must be one of weighted_teams, all_teams, fixed";
    folder.fails(r#"serve a.json --set teams={"distribution":"fair"}"#, 1, fair);
    let example = r#"must be JSON, got `reflect`; as an example: --set 'start_positions={"distribution":""#;
    folder.fails("serve a.json --set start_positions=reflect", 2, example);
    // The zealots were dropped without a word.
    let dropped = "--enemies has ZEALOT, but --generated draws both teams from the types of --agents: MARINE";
    folder.fails("new scenario b.json --generated --agents 2xMARINE --enemies 2xZEALOT", 1, dropped);
    assert!(!folder.join("b.json").exists());
    output(folder, "new scenario b.json --generated --agents 2xZEALOT");
    let listed = output(folder, "scenarios");
    assert_eq!(listed.matches("drawn for each episode").count(), 15, "{listed}");
}

#[test]
fn a_new_scenario_has_the_units_that_were_asked_for() {
    let folder = &Place::new();
    output(folder, "new unit sniper.json");
    let options = "--agents 2xsniper,1xMEDIVAC,1xsniper --enemies 4xZEALOT";
    let printed = output(folder, &format!("new scenario a.json {options}"));
    let expected = "wrote a.json: scenario: 4 agents against 4 enemies, ";
    assert!(printed.starts_with(expected), "{printed}");
    let scenario = Scenario::load(&folder.join("a.json")).expect("a scenario");
    let names: Vec<_> =
        scenario.units.iter().map(|unit| &*scenario.unit_types[unit.unit_type].name).collect();
    assert_eq!(names[..4], ["sniper", "sniper", "sniper", "MEDIVAC"]);
    assert_eq!((scenario.ally_has_shields, scenario.enemy_has_shields), (false, true));
    assert_eq!((scenario.num_unit_types, scenario.type_ids), (3, vec![0, 1, 2]));
    output(folder, "record a.json --policy focus_fire --out a.smreplay");
}

#[test]
fn what_cannot_be_written_is_an_error() {
    let folder = &Place::new();
    folder.write("mine.json", "my work");
    let check = |arguments: &str, status, expected: &str| folder.fails(arguments, status, expected);
    for kind in ["scenario", "unit"] {
        check(&format!("new {kind} mine.json"), 1, "mine.json: exists; FILE must be a new file");
        check(&format!("new {kind} mine"), 1, "FILE must end in .json, as `mine.json` does, got `mine`");
        check(&format!("new {kind} absent/a.json"), 1, "absent/a.json: No such file or directory");
    }
    assert_eq!(folder.read("mine.json"), "my work");
    let name = "FILE must not have the name of a standard unit type, got `MARINE`";
    check("new unit MARINE.json", 1, name);
    check("new unit a.json --like MARIN", 2, "MARINE");
    check("new scenario a.json --map SIMPEL", 2, "SIMPLE");
    for units in ["MARINE", "0xMARINE", "1001xMARINE", "x", "3x"] {
        check(&format!("new scenario a.json --agents {units}"), 2, "must be NUMBERxTYPE, as in 3xMARINE");
    }
    check("new scenario a.json --agents 3xMARIN", 1, "did you mean `MARINE`?");
    check("new scenario a.json --agents 900xMARINE", 1, "outside the 32 x 32 map");
    assert!(!folder.join("a.json").exists());
}

#[test]
fn schemas_are_printed() {
    let folder = &Place::new();
    for (kind, title) in [("scenario", "Scenario"), ("unit", "Unit type")] {
        let schema: Value = json(folder, &format!("schema {kind}"));
        assert_eq!(schema["title"], title);
    }
}

/// `lr=0.1/s.json` was a lane `lr` of the scenario `0.1/s.json`.
#[test]
fn paths_with_the_signs_of_lanes_are_served() {
    let place = &Place::new();
    fs::create_dir(place.join("lr=0.1")).expect("a folder");
    run(place, "new scenario lr=0.1/s.json");
    fs::copy(place.join("lr=0.1/s.json"), place.join("a:b.json")).expect("a copy");
    let _pool = place.serve("lr=0.1/s.json:4 second=a:b.json third=lr=0.1/s.json:2 --name paths");
    let listed = String::from_utf8_lossy(&run(place, "list --json").stdout).into_owned();
    assert!(["\"second\"", "\"third\""].iter().all(|lane| listed.contains(lane)), "{listed}");
}
