//! Teams that play the enemies: the team itself, copies of it, and teams of other runs.

use crate::kit::{Place, check_resumed, check_threads, complete, evaluation, scenario, small};
use smaclite_engine::{BattleSetup, Opponent, Rules};
use smaclite_learn::{
    Config, Enemies, Evaluation, Lanes, Run, RunDescription, SelfPlay, evaluate, resolve_scenario,
};
use std::fs;

/// A run against the opponents of `enemies`.
fn against(enemies: Enemies) -> Config {
    Config { enemies, steps: 34 * 158, epochs: 1, ..small() }
}

/// A league with all kinds of episodes, in which copies retire.
const LEAGUE: SelfPlay =
    SelfPlay { script_share: 0.3, self_share: 0.4, league_every: 3, league_size: 4, zero_sum: true };

/// Players, copies, estimates and the opponents of the environments are all part of the bits.
#[test]
fn a_resumed_league_is_the_uninterrupted_one() {
    let place = Place::new();
    check_resumed(&against(Enemies::SelfPlay(LEAGUE)), &place);
    let (copies, log) = place.self_play("whole");
    // All are kept, also those that no episodes begin against any more.
    let expected =
        (1..=34 / LEAGUE.league_every).map(|i| format!("{:06}.safetensors", i * LEAGUE.league_every));
    assert!(copies.iter().map(|(name, _)| name.clone()).eq(expected), "{copies:?}");
    assert_eq!(log[0], ["win_rate_self", "win_rate_league", "win_rate_attack_move", "league_size"]);
    let sizes: Vec<&str> = log[1..].iter().map(|row| row[3].as_str()).collect();
    assert_eq!(sizes[..16].join(""), "0011122233344444");
    assert!(log.last().unwrap().iter().all(|value| !value.is_empty()), "{log:?}");
    for name in ["resumed-2", "resumed-31", "resumed-32", "resumed-33"] {
        assert_eq!(place.self_play(name), place.self_play("whole"));
    }
}

#[test]
fn teams_that_play_themselves_have_equal_bits_for_any_number_of_threads() {
    check_threads(&Config { last_actions: 1, ..against(Enemies::SelfPlay(LEAGUE)) });
}

/// Twice as much is learnt from a step in which the team plays both sides.
#[test]
fn a_team_that_plays_itself_learns_from_both_sides() {
    let place = Place::new();
    let enemies = Enemies::SelfPlay(SelfPlay::ALONE);
    let config = Config { seed: 1, steps: 45_000, enemies, ..Config::for_agents(3) };
    let record = place.train("self", &config, 2);
    let self_play = record.self_play.unwrap();
    assert!(self_play.win_rate_attack_move.is_nan() && self_play.league_size == 0, "{record:?}");
    // A win of one side is a loss of the other.
    assert!((0.3..0.7).contains(&self_play.win_rate_self), "{record:?}");
    let (result, _) = place.evaluate("self", 64);
    assert_eq!(result.opponents.to_string(), "attack_move");
    assert!(result.mean_return > 3.5, "{result:?}");
}

#[test]
fn zero_sum_rewards_change_what_is_learnt() {
    let place = Place::new();
    let [plain, zero_sum] = [false, true].map(|zero_sum| {
        let enemies = Enemies::SelfPlay(SelfPlay { zero_sum, ..SelfPlay::ALONE });
        place.train(&zero_sum.to_string(), &Config { steps: 3 * 158, ..against(enemies) }, 1);
        let (weights, _) = place.outcome(&zero_sum.to_string());
        weights
    });
    assert_ne!(plain, zero_sum);
}

#[test]
fn a_team_trains_against_a_trained_team_and_is_evaluated_against_it() {
    let place = Place::new();
    place.train("first", &Config { seed: 1, steps: 45_000, last_actions: 0, ..Config::for_agents(3) }, 2);
    let enemies = Enemies::Team { folder: place.path("first") };
    let config = against(enemies.clone());
    place.train("before", &config, 1);
    // The run keeps a copy of the team, so it is resumed without its folder.
    let mut run = place.begin("resumed", &config, 1);
    fs::rename(place.path("first"), place.path("moved")).unwrap();
    for _ in 0..5 {
        run.update(&mut || false).unwrap();
    }
    run.checkpoint().unwrap();
    drop(run);
    complete(Run::resume(&place.path("resumed"), None, place.lanes_of(&config, 1), 1).unwrap());
    assert_eq!(place.outcome("resumed"), place.outcome("before"));

    let evaluate_against = |name: &str, opponent: &str| {
        let opponent_team = Some(place.path(opponent));
        let evaluation = Evaluation { opponent_team, ..evaluation(128) };
        let folder = place.path(name);
        evaluate(&folder, evaluation, &place.runtime_dir, &mut || false, &mut |_| {}).unwrap()
    };
    let (weak, equal) = (evaluate_against("resumed", "moved"), evaluate_against("moved", "moved"));
    let strong = evaluate_against("moved", "resumed");
    assert!(
        weak.win_rate < equal.win_rate && equal.win_rate < strong.win_rate,
        "{weak:?} {equal:?} {strong:?}"
    );
    assert_eq!(evaluate_against("moved", "resumed"), strong, "equal seeds give equal episodes");
}

/// Where the scenario has an opponent of its own, evaluations were against that one.
#[test]
fn where_teams_play_the_enemies_evaluations_are_against_attack_move() {
    let place = Place::new();
    let setup = BattleSetup { opponents: Opponent::AttackNearest.into(), ..scenario() };
    let cases = [(Enemies::Scripts, "attack_nearest"), (Enemies::SelfPlay(SelfPlay::ALONE), "attack_move")];
    for (enemies, expected) in cases {
        let path = place.path(expected);
        let lanes = Lanes::start(&enemies.setup(&setup), 10, 0, 1, &place.runtime_dir).unwrap();
        drop(Run::begin(&path, Config { enemies, ..small() }, &setup, lanes, 1).unwrap());
        assert_eq!(RunDescription::read(&path).unwrap().setup.opponents.to_string(), expected);
    }
}

/// Its files were read twice, to play and to be copied: a resumed run played another team.
#[test]
fn a_team_that_goes_on_training_plays_as_it_was_copied() {
    let place = Place::new();
    for (name, seed) in [("first", 1), ("second", 2)] {
        place.train(name, &Config { seed, steps: 20, ..small() }, 1);
    }
    let weights = |name: &str| place.path(name).join("weights.safetensors");
    let teams = ["first", "second"].map(|name| fs::read(weights(name)).unwrap());
    let played = ["first", "second"].map(|name| {
        let enemies = Enemies::Team { folder: place.path(name) };
        place.train(&format!("against-{name}"), &Config { enemies, steps: 20, ..small() }, 1);
        place.outcome(&format!("against-{name}"))
    });
    assert_ne!(played[0], played[1]);

    fs::create_dir(place.path("changing")).unwrap();
    fs::copy(place.path("first/run.json"), place.path("changing/run.json")).unwrap();
    fs::write(weights("changing"), &teams[0]).unwrap();
    std::thread::scope(|scope| {
        let training = scope.spawn(|| {
            for number in 0..16 {
                let enemies = Enemies::Team { folder: place.path("changing") };
                place.train(&format!("{number}"), &Config { enemies, steps: 20, ..small() }, 1);
            }
        });
        for bytes in teams.iter().cycle().take_while(|_| !training.is_finished()) {
            fs::write(place.path("new"), bytes).unwrap();
            fs::rename(place.path("new"), weights("changing")).unwrap(); // whole, as a run writes them
        }
    });
    for number in 0..16 {
        let copied = fs::read(weights(&format!("{number}/opponent"))).unwrap();
        let team = teams.iter().position(|bytes| *bytes == copied).unwrap();
        assert!(place.outcome(&format!("{number}")) == played[team], "run {number} played the other team");
    }
}

#[test]
fn teams_that_cannot_play_the_enemies_are_refused() {
    let place = Place::new();
    place.train("run", &small(), 1);
    let begin = |map: &str, enemies: Enemies, of_lanes: &Enemies| {
        let setup = resolve_scenario(map, Rules::default()).unwrap();
        let config = Config { enemies, ..small() };
        let lanes = Lanes::start(&of_lanes.setup(&setup), 10, 0, 1, &place.runtime_dir).unwrap();
        Run::begin(&place.path("new"), config, &setup, lanes, 1).err().unwrap().to_string()
    };
    let check = |error: String, expected: &[&str]| {
        assert!(expected.iter().all(|part| error.contains(part)), "{error}");
        assert!(!place.path("new").exists());
    };
    let itself = Enemies::SelfPlay(SelfPlay::ALONE);
    let numbers = ["5m_vs_6m", "5 units with 12 actions", "6 units with 11 actions"];
    check(begin("5m_vs_6m", itself.clone(), &itself), &numbers);
    let team = Enemies::Team { folder: place.path("run") };
    let numbers = ["3 units with 9 actions", "8 units with 14 actions", "enemies of 8m", "/run"];
    check(begin("8m", team.clone(), &team), &numbers);
    check(begin("3m", itself.clone(), &Enemies::Scripts), &["plays sides `allies`", "needs `both`"]);
    check(begin("3m", Enemies::Scripts, &itself), &["plays sides `both`", "needs `allies`"]);
    let nowhere = Enemies::Team { folder: place.path("nowhere") };
    check(begin("3m", nowhere.clone(), &nowhere), &["nowhere", "has no run.json"]);
}
