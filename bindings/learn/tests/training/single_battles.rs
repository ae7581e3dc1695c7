//! A team in a single battle acts as it does in the lanes of an evaluation.

use crate::kit::{Place, complete, evaluation};
use crate::maps::{begin, setups};
use smaclite_engine::{Battle, Rules, Scratch, Sides};
use smaclite_learn::{Config, EvaluationEvent, NetworkKind, TrainedTeam, evaluate, resolve_scenario};
use smaclite_scenarios::Faction;
use std::sync::Arc;

/// A short run, whose agents observe their last two actions.
fn train(place: &Place, map: &str, network: NetworkKind) {
    let small = Config { num_envs: 4, horizon: 8, minibatches: 2, ..Config::for_agents(3) };
    let config = Config { steps: 64, last_actions: 2, ..small }.with_network(network);
    complete(begin(place, "run", &setups(&[map]), &config, 1));
}

#[test]
fn a_team_acts_alike_in_a_lane_and_in_a_battle() {
    check_acts_alike("3m", NetworkKind::Flat);
    check_acts_alike("3m", NetworkKind::Units);
    check_acts_alike("MMM", NetworkKind::Units);
    check_acts_alike("terran_5_vs_5", NetworkKind::Units);
}

fn check_acts_alike(map: &str, network: NetworkKind) {
    let place = Place::new();
    train(&place, map, network);
    let path = place.path("run");
    let mut expected: Vec<Vec<i32>> = Vec::new();
    let mut note = |event: EvaluationEvent| {
        if let EvaluationEvent::Step { actions, .. } = event {
            expected.push(actions.to_vec());
        }
    };
    evaluate(&path, evaluation(1), &place.runtime_dir, &mut || false, &mut note).unwrap();
    assert!(expected.len() > 5);

    let player = TrainedTeam::open(&path).unwrap();
    let (_, arena) = resolve_scenario(map, Rules::Smaclite).unwrap().arena().unwrap();
    let mut battle = Battle::new(Arc::new(arena), 5);
    let mut past: Vec<Vec<u16>> = Vec::new();
    for (step, expected) in expected.iter().enumerate() {
        let newest_first = past.iter().rev().map(Vec::as_slice);
        let actions = player.act(&battle, Faction::Ally, newest_first, 5, step as u64);
        assert_eq!(actions, *expected, "step {step}");
        battle.step(&actions, &mut Scratch::new()).unwrap();
        past.push(actions.iter().map(|&action| action as u16).collect());
    }
    assert!(battle.is_over());
}

#[test]
fn a_team_plays_enemies_that_are_like_its_agents() {
    let place = Place::new();
    train(&place, "3m", NetworkKind::Flat);
    let player = TrainedTeam::open(&place.path("run")).unwrap();
    let arena = |name: &str| {
        resolve_scenario(name, Rules::Smaclite).unwrap().with_sides(Sides::Mirrored).arena().unwrap().1
    };
    assert_eq!(player.check(&arena("3m"), Faction::Enemy), Ok(()));
    let error = player.check(&arena("5m_vs_6m"), Faction::Enemy).unwrap_err().to_string();
    assert!(error.starts_with("the team was trained in `3m` and plays 3 units"), "{error}");
    assert!(error.contains("the enemies of this scenario are 6"), "{error}");
    assert!(
        error.ends_with("a team plays the enemies only of scenarios whose two sides have equal sizes"),
        "{error}"
    );
    assert!(TrainedTeam::open(&place.path("nowhere")).unwrap_err().to_string().contains("run"));
}
