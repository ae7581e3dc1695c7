//! Rules `starcraft` in battles of a few units: the clock, the phases of attacks, and what only these rules
//! read. What holds in every battle is in `properties`, for all rule sets.

use std::path::Path;
use std::sync::Arc;

use glam::Vec2;
use serde_json::json;
use smaclite_engine::policy::{Random, Tactic};
use smaclite_engine::{
    Arena, Battle, BattleSetup, ExecutionOrder, NeighbourOrder, Opponent, Rules, Scratch, Snapshot, Units,
    action,
};
use smaclite_scenarios::{Faction, Placement, Scenario, ScenarioFiles};
use smaclite_units::{Plane, UnitType};

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
        let count = |units: &str| -> u32 {
            let counts =
                units.split(',').filter_map(|unit| unit.rsplit(':').next()?.trim().parse::<u32>().ok());
            counts.sum()
        };
        let json = format!(
            r#"{{ "name": "few", "num_allied_units": {}, "num_enemy_units": {}, "groups": [
                {{ "x": 9, "y": 16, "faction": "ALLY", "units": {{ {agents} }} }},
                {{ "x": 23, "y": 16, "faction": "ENEMY", "units": {{ {enemies} }} }} ],
                "terrain_preset": "SIMPLE", "attack_point": [9, 16], "num_unit_types": 0,
                "ally_has_shields": false, "enemy_has_shields": false }}"#,
            count(agents),
            count(enemies),
        );
        let scenario = Scenario::from_json(&json, "few", Path::new(".")).expect("a valid scenario");
        let battle = Battle::new(Arc::new(Arena::new(&scenario, Rules::Starcraft)), 1);
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

#[test]
fn hits_come_at_the_damage_point_and_projectiles_fly() {
    // A damage point of 0.05 s is one tick after the tick in which the attack begins.
    let mut marine =
        Field::new(r#""MARINE": 1"#, r#""MARAUDER": 1"#).place(0, 10.0, 16.0).place(1, 15.5, 16.0);
    assert_eq!(marine.hits(1, &[TARGET], 1), [2]);
    // 0.167 s are 2.7 ticks; then 18.75 squares per second over 4.3 squares to the edge: 3.7 ticks.
    let mut stalker =
        Field::new(r#""STALKER": 1"#, r#""ZEALOT": 1"#).place(0, 10.0, 16.0).place(1, 14.8, 16.0);
    let hits = stalker.hits(1, &[TARGET], 1);
    assert_eq!(hits, [8], "3 ticks to the damage point after the first, and 4 in flight");
}

/// Units turned to their targets at once, so those that had walked away fired too soon.
#[test]
fn a_unit_turns_before_it_attacks() {
    let shot_after = |walk: i32| {
        let mut marine =
            Field::new(r#""MARINE": 1"#, r#""MARAUDER": 1"#).place(0, 10.0, 16.0).place(1, 14.0, 16.0);
        assert_eq!(marine.hits(1, &[walk], 1), [0; 0]);
        marine.hits(1, &[TARGET], 1)
    };
    // A turn is 62.5 degrees in a tick, and 11.25 may be left.
    assert_eq!([EAST, NORTH, WEST].map(|walk| shot_after(walk)[0]), [2, 3, 4]);
}

/// A target that walks out of range by less than the slop of the weapon is hit again from where the unit
/// stands; a unit that has not attacked it yet walks into its range first.
#[test]
fn a_target_that_was_attacked_is_attacked_again_from_farther_away() {
    let mut field =
        Field::new(r#""MARINE": 1"#, r#""MARAUDER": 1"#).place(0, 10.0, 16.0).place(1, 15.9, 16.0);
    field.hits(1, &[TARGET], 1);
    field.snapshot = field.battle.save();
    field.snapshot.units.phases[0].backswing = 0.0;
    let attacked = field.snapshot.units.phases[0].hit_target;
    assert_eq!(attacked, Some(1), "the marine has fired");
    for (last, walks) in [(attacked, false), (None, true)] {
        field.snapshot.units.phases[0].hit_target = last;
        let mut field = Field { battle: field.battle.clone(), snapshot: field.snapshot.clone() };
        field.snapshot.units.pos[0] = Vec2::new(10.0, 16.0);
        field = field.place(1, 15.98, 16.0);
        let x = field.play(&[TARGET])[0].pos[0].x;
        assert_eq!(x > 10.0, walks, "{last:?}: {x}");
    }
}

#[test]
fn a_zealot_strikes_twice_unless_it_gets_another_order() {
    let field = || Field::new(r#""ZEALOT": 1"#, r#""MARAUDER": 1"#).place(0, 10.0, 16.0).place(1, 11.1, 16.0);
    // 0.28 s are 4.5 ticks.
    assert_eq!(field().hits(1, &[TARGET], 1), [1, 6]);
    // With its next attack a blow is due in one step and the other in the next, in which it may walk away.
    let blows = |last: i32| {
        let mut zealot = field();
        let before = zealot.hits(1, &[TARGET], 3);
        (before, zealot.hits(1, &[last], 1).len())
    };
    let (before, after) = blows(TARGET);
    assert_eq!((before.len(), after), (3, 1), "the attack of this seed begins too early or late: {before:?}");
    assert_eq!(blows(EAST), (before, 0));
}

/// Zealots struck units that had walked away, and so lost no time with those that did: hydralisks that walked
/// at random died a fifth sooner than in SMAC, and no team won 6h_vs_8z or 2m_vs_1z.
#[test]
fn who_walks_out_of_a_zealots_reach_is_struck_once() {
    let struck = |x: f32| {
        let mut field =
            Field::new(r#""MARAUDER": 1"#, r#""ZEALOT": 1"#).place(0, 10.0, 16.0).place(1, 11.1, 16.0);
        let first = field.hits(0, &[STOP], 1);
        field.snapshot = field.battle.save();
        [first, field.place(0, x, 16.0).hits(0, &[STOP], 1)]
    };
    let [first, second] = struck(10.0);
    assert_eq!([first.len(), second.len()], [1, 1], "this seed strikes too early or late");
    // It reaches 0.2 squares from edge to edge, and stands while it strikes.
    assert_eq!(struck(9.5), [first, Vec::new()]);
}

/// The nearest three of recorded starts, and cells of those around them. Units started in rows, as in
/// SMAClite: 94 of 150 in the recorded square, now 143.
#[test]
fn units_start_where_recorded_ones_do() {
    let starts = |map: &str| {
        let scenario = Scenario::resolve(map).expect("a standard scenario");
        let battle = Battle::new(Arc::new(Arena::new(&scenario, Rules::Starcraft)), 1);
        battle.units().pos.clone()
    };
    let ring = [[9.0, 16.0], [9.0, 15.3125], [9.6875, 16.0], [9.0, 16.6875], [8.3125, 16.0]];
    let corners = [[9.75, 15.25], [9.75, 16.75], [8.25, 16.75]];
    let recorded: Vec<Vec2> = ring.into_iter().chain(corners).map(Vec2::from).collect();
    assert_eq!(starts("8m")[..8], recorded);
    let enemies: Vec<Vec2> = recorded.iter().map(|at| *at + Vec2::new(14.0, 0.0)).collect();
    assert_eq!(starts("8m")[8..], enemies, "moved, not mirrored");
}

#[test]
fn no_unit_starts_in_a_wall_or_in_another_one() {
    for map in Scenario::standard_names() {
        let scenario = Scenario::resolve(map).expect("a standard scenario");
        let arena = Arena::new(&scenario, Rules::Starcraft);
        let battle = Battle::new(Arc::new(arena), 1);
        let at = &battle.units().pos;
        let of = |unit: &Placement| {
            UnitType::starcraft(&scenario.unit_types[unit.unit_type].name).expect("a standard type")
        };
        for (i, unit) in scenario.units.iter().enumerate() {
            let [x, y] = at[i].to_array().map(|coordinate| coordinate.floor() as i64);
            let own = of(unit);
            assert!(own.plane != Plane::Ground || scenario.terrain.is_walkable(x, y), "{map}: {i} in a wall");
            for (j, other) in scenario.units[..i].iter().enumerate() {
                let other = of(other);
                let apart = (own.radius() + other.radius()) as f32 - 0.0651;
                let is_apart = own.plane != other.plane || at[i].distance(at[j]) >= apart;
                assert!(is_apart, "{map}: {i} and {j}");
            }
        }
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

#[test]
fn attacks_are_a_period_apart_with_a_random_delay() {
    let mut field =
        Field::new(r#""MARINE": 1"#, r#""MARAUDER": 1"#).place(0, 10.0, 16.0).place(1, 15.5, 16.0);
    let hits = field.hits(1, &[TARGET], 12);
    let periods: Vec<usize> = hits.windows(2).map(|pair| pair[1] - pair[0]).collect();
    // 0.8608 s, from 0.0625 less to 0.125 more, rounded to ticks. Recorded: 13 to 17, most often 14.
    assert!(periods.len() >= 4 && periods.iter().all(|period| (13..=17).contains(period)), "{periods:?}");
}

#[test]
fn a_baneling_that_is_killed_explodes() {
    let mut field = Field::new(r#""MARINE": 2"#, r#""BANELING": 1"#)
        .place(0, 10.0, 16.0)
        .place(1, 10.0, 14.0)
        .place(2, 11.2, 16.0);
    field.snapshot = field.battle.save();
    field.snapshot.units.hp[2] = 1.0;
    field.battle.restore(&field.snapshot).expect("a snapshot of this battle");
    let after = field.play(&[TARGET, STOP]);
    assert!(!after[7].alive[2]);
    // 20, and 15 more against light units.
    assert_eq!(after[7].hp[0], 10.0);
}

#[test]
fn enemies_keep_their_formation_and_stop_within_their_range() {
    let mut field = Field::new(r#""MARINE": 1"#, r#""MARINE": 1, "MARAUDER": 1"#)
        .place(1, 23.0, 16.0)
        .place(2, 23.8, 16.7);
    let offset = |units: &Units| units.pos[2] - units.pos[1];
    let (begin, mut last) = (offset(field.battle.units()), Vec2::ZERO);
    for _ in 0..5 {
        last = offset(&field.play(&[STOP])[7]);
    }
    assert!((begin - last).length() < 1e-3, "{begin} became {last}");
    let mut stood = None;
    while stood.is_none() {
        let ticks = field.play(&[STOP]);
        stood = stood.or(ticks.iter().find(|units| units.vel[1] == Vec2::ZERO).map(|units| units.pos[1]));
    }
    let gap = stood.expect("a marine that stands").x - field.battle.units().pos[0].x - 0.75;
    assert!((3.5..=5.0).contains(&gap), "{gap}");
}

/// Enemies stayed below the wall of 2c_vs_64zg and never came to the agents, so any team won.
#[test]
fn enemies_find_their_way_around_a_wall_to_agents_that_are_out_of_sight() {
    let scenario = Scenario::resolve("2c_vs_64zg").expect("a standard scenario");
    let mut battle = Battle::new(Arc::new(Arena::new(&scenario, Rules::Starcraft)), 1);
    let mut scratch = Scratch::new();
    let mut steps = 0;
    while battle.units().shield[0] + battle.units().shield[1] == 300.0 {
        steps += 1;
        assert!(steps < 40, "no enemy has come to the agents");
        battle.step(&[STOP; 2], &mut scratch).expect("legal actions");
    }
    // Straight, the nearest would need 4 steps.
    assert!(steps > 12, "they came through the wall, in {steps} steps");
}

/// In SMAC the zealot of 2m_vs_1z goes to a point between the marines that each episode draws.
#[test]
fn a_march_to_a_line_draws_its_point() {
    let scenario = Scenario::resolve("2m_vs_1z").expect("a standard scenario");
    let goal = |rules: Rules, seed: u64| {
        let mut battle = Battle::new(Arc::new(Arena::new(&scenario, rules)), seed);
        battle.step(&[STOP; 2], &mut Scratch::new()).expect("legal actions");
        battle.units().phases.last().map(|phase| phase.goal)
    };
    let goals: Vec<Vec2> = (0..40).filter_map(|seed| goal(Rules::Starcraft, seed)).collect();
    assert!(goals.iter().all(|goal| goal.y == 12.0 && (13.0..=19.0).contains(&goal.x)), "{goals:?}");
    let (low, high) =
        goals.iter().fold((19.0_f32, 13.0_f32), |(low, high), goal| (low.min(goal.x), high.max(goal.x)));
    assert!(low < 14.0 && high > 18.0, "{goals:?}");
    assert_eq!(goal(Rules::Smaclite, 0), None);
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

/// Each hit of a beam was a whole attack, so that three were nine.
#[test]
fn a_beam_that_hits_several_times_hits_once_each_time() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, keys: &str| {
        let text = format!(
            r#"{{ "hp": 1000, "armor": 0, "damage": 1, "speed": 0, "attack_range": 6, "cooldown": 1.5,
                "minimum_scan_range": 0, "size": 1, "valid_targets": ["GROUND"], "attributes": []{keys} }}"#
        );
        std::fs::write(folder.path().join(name), text).expect("a file");
    };
    let beam = r#", "attacks": 3, "targeter": "LASER_BEAM", "targeter_kwargs": { "width": 1, "height": 1 }"#;
    write("target.json", "");
    write("at_once.json", beam);
    write("apart.json", &format!(r#"{beam}, "hit_interval": 0.125"#));
    for unit in ["at_once", "apart"] {
        let json = format!(
            r#"{{ "name": "beam", "num_allied_units": 1, "num_enemy_units": 1, "groups": [
                {{ "x": 10, "y": 16, "faction": "ALLY", "units": {{ "{unit}": 1 }} }},
                {{ "x": 14, "y": 16, "faction": "ENEMY", "units": {{ "target": 1 }} }} ],
                "custom_unit_path": ".", "terrain_preset": "SIMPLE", "attack_point": [9, 16],
                "num_unit_types": 0, "ally_has_shields": false, "enemy_has_shields": false }}"#
        );
        let scenario = Scenario::from_json(&json, "beam", folder.path()).expect("a valid scenario");
        let mut battle = Battle::new(Arc::new(Arena::new(&scenario, Rules::Starcraft)), 1);
        for _ in 0..2 {
            battle.step(&[TARGET], &mut Scratch::new()).expect("available actions are legal");
        }
        assert_eq!(battle.units().hp[1], 997.0, "{unit}");
    }
}

/// Enemies that a script led on marched to the corner of the map, if something else had begun to play them.
#[test]
fn a_script_that_goes_on_leads_the_enemies_to_the_attack_point() {
    let mut field = Field::new(r#""MARINE": 1"#, r#""MARINE": 2"#).place(0, 2.0, 2.0);
    field.snapshot.units.pos[0] = Vec2::new(2.0, 2.0);
    field.snapshot.opponent = Opponent::Scripted(Tactic::Hold);
    field.battle.restore(&field.snapshot).expect("a snapshot of this battle");
    field.play(&[STOP]);
    let (mut snapshot, arena) = (field.battle.save(), field.battle.arena().clone());
    snapshot.units.alive[2] = false;
    snapshot.units.hp[2] = 0.0;
    snapshot.neighbour_order = NeighbourOrder::new(&arena, &snapshot.types, &snapshot.units);
    snapshot.play_on(&arena, Opponent::AttackMove);
    field.battle.restore(&snapshot).expect("a snapshot of this battle");
    assert_eq!(field.battle.units().phases[1].goal, Vec2::new(9.0, 16.0));
    let before = field.battle.units().pos[1];
    let after = field.play(&[STOP])[7].pos[1];
    assert!((before - after).x > 1.0 && (before - after).y.abs() < 0.2, "{before} became {after}");
}

/// Pairs of units of one number, of which one starts where the other does after half a turn of the map.
fn images(scenario: &Scenario, rules: Rules) -> usize {
    let arena = Arena::new(scenario, rules);
    let sides = [scenario.terrain.width(), scenario.terrain.height()].map(f64::from);
    let starts = |side: Faction| {
        let units = scenario.units.iter().enumerate().filter(move |(_, unit)| unit.faction == side);
        units.map(|(id, unit)| (unit.unit_type, arena.start(id))).collect::<Vec<_>>()
    };
    let (agents, enemies) = (starts(Faction::Ally), starts(Faction::Enemy));
    let is_image = |(a, at): &(usize, [f64; 2]), (b, image): &(usize, [f64; 2])| {
        a == b && (0..2).all(|axis| (at[axis] + image[axis] - sides[axis]).abs() < 1e-5)
    };
    agents.iter().zip(&enemies).filter(|(one, other)| is_image(one, other)).count()
}

/// The mirror of both sides is half a turn. As in the game, it maps agents to enemies under no rules but the
/// first two, which the documentation says of these maps.
#[test]
fn enemies_start_as_agents_do_and_not_as_their_images() {
    for name in ["1c3s5z", "25m", "2s3z", "3m", "3s5z", "8m", "MMM"] {
        let scenario = Scenario::standard(name).unwrap();
        let counts = Rules::ALL.map(|rules| images(&scenario, rules));
        let n_agents = scenario.n_agents();
        assert_eq!(counts[..2], [n_agents; 2], "{name}");
        assert!(counts[2] < n_agents, "{name}: {} of {n_agents}", counts[2]);
        // Where agents stood, enemies of the exchanged and turned battle stand: a team plays them as agents.
        let other = scenario.exchanged().turned();
        let [here, there] = [&scenario, &other].map(|scenario| Arena::new(scenario, Rules::Starcraft));
        let agents = |scenario: &Scenario, arena: &Arena| -> Vec<_> {
            let units = scenario.units.iter().enumerate();
            units.filter(|(_, unit)| unit.faction == Faction::Ally).map(|(id, _)| arena.start(id)).collect()
        };
        assert_eq!(agents(&scenario, &here), agents(&other, &there), "{name}");
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
