//! Moments from the state that learners receive, beside the moments of the battle itself.

use std::sync::Arc;

use smaclite_engine::{Arena, Battle, ExecutionOrder, Rules, Scratch, policy};
use smaclite_scenarios::{Capability, Faction, Scenario};
use smaclite_view::{Moment, Observer, Options, UnitMoment};

use crate::kit::*;

/// After every step of an episode: the moment of the battle, and that of its state.
fn play_states(scenario: &Scenario, rules: Rules) -> Vec<(Moment, Moment)> {
    let arena = Arc::new(Arena::new(scenario, rules));
    let scenario = &*rules.figures(scenario);
    let mut state = vec![0.0; arena.sizes().state_size];
    let mut battle = Battle::new(arena, 1);
    let mut observer = Observer::new(scenario, &battle);
    let (mut scratch, mut actions) = (Scratch::new(), vec![0; scenario.n_agents()]);
    let mut pairs = Vec::new();
    for _ in 0..60 {
        battle.write_state(Faction::Ally, &mut state);
        pairs.push((observer.moment().clone(), Moment::from_state(scenario, &state)));
        if battle.is_over() {
            break;
        }
        policy::nearest(&battle, &mut actions);
        let observe = |tick: smaclite_engine::Tick<'_>| drop(observer.observe(tick.units).clone());
        battle.step_observed(&actions, ExecutionOrder::Drawn, &mut scratch, observe).unwrap();
    }
    pairs
}

/// The unit as a state describes it: without what the state does not contain.
fn visible(scenario: &Scenario, id: usize, unit: &UnitMoment) -> UnitMoment {
    let placement = &scenario.units[id];
    let is_ally = placement.faction == Faction::Ally;
    let is_healer = scenario.unit_types[placement.unit_type].is_healer();
    let has_shield = if is_ally { scenario.ally_has_shields } else { scenario.enemy_has_shields };
    let only = |condition: bool, value: f32| if condition && unit.alive { value } else { 0.0 };
    UnitMoment {
        hp: only(true, unit.hp),
        shield: only(has_shield, unit.shield),
        energy: only(is_ally && is_healer, unit.energy),
        cooldown: only(is_ally && !is_healer, unit.cooldown),
        target: None,
        ..*unit
    }
}

fn nearest_opponent(scenario: &Scenario, moment: &Moment, id: usize) -> Option<f32> {
    let others = scenario.units.iter().zip(&moment.units);
    let opponents = others.filter(|(unit, _)| unit.faction != scenario.units[id].faction);
    let distances = opponents.filter(|(_, unit)| unit.alive).map(|(_, unit)| unit.pos);
    distances.map(|pos| pos.distance(moment.units[id].pos)).min_by(f32::total_cmp)
}

fn assert_near(what: &str, got: f32, expected: f32, context: &str) {
    let tolerance = 2.0 * f32::EPSILON * expected.abs();
    assert!((got - expected).abs() <= tolerance, "{context}: {what} {got}, expected {expected}");
}

#[test]
fn a_state_gives_the_moment_of_its_battle() {
    let rules = [Rules::Smaclite, Rules::Starcraft]; // under which cooldowns have a random delay
    for (name, rules) in Scenario::standard_names().flat_map(|name| rules.map(|rules| (name, rules))) {
        let scenario = standard(name);
        let mut n_dead = 0;
        for (step, (battle, state)) in play_states(&scenario, rules).iter().enumerate() {
            assert!(state.attacks.is_empty() && state.units.len() == battle.units.len());
            for (id, (unit, got)) in battle.units.iter().zip(&state.units).enumerate() {
                let context = format!("{name}, {rules}, step {step}, unit {id}");
                let expected = visible(&scenario, id, unit);
                assert_eq!((got.alive, got.target), (expected.alive, None), "{context}");
                assert_near("health", got.hp, expected.hp, &context);
                assert_near("shield", got.shield, expected.shield, &context);
                assert_near("energy", got.energy, expected.energy, &context);
                assert_near("cooldown", got.cooldown, expected.cooldown, &context);
                let is_there = got.pos.distance(expected.pos) < 1e-5;
                assert!(if unit.alive { is_there } else { got.pos.is_nan() }, "{context}");
                n_dead += usize::from(!unit.alive);
            }
        }
        assert!(n_dead > 0, "{name}, {rules}: no unit died");
    }
}

#[test]
fn units_face_their_nearest_living_opponent() {
    for name in ["MMM2", "2s3z", "bane_vs_bane"] {
        let scenario = standard(name);
        for (_, moment) in play_states(&scenario, Rules::Smaclite) {
            for (id, unit) in moment.units.iter().enumerate() {
                let distance = nearest_opponent(&scenario, &moment, id).filter(|_| unit.alive);
                let Some(distance) = distance else { continue };
                let faced = unit.pos + distance * glam::Vec2::from_angle(unit.facing);
                let is_there = |other: &UnitMoment| other.alive && other.pos.distance(faced) < 1e-3;
                assert!(moment.units.iter().any(is_there), "{name}: unit {id} of {moment:?}");
            }
        }
    }
}

#[test]
fn dead_units_leave_no_marks() {
    let scenario = standard("MMM2");
    let sizes = Arena::new(&scenario, Rules::Smaclite).sizes();
    let all_dead = Moment::from_state(&scenario, &vec![0.0; sizes.state_size]);
    let options = marked(Options::default());
    assert_eq!(render(&scenario, options, &[all_dead]), render(&scenario, options, &[]));
}

/// With SMACv2's levels of health, units below theirs live until the end of the step, with negative health:
/// pictures left them out.
#[test]
fn units_below_their_level_of_health_are_drawn_while_they_live() {
    let mut scenario = Scenario::standard("terran_5_vs_5").expect("a standard scenario");
    let health = Capability { lower_bound: 0.3, upper_bound: 0.5, observe: true };
    scenario.smacv2.as_mut().expect("options").health = Some(health);
    let pairs = play_states(&scenario, Rules::Smaclite);
    for (of_battle, of_state) in &pairs {
        let [expected, got] = [of_battle, of_state]
            .map(|moment| moment.units.iter().map(|unit| unit.alive).collect::<Vec<_>>());
        assert_eq!(got, expected);
    }
    let is_below = |unit: &UnitMoment| unit.alive && unit.hp == 0.0;
    assert!(
        pairs.iter().any(|(_, of_state)| of_state.units.iter().any(is_below)),
        "some unit is below its level"
    );
}

#[test]
#[should_panic(expected = "one state")]
fn a_state_of_another_length_panics() {
    Moment::from_state(&standard("3m"), &[0.0; 3]);
}
