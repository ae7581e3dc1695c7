//! Scenarios with files of their own, and the teams that were trained in them.

use super::*;

const SCOUT: &str = r#"{"hp": 40, "armor": 0, "damage": 9, "cooldown": 1, "speed": 3, "attack_range": 5,
    "minimum_scan_range": 8, "size": 0.75, "attributes": ["LIGHT"], "valid_targets": ["GROUND"]}"#;

/// A scenario of two scouts against two marines, of which one unit is called by a path.
fn keep() -> String {
    let row = "_".repeat(32);
    json!({
        "name": "keep", "num_allied_units": 2, "num_enemy_units": 2, "attack_point": [8, 8],
        "groups": [
            {"x": 8, "y": 8, "faction": "ALLY", "units": {"units/scout.json": 2}},
            {"x": 14, "y": 8, "faction": "ENEMY", "units": {"MARINE": 2}},
        ],
        "width": 32, "height": 16, "terrain": vec![row; 16], "num_unit_types": 0,
        "ally_has_shields": false, "enemy_has_shields": false, "episode_limit": 50,
    })
    .to_string()
}

fn open(files: &[(&str, &str)]) -> Value {
    let files: Vec<_> = files.iter().map(|(name, text)| json!({"name": name, "text": text})).collect();
    json!({"type": "open_scenario", "files": files})
}

/// The text of `run.json` of a team with four hidden units.
fn run_of(setup: &BattleSetup) -> String {
    let mut run = serde_json::to_value(setup).unwrap();
    run["config"] = json!({"seed": 1, "hidden": [4]});
    run.to_string()
}

/// Scenario and unit files could not be opened together, and a scenario with unit files not at all.
#[test]
fn a_scenario_is_opened_together_with_its_unit_files() {
    let mut session = Session::default();
    let opened = ask(&mut session, open(&[("scout.json", SCOUT), ("keep.json", &keep())]));
    let source = opened["scenario"].as_str().unwrap_or_else(|| panic!("{opened}"));
    let begun = ask(&mut session, begin(source, "nearest", &[], &[]));
    assert_eq!((&begun["scenario"]["name"], &begun["source"]), (&json!("keep"), &json!(source)));
    assert_eq!(begun["scenario"]["types"][0]["name"], "scout");
    // What is changed at the start keeps the unit files.
    let moved = ask(&mut session, json!({"type": "move_unit", "unit": 0, "x": 3, "y": 3}));
    let moved = moved["scenario"].as_str().unwrap();
    assert_eq!(ask(&mut session, begin(moved, "nearest", &[], &[]))["scenario"]["types"][0]["name"], "scout");
    // A scenario that needs no other file is its text, as ever.
    let (_, files) = ScenarioFiles::resolve("3m").unwrap();
    let own = files.text.replace("3m", "mine");
    assert_eq!(ask(&mut session, open(&[("mine.json", &own)]))["scenario"], own);
    assert_eq!(ask(&mut session, open(&[("3m.json", &files.text)]))["scenario"], "3m");
}

#[test]
fn files_that_are_not_one_scenario_are_refused_with_the_reason() {
    let mut session = Session::default();
    let keep = keep();
    let refused = [
        (open(&[("keep.json", &keep)]), "open its unit files together with it"),
        (open(&[("keep.json", &keep), ("scot.json", SCOUT)]), "open its unit files together with it"),
        (open(&[("scout.json", SCOUT)]), "the scenario `scout.json` is not valid"),
        (open(&[("keep.json", &keep), ("scout.json", "{")]), "scout.json"),
        (
            open(&[("a.json", SCOUT), ("b.json", SCOUT)]),
            "open one scenario file, which has `groups` or `teams`",
        ),
        (open(&[("a.json", &keep), ("b.json", &keep)]), "got a.json, b.json"),
        (open(&[]), "got none"),
        (begin(r#"{"files": {}}"#, "nearest", &[], &[]), "the battle is not valid: missing field"),
    ];
    check_refused(&mut session, refused);
}

/// The page opened the team on the map that was shown before, because it knew of the team's map only the
/// name.
#[test]
fn a_team_knows_the_scenario_that_it_was_trained_in() {
    let mut session = Session::default();
    let opened = ask(&mut session, open(&[("scout.json", SCOUT), ("keep.json", &keep())]));
    let own: BattleSetup = serde_json::from_str(opened["scenario"].as_str().unwrap()).unwrap();
    let mut paper = BattleSetup::new(ScenarioFiles::resolve("3m").unwrap().1);
    paper.rules = "paper".parse().unwrap();
    let plain = BattleSetup { episode_limit: Some(60).into(), rules: Default::default(), ..paper.clone() };
    for (setup, source) in [(&own, None), (&paper, None), (&plain, Some("3m"))] {
        let add = team("a", &run_of(setup), &weights(setup, 4));
        let team = ask(&mut session, add)["teams"][0].clone();
        let given = team["source"].as_str().unwrap();
        assert!(source.is_none_or(|source| source == given), "{given}");
        let begun = ask(&mut session, begin(given, "a", &[], &[]));
        assert_eq!(begun["scenario"]["name"], team["scenario"]);
        assert_eq!((&begun["rules"], &begun["source"]), (&json!(setup.rules.to_string()), &json!(given)));
        assert_eq!(play(&mut session, 3)["steps"], 3);
        // After a replay of it, another battle is one of the same scenario, and the team plays it.
        actions(&mut session);
        let after = ask(&mut session, begin_episode(json!([])))["source"].clone();
        assert_eq!(ask(&mut session, begin(after.as_str().unwrap(), "a", &[], &[]))["type"], "begin_battle");
    }
}

#[test]
fn a_team_whose_scenario_cannot_be_opened_says_why() {
    let mut session = Session::default();
    let setup = BattleSetup::new(ScenarioFiles::resolve("3m").unwrap().1);
    let mut lacking = setup.clone();
    lacking.files.text = keep();
    let add = || team("a", &run_of(&lacking), &weights(&setup, 4));
    let reason = "the scenario in run.json of the team `a` is not valid";
    check_refused(&mut session, [(add(), reason), (add(), "units/scout.json")]);
}

/// The page played weights with flipped bits, which `smaclite-pool evaluate` refuses.
#[test]
fn weights_whose_checksum_differs_are_refused() {
    let (mut session, mut add) = (Session::default(), zoo_team("3m"));
    assert_eq!(ask(&mut session, add.clone())["type"], "add_team");
    let mut bytes = STANDARD.decode(add["weights"].as_str().unwrap()).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    add["weights"] = json!(STANDARD.encode(bytes));
    check_refused(&mut session, [(add, "the checksum differs, so they are damaged")]);
}
