//! Drawn teams, and the interface of SMACv2: what is refused, and what is probably a mistake.

use crate::unit_files::SCOUT;
use crate::{messages, read, texts};
use smaclite_scenarios::{ScenarioFiles, UnitFile};

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
