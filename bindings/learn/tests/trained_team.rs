//! A team in a single battle acts as it does in the lanes of an evaluation.

use smaclite_engine::{Battle, EnemySide, Rules, Scratch, Sides};
use smaclite_ipc::RuntimeDir;
use smaclite_learn::{
    Config, Evaluation, EvaluationEvent, Lanes, NetworkKind, Run, TrainedTeam, evaluate, resolve_scenario,
};
use smaclite_scenarios::Faction;
use std::path::PathBuf;
use std::sync::Arc;

/// The folder of a short run, whose agents observe their last two actions.
fn team(folder: &tempfile::TempDir, map: &str, network: NetworkKind) -> (PathBuf, RuntimeDir) {
    let runtime_dir = RuntimeDir::at(folder.path().join("pools")).unwrap();
    let small = Config { num_envs: 4, horizon: 8, minibatches: 2, ..Config::for_agents(3) };
    let config = Config { steps: 64, last_actions: 2, ..small }.with_network(network);
    let scenario = resolve_scenario(map, Rules::Smaclite).unwrap();
    let lanes = Lanes::start(&scenario, 4, 2, 1, &runtime_dir).unwrap();
    let path = folder.path().join("run");
    let mut run = Run::begin(&path, config, &scenario, lanes, 1).unwrap();
    while run.update(&mut || false).unwrap().is_some() {}
    run.checkpoint().unwrap();
    (path, runtime_dir)
}

#[test]
fn a_team_acts_alike_in_a_lane_and_in_a_battle() {
    check_acts_alike("3m", NetworkKind::Flat);
    check_acts_alike("3m", NetworkKind::Units);
    check_acts_alike("MMM", NetworkKind::Units);
    check_acts_alike("terran_5_vs_5", NetworkKind::Units);
}

fn check_acts_alike(map: &str, network: NetworkKind) {
    let folder = tempfile::tempdir().unwrap();
    let (path, runtime_dir) = team(&folder, map, network);
    let (opponents, opponent_team, weights) = (None, None, None);
    let evaluation = Evaluation {
        episodes: 1,
        seed: 5,
        weights,
        greedy: false,
        threads: 1,
        opponents,
        opponent_team,
        map: None,
    };
    let mut expected: Vec<Vec<i32>> = Vec::new();
    let mut note = |event: EvaluationEvent| {
        if let EvaluationEvent::Step { actions, .. } = event {
            expected.push(actions.to_vec());
        }
    };
    evaluate(&path, evaluation, &runtime_dir, &mut || false, &mut note).unwrap();
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
    let folder = tempfile::tempdir().unwrap();
    let player = TrainedTeam::open(&team(&folder, "3m", NetworkKind::Flat).0).unwrap();
    let arena = |name: &str| {
        let sides = Sides::Both(EnemySide { mirror: true, zero_sum: false });
        resolve_scenario(name, Rules::Smaclite).unwrap().with_sides(sides).arena().unwrap().1
    };
    assert_eq!(player.check(&arena("3m"), Faction::Enemy), Ok(()));
    let error = player.check(&arena("5m_vs_6m"), Faction::Enemy).unwrap_err().to_string();
    assert!(error.starts_with("the team was trained in `3m` and plays 3 units"), "{error}");
    assert!(error.contains("the enemies of this scenario are 6"), "{error}");
    assert!(
        error.ends_with("a team plays the enemies only of scenarios whose two sides have equal sizes"),
        "{error}"
    );
    assert!(TrainedTeam::open(folder.path()).unwrap_err().to_string().contains("run"));
}
