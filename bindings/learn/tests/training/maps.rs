//! Teams of networks that fit every scenario: trained on one map or on several, and played on any.

use crate::kit::{Place, check_resumed, complete, evaluated, evaluation, scenario, small};
use smaclite_engine::{BattleSetup, Rules};
use smaclite_learn::{
    Algorithm, Config, Enemies, Evaluation, EvaluationResult, Lanes, NetworkKind, Run, RunDescription,
    SelfPlay, TrainedTeam, adapt_team, evaluate, resolve_scenario,
};
use std::sync::Arc;

fn universal(config: Config) -> Config {
    let hidden = vec![8, 16];
    Config { hidden, algorithm: Algorithm::Mappo, ..config.with_network(NetworkKind::Universal) }
}

pub fn setups(names: &[&str]) -> Vec<BattleSetup> {
    names.iter().map(|name| resolve_scenario(name, Rules::default()).unwrap()).collect()
}

fn lanes(place: &Place, setups: &[BattleSetup], config: &Config, threads: usize) -> Vec<Lanes> {
    Lanes::start_maps(setups, config, threads, &place.runtime_dir).unwrap()
}

pub fn begin(place: &Place, name: &str, setups: &[BattleSetup], config: &Config, threads: usize) -> Run {
    let maps = setups.iter().cloned().zip(lanes(place, setups, config, threads)).collect();
    Run::begin_on_maps(&place.path(name), config.clone(), maps, threads).unwrap()
}

fn play(place: &Place, name: &str, map: &str, episodes: usize) -> Result<EvaluationResult, String> {
    let map = Some(resolve_scenario(map, Rules::default()).unwrap());
    let evaluation = Evaluation { map, ..evaluation(episodes) };
    let played = evaluate(&place.path(name), evaluation, &place.runtime_dir, &mut || false, &mut |_| {});
    played.map_err(|error| error.to_string())
}

/// The random policy has returns of 1.4 and 2.0 (docs/reference/policies.md).
#[test]
fn a_team_learns_two_maps_and_plays_a_third() {
    let place = Place::new();
    let config = universal(Config { seed: 1, steps: 60_000, ..Config::for_agents(4) });
    let record = complete(begin(&place, "run", &setups(&["3m", "8m"]), &config, 2));
    assert!(record.steps >= 60_000 && record.mean_return > 3.5, "{record:?}");
    for (map, least) in [("3m", 3.5), ("8m", 3.5), ("5m_vs_6m", 2.0)] {
        let result = play(&place, "run", map, 64).unwrap();
        assert!(result.scenario == map && result.mean_return > least, "{result:?}");
    }
    let result = play(&place, "run", "MMM", 8).unwrap();
    assert_eq!(result.episodes, 8, "types and actions that it has never seen: {result:?}");
}

/// On its own map.
#[test]
fn a_resumed_run_of_a_universal_network_has_the_same_bits() {
    check_resumed(&universal(Config { steps: 34 * 158, epochs: 1, ..small() }), &Place::new());
}

#[test]
fn a_resumed_run_on_several_maps_has_the_same_bits_on_any_number_of_threads() {
    let place = Place::new();
    let setups = setups(&["3m", "2s3z", "MMM"]);
    let map_weights = vec![1.0, 2.0, 3.0];
    let config = universal(Config { num_envs: 12, steps: 34 * 190, epochs: 1, map_weights, ..small() });
    complete(begin(&place, "whole", &setups, &config, 1));
    let mut run = begin(&place, "resumed", &setups, &config, 3);
    for _ in 0..33 {
        run.update(&mut || false).unwrap();
    }
    run.checkpoint().unwrap();
    drop(run);
    let run = RunDescription::read(&place.path("resumed")).unwrap();
    assert_eq!((run.name.as_str(), &run.other_maps[..]), ("3m", &setups[1..]));
    assert_eq!(run.config.map_weights, [1.0, 2.0, 3.0]);
    let log = std::fs::read_to_string(place.path("whole").join("log.csv")).unwrap();
    let header = log.lines().next().unwrap();
    assert!(header.ends_with("learn_share,win_rate_3m,win_rate_2s3z,win_rate_MMM"), "{header}");
    let resumed = lanes(&place, &setups, &config, 1);
    complete(Run::resume_on_maps(&place.path("resumed"), None, resumed, 1).unwrap());
    assert_eq!(place.outcome("resumed"), place.outcome("whole"));
    // With the weights of three maps, the team on one of them could not be pickled.
    let team = TrainedTeam::open_on(&place.path("whole"), None, setups[1].clone()).unwrap();
    let (run, params) = team.parts();
    let again = TrainedTeam::from_parts(&run, params.to_vec()).expect("a team");
    assert_eq!((again.run().name.as_str(), again.parts().1), ("2s3z", params));
    let resume =
        |lanes| Run::resume_on_maps(&place.path("resumed"), None, lanes, 1).err().unwrap().to_string();
    let one = Lanes::start(&setups[0], 12, 0, 1, &place.runtime_dir).unwrap();
    let error = resume(vec![one]);
    assert_eq!(error, "the run has 3 maps, but lanes were given for 1");
    let mut uneven = lanes(&place, &setups, &config, 1);
    let start = |setup, num_envs| Lanes::start(setup, num_envs, 0, 1, &place.runtime_dir).unwrap();
    (uneven[0], uneven[1]) = (start(&setups[0], 1), start(&setups[1], 5));
    let error = resume(uneven);
    assert_eq!(error, "the maps have [1, 5, 6] environments, but those of the checkpoint [2, 4, 6]");
}

/// It was asked for the sizes of its own map, and a run that was resumed took the enemies for those of that
/// map.
#[test]
fn a_team_plays_the_enemies_of_a_map_that_it_was_not_trained_on() {
    let place = Place::new();
    complete(begin(&place, "team", &setups(&["2s3z"]), &universal(small()), 1));
    let enemies = Enemies::Team { folder: place.path("team") };
    let config = Config { enemies, steps: 34 * 158, epochs: 1, ..small() };
    check_resumed(&config, &place);
    adapt_team(&place.path("team"), None, scenario(), &place.path("adapted")).unwrap();
    let evaluate_against = |opponent: &str| {
        let opponent_team = Some(place.path(opponent));
        let evaluation = Evaluation { opponent_team, ..evaluation(32) };
        let played =
            evaluate(&place.path("whole"), evaluation, &place.runtime_dir, &mut || false, &mut |_| {});
        let played = played.unwrap();
        (played.win_rate, played.mean_return, played.mean_length)
    };
    assert_eq!(evaluate_against("team"), evaluate_against("adapted"));
    // So do evaluations during the training: they took the team for that of its own map, and panicked.
    let evaluations_against = |run: &str, opponent: &str| {
        let enemies = Enemies::Team { folder: place.path(opponent) };
        place.train(run, &Config { enemies, ..evaluated() }, 1);
        let files = place.evaluations(run);
        assert!(!files.is_empty());
        files
    };
    assert!(evaluations_against("against_team", "team") == evaluations_against("against_adapted", "adapted"));

    let unequal = resolve_scenario("5m_vs_6m", Rules::default()).unwrap();
    let lanes = Lanes::start(&config.enemies.setup(&unequal), 10, 0, 1, &place.runtime_dir).unwrap();
    let error = Run::begin(&place.path("new"), config, &unequal, lanes, 1).err().unwrap().to_string();
    assert!(error.ends_with("it plays them where both sides have the same units and shields"), "{error}");
}

/// The program and Python play single battles with it, on a map of the caller's.
#[test]
fn a_team_is_opened_on_another_map() {
    let place = Place::new();
    place.train("run", &universal(small()), 1);
    let setup = resolve_scenario("2s3z", Rules::default()).unwrap();
    let (_, arena) = setup.arena().unwrap();
    let team = TrainedTeam::open_on(&place.path("run"), None, setup).unwrap();
    team.check(&arena, smaclite_engine::Faction::Ally).unwrap();
    let mut battle = smaclite_engine::Battle::new(Arc::new(arena), 1);
    battle.reset();
    let actions = team.act(&battle, smaclite_engine::Faction::Ally, std::iter::empty(), 1, 0);
    battle.check(&actions).unwrap();
}

#[test]
fn what_is_for_one_map_is_refused() {
    let place = Place::new();
    place.train("flat", &small(), 1);
    let error = play(&place, "flat", "8m", 2).unwrap_err();
    assert!(error.starts_with("the team was trained in `3m` and plays that alone"), "{error}");
    let refuse_on = |maps: &[&str], config: Config| {
        let setups = setups(maps);
        let lanes = match Lanes::start_maps(&setups, &config, 1, &place.runtime_dir) {
            Ok(lanes) => lanes,
            Err(error) => return error.to_string(),
        };
        let maps = setups.into_iter().zip(lanes).collect();
        Run::begin_on_maps(&place.path("new"), config, maps, 1).err().unwrap().to_string()
    };
    let error = refuse_on(&["3m", "8m", "3m"], universal(Config { num_envs: 6, ..small() }));
    assert_eq!(error, "two maps of the run are called `3m`; each must have a name of its own");
    let refuse = |config: Config| refuse_on(&["3m", "8m"], config);
    let error = refuse(small());
    assert_eq!(error, "network must be `universal` with several maps, got `flat`");
    let enemies = Enemies::SelfPlay(SelfPlay::LEAGUE);
    let error = refuse(universal(Config { enemies, ..small() }));
    assert!(error.starts_with("network must be `flat` or `units` where a team plays"), "{error}");
}
