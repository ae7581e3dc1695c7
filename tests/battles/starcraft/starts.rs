//! Where battles begin, and how the enemies march.

use std::sync::Arc;

use glam::Vec2;
use smaclite_engine::policy::Tactic;
use smaclite_engine::{Arena, Battle, NeighbourOrder, Opponent, Rules, Scratch, Units};
use smaclite_scenarios::{Faction, Placement, Scenario};
use smaclite_units::{Plane, UnitType};

use super::{Field, STOP};

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
