//! How units move, push each other, and leave walls.

use std::sync::Arc;

use glam::Vec2;
use serde_json::json;
use smaclite_engine::policy::Random;
use smaclite_engine::{Arena, Battle, Rules, Scratch};
use smaclite_scenarios::{Scenario, ScenarioFiles};

use super::{EAST, Field, NORTH, STOP, TARGET};

/// In recorded battles the steps of a medivac from rest on are 0.325, 0.904, 1.211 to 1.229, 1.156 to 1.221:
/// it accelerates, and brakes for the point two squares ahead.
#[test]
fn a_medivac_accelerates_as_recorded() {
    let mut field = Field::new(r#""MEDIVAC": 1, "MARINE": 1"#, r#""MARINE": 1"#);
    let mut steps = Vec::new();
    for _ in 0..4 {
        let from = field.battle.units().pos[0].x;
        steps.push(field.play(&[EAST, STOP])[7].pos[0].x - from);
    }
    for (step, recorded) in steps.iter().zip([0.325, 0.903, 1.22, 1.18]) {
        assert!((step - recorded).abs() < 0.02, "{steps:?}");
    }
}

/// Units whose group stands in a wide wall stayed there, without a move for the whole episode.
#[test]
fn units_leave_a_wall_however_wide_it_is() {
    let row = |y: i32| -> String {
        let is_wall = |x: i32| (2..30).contains(&x) && (2..30).contains(&y);
        (0..32).map(|x| if is_wall(x) { 'X' } else { '_' }).collect()
    };
    let units = json!({ "MARINE": 5 });
    let group = |side: &str, x: f64, y: f64| json!({ "x": x, "y": y, "faction": side, "units": units });
    let text = json!({
        "name": "walls", "num_allied_units": 5, "num_enemy_units": 5, "num_unit_types": 0,
        "ally_has_shields": false, "enemy_has_shields": false, "attack_point": [1, 1],
        "terrain": (0..32).map(row).collect::<Vec<_>>(),
        "groups": [group("ALLY", 12.0, 16.0), group("ENEMY", 31.0, 31.0)],
    });
    let files = ScenarioFiles { source: "walls.json".into(), text: text.to_string(), unit_files: Vec::new() };
    let scenario = files.scenario().expect("a scenario");
    let battle = Battle::new(Arc::new(Arena::new(&scenario, Rules::Starcraft)), 1);
    for at in &battle.units().pos {
        assert!(scenario.terrain.is_walkable(at.x.floor() as i64, at.y.floor() as i64), "{at}");
    }
}

/// Zealots at the start of corridor, around the first, and the way of each in the first step of a recorded
/// battle: the first is idle, and the last walks into it. The idle one in the north-west is pushed 0.3
/// squares north in the game, and here less.
#[test]
fn a_unit_that_walks_pushes_idle_ones_of_its_side_as_recorded() {
    let zealots = [
        ([0.0, 0.0], STOP, Some([-0.18, 0.87])),
        ([-0.94, 0.0], STOP, Some([0.0, 0.0])),
        ([-0.94, -0.94], EAST, Some([0.97, -0.1])),
        ([-0.94, 0.94], STOP, None),
        ([-1.88, 0.0], NORTH, Some([-0.06, 1.12])),
        ([0.06, -1.0], NORTH, Some([0.17, 1.04])),
    ];
    let mut field = Field::new(r#""ZEALOT": 6"#, r#""ZEALOT": 1"#);
    for (unit, ([x, y], ..)) in zealots.into_iter().enumerate() {
        field = field.place(unit, 10.0 + x, 16.0 + y);
    }
    let begin = field.battle.units().pos.clone();
    let end = field.play(&zealots.map(|(_, action, _)| action))[7].pos.clone();
    for (unit, (.., recorded)) in zealots.into_iter().enumerate() {
        let walked = end[unit] - begin[unit];
        let recorded = recorded.map_or(walked, Vec2::from);
        assert!((walked - recorded).length() < 0.06, "unit {unit} walked {walked}");
    }
}

/// Of three marines that walk side by side, the one in front turns north. Recorded: the one behind it loses
/// 0.14 squares of its way and the one that turns is pushed 0.07 to 0.12 squares east.
#[test]
fn units_that_walk_push_each_other_as_recorded() {
    let places = [[9.0, 16.0], [9.0, 15.3125], [9.6875, 16.0]];
    let mut field = Field::new(r#""MARINE": 3"#, r#""MARINE": 1"#);
    for (unit, [x, y]) in places.into_iter().enumerate() {
        field = field.place(unit, x, y);
    }
    let end = field.play(&[EAST, EAST, NORTH])[7].pos.clone();
    for (unit, recorded) in [[0.985, -0.02], [1.125, -0.01], [0.107, 1.096]].into_iter().enumerate() {
        let walked = end[unit] - Vec2::from(places[unit]);
        assert!((walked - Vec2::from(recorded)).length() < 0.06, "unit {unit} walked {walked}");
    }
}

/// Recorded units touch at the sum of their radii less 1/16, whether they walk or attack. Rules had a radius
/// per unit type for that, by which zealots overlapped by a third of their size.
#[test]
fn a_unit_that_attacks_stays_and_others_walk_around_it() {
    for (unit, apart) in [("MARINE", 0.6875), ("ZEALOT", 0.9375), ("MARAUDER", 1.0625)] {
        let mut field = Field::new(&format!(r#""{unit}": 2"#), r#""SPINE_CRAWLER": 1"#)
            .place(0, 20.0, 16.0)
            .place(1, 18.0, 16.1)
            .place(2, if unit == "ZEALOT" { 21.4 } else { 23.0 }, 16.0);
        field.play(&[TARGET, STOP]);
        let stands = field.battle.units().pos[0];
        let mut least = f32::INFINITY;
        for _ in 0..3 {
            for units in field.play(&[TARGET, EAST]) {
                assert_eq!(units.pos[0], stands, "{unit}: who attacks is pushed");
                least = least.min((units.pos[1] - stands).length());
            }
        }
        assert!(field.battle.units().pos[1].x > 20.0, "{unit}: it did not get past");
        assert!((least - apart).abs() < 0.02, "{unit}: centres are {least} apart");
    }
}

/// Random play pushes units against walls from all sides, also units that are wider than the way between
/// walls, and faster than a square per tick.
#[test]
fn no_unit_is_pushed_into_a_wall() {
    let unit = |size: f64, speed: f64| {
        format!(
            r#"{{ "hp": 4500, "armor": 0, "damage": 1, "cooldown": 1, "speed": {speed}, "attack_range": 1,
                "size": {size}, "valid_targets": ["GROUND"], "attributes": ["LIGHT"] }}"#
        )
    };
    let folder = tempfile::tempdir().expect("a folder");
    let walls = ["________________________", "XXXXXXXXXX_XXXXXXXXXXXXX"];
    let terrain: Vec<String> = (0..24).map(|row| walls[usize::from(row % 4 == 0)].to_string()).collect();
    for (size, speed) in [(0.75, 3.0), (0.2, 30.0), (1.8, 8.0), (3.5, 3.0)] {
        std::fs::write(folder.path().join("own.json"), unit(size, speed)).expect("a file");
        let json = serde_json::json!({ "name": "walls", "num_allied_units": 6, "num_enemy_units": 6,
            "groups": [
            { "x": 12, "y": 6, "faction": "ALLY", "units": { "own": 6 } },
            { "x": 12, "y": 14, "faction": "ENEMY", "units": { "own": 6 } } ],
            "custom_unit_path": ".", "terrain": terrain, "attack_point": [12, 2], "num_unit_types": 0,
            "ally_has_shields": false, "enemy_has_shields": false, "width": 24, "height": 24 });
        let scenario = Scenario::from_json(&json.to_string(), "walls", folder.path()).expect("valid");
        let mut battle = Battle::new(Arc::new(Arena::new(&scenario, Rules::Starcraft)), 1);
        let (mut player, mut actions) = (Random::new(3), vec![0; 6]);
        let is_wall = |at: &Vec2| {
            let (x, y) = (at.x.floor() as i64, at.y.floor() as i64);
            (0..24).contains(&x) && (0..24).contains(&y) && !scenario.terrain.is_walkable(x, y)
        };
        let mut begins = battle.units().pos.iter().map(is_wall).collect::<Vec<_>>();
        for _ in 0..100 {
            player.act(&battle, &mut actions);
            battle.step(&actions, &mut Scratch::new()).expect("available actions are legal");
            for (in_wall, at) in begins.iter_mut().zip(&battle.units().pos) {
                *in_wall &= is_wall(at);
                assert!(*in_wall || !is_wall(at), "a unit of size {size} is in a wall at {at}");
            }
        }
    }
}
