//! The problems of the files, as `smaclite-pool check` prints them, and where the units start.

use super::protocol::{CheckedFiles, Group, Summary};
use glam::Vec2;
use smaclite_engine::{Arena, Battle, BattleSetup, Rules};
use smaclite_scenarios::{Faction, MAX_UNITS, Placement, Problem, Problems, ScenarioFiles, formation};
use smaclite_units::file::{MAX_SCENARIO_BYTES, MAX_UNIT_BYTES};
use smaclite_units::{Keyword, UnitType};
use smaclite_view::page::types_info;
use std::sync::Arc;

pub(crate) fn check(files: &ScenarioFiles, groups: &[Group], seed: &str) -> CheckedFiles {
    let (problems, n_problems) = problems(files);
    let mut types = Types { files, keys: Vec::new(), types: Vec::new() };
    let mut free = MAX_UNITS as usize;
    let groups = groups.iter().map(|group| place(group, &mut types, &mut free)).collect();
    let summary = if problems.is_empty() { summary(files) } else { None };
    let drawn = drawn(files, &mut types, seed);
    let options = files.scenario().ok().and_then(|scenario| scenario.smacv2);
    let (warnings, types) = (files.warnings(), types_info(&types.types, options.as_ref()));
    CheckedFiles { problems, n_problems, warnings, summary, types, groups, drawn }
}

/// What is wrong with the scenario, and with unit files that it does not name yet; and how much that is, also
/// with what its readers do not list.
fn problems(files: &ScenarioFiles) -> (Vec<Problem>, usize) {
    let mut unlisted = 0;
    let mut listed = |problems: Problems| {
        unlisted += problems.n_problems() - problems.list().len();
        problems.list().to_vec()
    };
    let mut found = files.scenario().map_or_else(&mut listed, |_| Vec::new());
    for unit in &files.unit_files {
        let file = format!("{}.json", unit.name);
        if !found.iter().any(|problem| problem.file == file)
            && let Err(problems) = UnitType::from_json(&unit.text, &unit.name, &file)
        {
            found.extend(listed(problems));
        }
    }
    // Saved, they could not be opened again.
    let texts =
        files.unit_files.iter().map(|unit| (format!("{}.json", unit.name), &unit.text, MAX_UNIT_BYTES));
    for (file, text, most) in
        [(files.source.clone(), &files.text, MAX_SCENARIO_BYTES)].into_iter().chain(texts)
    {
        if text.len() as u64 > most {
            let message = format!("the file is larger than {} KiB", most >> 10);
            found.push(Problem { file, line: None, column: None, path: String::new(), message });
        }
    }
    let n_problems = found.len() + unlisted;
    (found, n_problems)
}

fn summary(files: &ScenarioFiles) -> Option<Summary> {
    let sizes = Arena::new(&files.scenario().ok()?, Rules::default()).sizes();
    Some(Summary {
        n_agents: sizes.n_agents,
        n_enemies: sizes.n_enemies,
        n_actions: sizes.n_actions,
        obs_size: sizes.obs_size,
        state_size: sizes.state_size,
    })
}

/// The units with which the first battle of a seed begins, in a valid generated scenario. A seed that is no
/// number is as good as 0.
fn drawn(files: &ScenarioFiles, types: &mut Types<'_>, seed: &str) -> Option<Vec<(usize, usize, f32, f32)>> {
    let (scenario, arena) = BattleSetup::new(files.clone()).arena().ok()?;
    scenario.generation.as_ref()?;
    let battle = Battle::new(Arc::new(arena), seed.parse().unwrap_or(0));
    let units = scenario.units.iter().zip(battle.types().zip(&battle.units().pos));
    let unit = |(unit, (unit_type, pos)): (&Placement, (usize, &Vec2))| {
        let index = types.index_of(&scenario.unit_types[unit_type]);
        (index, usize::from(unit.faction == Faction::Enemy), pos.x, pos.y)
    };
    Some(units.map(unit).collect())
}

/// The unit types that the groups name, and those that are drawn.
struct Types<'a> {
    files: &'a ScenarioFiles,
    keys: Vec<String>,
    types: Vec<UnitType>,
}

impl Types<'_> {
    /// The index of the type that a key names.
    fn index(&mut self, key: &str) -> Option<usize> {
        let known = self.keys.iter().position(|known| known == key);
        known.or_else(|| {
            self.types.push(self.files.unit_type(key)?);
            self.keys.push(key.to_owned());
            Some(self.types.len() - 1)
        })
    }

    /// The index of a type of the scenario, whose key is not known: it may have a folder.
    fn index_of(&mut self, unit_type: &UnitType) -> usize {
        let known = self.types.iter().position(|known| known.name == unit_type.name);
        known.unwrap_or_else(|| {
            self.types.push(unit_type.clone());
            self.keys.push(unit_type.name.clone());
            self.types.len() - 1
        })
    }
}

/// The units of a group, `[type, x, y]` each, as a battle begins with them; none if a type is unknown or if
/// there are more than `free` units.
fn place(group: &Group, types: &mut Types, free: &mut usize) -> Option<Vec<(usize, f64, f64)>> {
    let faction = Faction::from_name(&group.faction)?;
    let mut of_group = Vec::new();
    for (key, n) in &group.units {
        let index = types.index(key)?;
        let n = *n as usize;
        *free = free.checked_sub(n)?;
        of_group.extend(std::iter::repeat_n(index, n));
    }
    let radii: Vec<f64> = of_group.iter().map(|&index| types.types[index].radius()).collect();
    let positions = formation([group.x, group.y], faction, &radii);
    Some(of_group.into_iter().zip(positions).map(|(index, [x, y])| (index, x, y)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;
    use smaclite_scenarios::{Scenario, UnitFile};

    fn groups_of(files: &ScenarioFiles) -> Vec<Group> {
        let json: Value = serde_json::from_str(&files.text).unwrap();
        let group = |group: &Value| {
            // Types are in alphabetical order here, the only one that `Value` keeps.
            let units = group["units"].as_object().unwrap().iter();
            Group {
                x: group["x"].as_f64().unwrap(),
                y: group["y"].as_f64().unwrap(),
                faction: group["faction"].as_str().unwrap().to_owned(),
                units: units.map(|(key, n)| (key.clone(), n.as_u64().unwrap() as u32)).collect(),
            }
        };
        json["groups"].as_array().unwrap().iter().map(group).collect()
    }

    #[test]
    fn units_are_shown_where_battles_place_them() {
        for name in ["2s3z", "3s5z", "27m_vs_30m", "2c_vs_64zg", "6h_vs_8z", "corridor", "bane_vs_bane"] {
            let (scenario, files) = ScenarioFiles::resolve(name).unwrap();
            let groups = groups_of(&files);
            let checked = check(&files, &groups, "0");
            assert_eq!(checked.problems, [], "{name}");
            let placed: Vec<[f64; 2]> =
                checked.groups.into_iter().flat_map(Option::unwrap).map(|(_, x, y)| [x, y]).collect();
            let expected: Vec<[f64; 2]> = scenario.units.iter().map(|unit| unit.position).collect();
            assert_eq!(placed, expected, "{name}");
            assert_eq!(checked.summary.unwrap().n_agents, scenario.n_agents());
        }
    }

    #[test]
    fn a_seed_shows_the_teams_and_places_that_its_battle_begins_with() {
        let (scenario, files) = ScenarioFiles::resolve("zerg_5_vs_5").unwrap();
        let drawn = |seed: &str| check(&files, &[], seed).drawn.unwrap();
        let checked = check(&files, &[], "7");
        assert_eq!((checked.problems, checked.groups.len()), (Vec::new(), 0));
        assert_eq!(drawn("7"), drawn("7"));
        assert_ne!(drawn("7"), drawn("8"));
        assert_eq!(drawn("seven"), drawn("0"));
        let battle = Battle::new(Arc::new(Arena::new(&scenario, Rules::default())), 7);
        let places: Vec<Vec2> = drawn("7").iter().map(|(_, _, x, y)| Vec2::new(*x, *y)).collect();
        assert_eq!(places, battle.units().pos);
        let (_, fixed) = ScenarioFiles::resolve("2s3z").unwrap();
        assert!(check(&fixed, &[], "7").drawn.is_none());
    }

    #[test]
    fn groups_of_an_invalid_scenario_are_placed_as_far_as_their_types_are_known() {
        let scout = UnitFile { name: "scout".into(), keys: vec!["scout".into()], text: "{}".into() };
        let files = ScenarioFiles { source: "s.json".into(), text: "{".into(), unit_files: vec![scout] };
        let group = |units: &[(&str, u32)], faction: &str| Group {
            x: 4.0,
            y: 5.0,
            faction: faction.into(),
            units: units.iter().map(|(key, n)| ((*key).to_owned(), *n)).collect(),
        };
        let groups = vec![
            group(&[("MARINE", 1)], "ALLY"),
            group(&[("scout", 1)], "ALLY"),
            group(&[("ghost", 1)], "ALLY"),
            group(&[("ZEALOT", 1)], "NEUTRAL"),
            group(&[("ZEALOT", 1000)], "ENEMY"),
            group(&[("ZEALOT", 4_000_000_000)], "ENEMY"),
        ];
        let checked = check(&files, &groups, "0");
        assert_eq!(checked.groups, [Some(vec![(0, 4.0, 5.0)]), None, None, None, None, None]);
        assert_eq!(checked.types.len(), 2);
        let problems = checked.problems;
        assert_eq!((problems[0].file.as_str(), problems[0].line), ("s.json", Some(1)));
        assert_eq!((problems[1].file.as_str(), problems[1].path.as_str()), ("scout.json", "hp"));
        assert!(problems.len() > 3, "all of them: {problems:?}");
        assert!(checked.summary.is_none());
    }

    #[test]
    fn problems_have_the_words_of_the_reader() {
        let (_, mut files) = ScenarioFiles::resolve("2s3z").unwrap();
        files.text = files.text.replace("\"ZEALOT\": 3", "\"ZEALOT\": 0");
        let expected = Scenario::from_json(&files.text, &files.source, "".as_ref()).unwrap_err();
        assert_eq!(problems(&files), (expected.list().to_vec(), expected.n_problems()));
        assert_eq!(problems(&files).0[0].path, "groups[0].units.ZEALOT");
    }

    /// The page said that a file had 100 problems, whatever it had.
    #[test]
    fn problems_that_are_not_listed_are_counted() {
        let (_, mut files) = ScenarioFiles::resolve("2s3z").unwrap();
        let group = r#"{"x": 1, "y": 1, "faction": "ALLY", "units": {"GHOST": 1}},"#;
        files.text = files.text.replace("\"groups\": [", &format!("\"groups\": [{}", group.repeat(150)));
        let expected = files.scenario().unwrap_err();
        let checked = check(&files, &[], "0");
        assert_eq!((checked.problems.len(), checked.n_problems), (100, expected.n_problems()));
        assert!(checked.n_problems >= 150);
    }
}
