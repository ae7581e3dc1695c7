//! Rules `starcraft` in battles of a few units: the clock, the phases of attacks, and what only these rules
//! read. What holds in every battle is in `properties`, for all rule sets.

mod attacks;
mod bodies;
mod starts;

use std::sync::Arc;

use glam::Vec2;
use serde_json::json;
use smaclite_engine::policy::Random;
use smaclite_engine::{Arena, Battle, BattleSetup, ExecutionOrder, Rules, Scratch, Snapshot, Units, action};
use smaclite_scenarios::{Scenario, ScenarioFiles};

use crate::few_units::few_units;

const STOP: i32 = action::STOP as i32;
const EAST: i32 = action::EAST as i32;
const NORTH: i32 = action::NORTH as i32;
const WEST: i32 = action::WEST as i32;
const TARGET: i32 = action::FIRST_TARGET as i32;

/// A battle of a few units on open ground, whose first unit is an agent.
struct Field {
    battle: Battle,
    snapshot: Snapshot,
}

impl Field {
    /// Units are given as in a scenario file: `"MARINE": 2`.
    fn new(agents: &str, enemies: &str) -> Field {
        let battle = few_units(Rules::Starcraft, agents, enemies);
        Field { snapshot: battle.save(), battle }
    }

    fn place(mut self, unit: usize, x: f32, y: f32) -> Field {
        self.snapshot.units.pos[unit] = Vec2::new(x, y);
        self.battle.restore(&self.snapshot).expect("a snapshot of this battle");
        self
    }

    /// Plays a step; returns the units after each tick.
    fn play(&mut self, actions: &[i32]) -> Vec<Units> {
        let mut ticks = Vec::new();
        let observe = |tick: smaclite_engine::Tick<'_>| ticks.push(tick.units.clone());
        let step = self.battle.step_observed(actions, ExecutionOrder::Drawn, &mut Scratch::new(), observe);
        step.expect("legal actions");
        ticks
    }

    /// The ticks, from 1 on, in which a unit lost health or shield.
    fn hits(&mut self, unit: usize, actions: &[i32], n_steps: usize) -> Vec<usize> {
        let vitality = |units: &Units| units.hp[unit] + units.shield[unit];
        let mut last = vitality(self.battle.units());
        let mut hits = Vec::new();
        for tick in (0..n_steps).flat_map(|_| self.play(actions)).enumerate() {
            let now = vitality(&tick.1);
            if now < last {
                hits.push(tick.0 + 1);
            }
            last = now;
        }
        hits
    }
}

#[test]
fn a_step_is_half_a_second_of_the_games_clock() {
    for (unit, squares) in [("MARINE", 1.125), ("STALKER", 1.4766), ("ZEALOT", 1.125)] {
        let mut field = Field::new(&format!(r#""{unit}": 1"#), r#""MARINE": 1"#);
        let from = field.battle.units().pos[0].x;
        let to = field.play(&[EAST])[7].pos[0].x;
        assert!((to - from - squares).abs() < 1e-3, "{unit} walked {}", to - from);
    }
}

/// Keys that only these rules read once must not reach the others: their battles are recorded to the bit.
#[test]
fn other_rules_take_no_notice_of_the_keys_of_starcraft() {
    let file = |keys: &str| {
        format!(
            r#"{{ "hp": 45, "armor": 0, "damage": 6, "cooldown": 0.61, "speed": 3.15, "attack_range": 5,
                "size": 0.75, "valid_targets": ["GROUND"], "attributes": ["LIGHT"]{keys} }}"#
        )
    };
    let keys = r#", "damage_point": 0.2, "backswing": 0.5, "min_random_delay": -0.1, "max_random_delay": 0.2,
        "range_slop": 1, "hit_interval": 0.1, "projectile_speed": 9, "effect_delay": 0.2, "acceleration": 2,
        "explodes_when_killed": false"#;
    let folder = tempfile::tempdir().expect("a folder");
    let end = |keys: &str, rules: Rules| {
        std::fs::write(folder.path().join("own.json"), file(keys)).expect("a file");
        let json = r#"{ "name": "few", "num_allied_units": 3, "num_enemy_units": 3, "groups": [
            { "x": 12, "y": 16, "faction": "ALLY", "units": { "own": 3 } },
            { "x": 18, "y": 16, "faction": "ENEMY", "units": { "own": 3 } } ],
            "custom_unit_path": ".", "terrain_preset": "SIMPLE", "attack_point": [9, 16],
            "num_unit_types": 0, "ally_has_shields": false, "enemy_has_shields": false }"#;
        let scenario = Scenario::from_json(json, "few", folder.path()).expect("a valid scenario");
        let mut battle = Battle::new(Arc::new(Arena::new(&scenario, rules)), 1);
        let (mut player, mut actions) = (Random::new(3), vec![0; 3]);
        for _ in 0..40 {
            player.act(&battle, &mut actions);
            battle.step(&actions, &mut Scratch::new()).expect("available actions are legal");
        }
        battle.save().units
    };
    for rules in [Rules::Smaclite, Rules::Paper] {
        assert_eq!(end(keys, rules), end("", rules));
    }
    assert_ne!(end(keys, Rules::Starcraft), end("", Rules::Starcraft));
}

/// What was said of battles was true under the rules of SMAClite only: here colossi walk over walls, and no
/// unit starts inside one.
#[test]
fn warnings_are_those_of_the_rules() {
    let warnings = |unit: &str, [x, y]: [f64; 2]| {
        let rows: Vec<String> = (0..32).map(|y| if y == 15 { "X" } else { "_" }.repeat(32)).collect();
        let group =
            |faction, [x, y]: [f64; 2]| json!({"x": x, "y": y, "faction": faction, "units": {unit: 1}});
        let file = json!({
            "name": "walls", "num_allied_units": 1, "num_enemy_units": 1,
            "groups": [group("ALLY", [x, y]), group("ENEMY", [9.0, 25.0])], "terrain": rows,
            "attack_point": [9, 9], "num_unit_types": 0, "ally_has_shields": false, "enemy_has_shields": false
        });
        let (source, text) = ("walls.json".to_owned(), file.to_string());
        let files = ScenarioFiles { source, text, unit_files: Vec::new() };
        Rules::ALL.map(|rules| {
            let setup = BattleSetup { rules, ..BattleSetup::new(files.clone()) };
            setup.arena().expect("a valid scenario");
            setup.warnings().into_iter().map(|warning| warning.message).collect::<Vec<_>>()
        })
    };
    let separated = "`groups` are separated by walls: no path connects the agents with the enemies";
    let [smaclite, paper, starcraft] = warnings("COLOSSUS", [9.0, 5.0]);
    assert!(smaclite == [separated] && paper == [separated] && starcraft.is_empty(), "{starcraft:?}");
    assert_eq!(warnings("MARINE", [9.0, 5.0]), [[separated]; 3]);
    let [smaclite, paper, starcraft] = warnings("MARINE", [9.5, 15.5]);
    assert!(smaclite[0].contains("on a blocked square") && paper == smaclite && starcraft.is_empty());
}
