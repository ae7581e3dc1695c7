//! Whole tournaments: they count as evaluations do, threads change nothing, both sides are played, and
//! players that cannot meet are refused.

use smaclite_engine::{BattleSetup, Opponent, Rules};
use smaclite_ipc::RuntimeDir;
use smaclite_lab::{Exploit, Response, Score, Tournament, TournamentResult};
use smaclite_learn::{Config, Evaluation, Lanes, Run, evaluate, resolve_scenario};
use smaclite_scenarios::ScenarioFiles;
use std::path::Path;

fn setup(scenario: &str) -> BattleSetup {
    resolve_scenario(scenario, Rules::Smaclite).unwrap()
}

/// Trains a team for some steps; its name as a player.
fn train(folder: &Path, name: &str, scenario: &str, config: &Config) -> String {
    let runtime_dir = RuntimeDir::at(folder.join("pools")).unwrap();
    let lanes =
        Lanes::start(&setup(scenario), config.num_envs, config.last_actions, 1, &runtime_dir).unwrap();
    let path = folder.join(name);
    let mut run = Run::begin(&path, config.clone(), &setup(scenario), lanes, 1).unwrap();
    while run.update(&mut || false).unwrap().is_some() {}
    run.checkpoint().unwrap();
    path.to_str().unwrap().to_owned()
}

fn small(seed: u64, last_actions: usize) -> Config {
    let config =
        Config { seed, last_actions, steps: 2000, num_envs: 16, horizon: 16, ..Config::for_agents(3) };
    Config { hidden: vec![16], ..config }
}

fn tournament(players: &[&str], scenario: Option<&str>) -> Tournament {
    Tournament {
        players: players.iter().map(|player| (*player).to_owned()).collect(),
        setup: scenario.map(setup),
        episodes: 50,
        seed: 3,
        greedy: false,
        threads: 1,
    }
}

fn play(tournament: &Tournament) -> TournamentResult {
    tournament.play(&mut || false).unwrap()
}

fn score<'a>(result: &'a TournamentResult, agents: &str, enemies: &str) -> &'a Score {
    let is_asked = |score: &&Score| score.agents == agents && score.enemies == enemies;
    result.scores.iter().find(is_asked).unwrap()
}

/// Episode i of a tournament is the first one of environment i of an evaluation, also for a team that
/// observes its last actions.
#[test]
fn a_team_plays_the_episodes_that_its_evaluation_counts() {
    let folder = tempfile::tempdir().unwrap();
    let runtime_dir = RuntimeDir::at(folder.path().join("pools")).unwrap();
    for last_actions in [0, 2] {
        let team = train(folder.path(), &format!("run{last_actions}"), "3m", &small(1, last_actions));
        for greedy in [true, false] {
            let result = play(&Tournament { greedy, ..tournament(&[&team, "nearest"], None) });
            let opponents = Some(Opponent::from_name("nearest").unwrap().into());
            let evaluation = Evaluation {
                episodes: 50,
                seed: 3,
                greedy,
                threads: 1,
                opponents,
                opponent_team: None,
                weights: None,
                map: None,
            };
            let expected =
                evaluate(team.as_ref(), evaluation, &runtime_dir, &mut || false, &mut |_| {}).unwrap();
            let score = score(&result, &team, "nearest");
            assert!((score.mean_return - expected.mean_return).abs() < 1e-5, "{score:?} {expected:?}");
            assert!((score.mean_length - expected.mean_length).abs() < 1e-9, "{score:?} {expected:?}");
            let won = expected.win_rate * 50.0;
            // An evaluation counts as won what ends with no unit on either side.
            assert!(won - score.wins as f64 <= score.draws as f64, "{score:?} {expected:?}");
        }
    }
}

#[test]
fn threads_change_no_result() {
    let folder = tempfile::tempdir().unwrap();
    let teams = [1, 2].map(|seed| train(folder.path(), &format!("run{seed}"), "3m", &small(seed, 1)));
    let players = [&teams[0], &teams[1], "random", "kite", "attack_nearest"];
    let results = [1, 3].map(|threads| play(&Tournament { threads, ..tournament(&players, None) }));
    assert_eq!(results[0], results[1]);
    let other = play(&Tournament { seed: 4, ..tournament(&players, None) });
    assert_ne!(results[0].scores, other.scores);
    // What two players score does not depend on who else plays.
    let two = play(&tournament(&[&teams[1], "kite"], None));
    assert_eq!(score(&two, "kite", &teams[1]), score(&results[0], "kite", &teams[1]));
}

/// Who is better wins from either side, also what marches and a team that plays the enemies in the mirror.
#[test]
fn players_are_as_strong_with_the_enemies_as_with_the_agents() {
    let folder = tempfile::tempdir().unwrap();
    let trained = Config { steps: 150_000, hidden: vec![32], entropy: 0.1, ..small(1, 0) };
    let trained = train(folder.path(), "trained", "3m", &trained);
    let fresh = train(folder.path(), "fresh", "3m", &Config { steps: 256, ..small(2, 0) });
    let order = ["focus_fire", &trained, "attack_move", &fresh];
    let result = play(&tournament(&order, None));
    for (i, better) in order.iter().enumerate() {
        for worse in &order[i + 1..] {
            let with_agents = score(&result, better, worse);
            let with_enemies = score(&result, worse, better);
            assert!(with_agents.wins > with_agents.losses, "{with_agents:?}");
            assert!(with_enemies.wins < with_enemies.losses, "{with_enemies:?}");
            assert!(with_enemies.mean_return < with_enemies.mean_enemy_return, "{with_enemies:?}");
        }
        assert!(result.players.windows(2).all(|pair| pair[0].elo > pair[1].elo), "{:?}", result.players);
    }
    let march = score(&result, "attack_move", &trained);
    let marched = score(&result, &trained, "attack_move");
    assert!(march.losses.abs_diff(marched.wins) < 15, "{march:?} {marched:?}");
    assert_eq!(result.scores.len(), 15, "attack_move does not play against itself");
}

/// Two banelings explode at once. The environment calls that a win of the agents, a tournament a draw.
#[test]
fn a_battle_without_survivors_is_a_draw() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("banelings.json");
    let group = |x: u32, faction: &str| {
        format!(r#"{{"x": {x}, "y": 16, "faction": "{faction}", "units": {{"BANELING": 1}}}}"#)
    };
    let text = format!(
        r#"{{"name": "banelings", "num_allied_units": 1, "num_enemy_units": 1, "attack_point": [14, 16],
            "groups": [{}, {}], "terrain_preset": "SIMPLE", "num_unit_types": 0, "episode_limit": 60,
            "ally_has_shields": false, "enemy_has_shields": false}}"#,
        group(14, "ALLY"),
        group(18, "ENEMY")
    );
    std::fs::write(&file, text).unwrap();
    let (_, files) = ScenarioFiles::resolve(file.to_str().unwrap()).unwrap();
    let setup = Some(BattleSetup::new(files));
    let result = play(&Tournament { setup, ..tournament(&["nearest", "hold"], None) });
    let itself = score(&result, "nearest", "nearest");
    assert_eq!((itself.wins, itself.draws, itself.losses), (0, 50, 0), "{itself:?}");
    assert!(itself.mean_length < 60.0, "{itself:?}");
}

/// Exchanged sides of such a scenario would not be exchanged: the agents would still be those in the middle.
#[test]
fn what_marches_plays_no_agents_whose_starts_are_drawn() {
    let result =
        play(&Tournament { episodes: 4, ..tournament(&["attack_nearest", "kite"], Some("zerg_5_vs_5")) });
    let met: Vec<_> =
        result.scores.iter().map(|score| [score.agents.as_str(), score.enemies.as_str()]).collect();
    assert_eq!(met, [["kite", "attack_nearest"], ["kite", "kite"]]);
}

#[test]
fn players_that_cannot_meet_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let team = train(folder.path(), "run", "3m", &Config { steps: 256, ..small(1, 0) });
    let asymmetric = train(folder.path(), "other", "5m_vs_6m", &Config { steps: 256, ..small(1, 0) });
    let check = |players: &[&str], scenario: Option<&str>, expected: &str| {
        let error = tournament(players, scenario).play(&mut || false).unwrap_err().to_string();
        assert!(error.contains(expected), "expected `{expected}`, got `{error}`");
    };
    check(&["kite"], Some("3m"), "at least two players, got 1");
    check(&["kite", "hold", "kite"], Some("3m"), "player `kite` is named twice");
    check(&["kite", "hold"], None, "the scenario must be named");
    check(
        &["kite", "kites"],
        Some("3m"),
        "`kites` is neither a script (attack_move, attack_nearest, random,",
    );
    check(&["kite", "learner"], Some("3m"), "`learner` is neither a script");
    check(&["kite", "."], Some("3m"), "it has no run.json");
    check(&["attack_move", "attack_nearest"], Some("3m"), "cannot play against each other");
    check(
        &[&team, "kite"],
        Some("8m"),
        "was trained in 3m, but 8m is played; they differ in scenario or unit types, episode limit (60",
    );
    let other_rules = BattleSetup { rules: Rules::Paper, ..setup("3m") };
    let error = Tournament { setup: Some(other_rules), ..tournament(&[&team, "kite"], None) };
    let error = error.play(&mut || false).unwrap_err().to_string();
    assert!(error.ends_with("they differ in rules (smaclite instead of paper)"), "{error}");
    check(&[&team, &asymmetric], None, "was trained in 5m_vs_6m, but 3m is played");
    check(&[&asymmetric, "kite"], None, "the sides of 5m_vs_6m differ (5 agents, 6 enemies), so a team");
    let error = tournament(&["kite", "hold"], Some("3m")).play(&mut || true).unwrap_err();
    assert_eq!(error.to_string(), "interrupted");
}

/// It learns to beat a team that has learnt nothing, from either side, and threads change no result.
#[test]
fn a_best_response_beats_its_team() {
    let folder = tempfile::tempdir().unwrap();
    let runtime_dir = RuntimeDir::at(folder.path().join("pools")).unwrap();
    let team = train(folder.path(), "team", "3m", &Config { steps: 256, ..small(1, 0) });
    let exploit =
        Exploit { folder: team.clone().into(), steps: 40_000, seed: 5, seeds: 2, episodes: 50, threads: 1 };
    let run = |name: &str, exploit: &Exploit| {
        exploit.run(&folder.path().join(name), &runtime_dir, &mut || false).unwrap()
    };
    let result = run("one", &exploit);
    assert_eq!(result.responses.iter().map(|response| response.seed).collect::<Vec<_>>(), [5, 6]);
    for Response { points, with_agents, with_enemies, .. } in &result.responses {
        assert!(with_agents.wins > 25 && with_enemies.losses > 25, "{with_agents:?} {with_enemies:?}");
        assert_eq!(with_agents.agents, with_enemies.enemies);
        assert!((points - (with_agents.points() + 1.0 - with_enemies.points()) / 2.0).abs() < 1e-9);
    }
    let most = result.responses.iter().map(|response| response.points).fold(0.0, f64::max);
    let chosen = result.responses.iter().find(|response| response.points == most);
    assert_eq!(chosen.map(|response| response.seed), Some(result.best.seed));
    // The largest of several shares would be an estimate that chance makes too large.
    let best = folder.path().join(format!("one/seed-{}", result.best.seed)).display().to_string();
    let battles = Tournament { episodes: 50, seed: 5 + 50, ..tournament(&[&best, &team], None) };
    let again = battles.play(&mut || false).unwrap();
    assert_eq!([result.best.points, result.exploitability], [again.players[0].points; 2]);
    assert!(folder.path().join("one/seed-5/weights.safetensors").exists());
    let again = run("again", &Exploit { threads: 3, seeds: 1, ..exploit });
    assert_eq!(again.responses[0].points, result.responses[0].points);
}
