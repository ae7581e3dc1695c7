//! A game as its page plays it: begin, give orders, play steps, save.

use super::*;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use smaclite_engine::{Opponent, Rules};
use smaclite_ipc::RuntimeDir;
use smaclite_learn::{Config, Lanes, Run, resolve_scenario};
use smaclite_view::{AgentOrder, Order, Replay};

fn play(name: &str, against: &str) -> Play {
    let setup = resolve_scenario(name, Rules::Smaclite).expect("a standard scenario");
    Play::new(BattleSetup { opponents: against.parse().expect("opponents"), ..setup }, 5).expect("a game")
}

fn begin(seed: &str) -> PageRequest {
    PageRequest::BeginBattle(BeginBattle { seed: seed.into(), actions: Vec::new() })
}

#[test]
fn a_battle_is_played_to_its_end_and_saved_as_a_replay() {
    let play = play("2s3z", "focus_fire");
    let mut battle = None;
    let PageResponse::BeginBattle(start) = play.respond(&mut battle, begin("5")).unwrap() else { panic!() };
    assert_eq!((start.steps.step, start.steps.steps, start.steps.n_moments), (0, 0, 1));
    let enemy = 5; // the first of five, after five agents
    let orders = (0..5).map(|agent| AgentOrder { agent, order: Order::Target { unit: enemy } }).collect();
    play.respond(&mut battle, PageRequest::GiveOrders { orders }).unwrap();
    let last = loop {
        let PageResponse::PlayStep(played) = play.respond(&mut battle, PageRequest::PlayStep {}).unwrap()
        else {
            panic!()
        };
        assert_eq!(played.steps.steps, 1);
        if played.steps.is_over {
            break played;
        }
    };
    assert!(last.steps.result.is_some());
    let over = play.respond(&mut battle, PageRequest::PlayStep {}).unwrap_err();
    assert_eq!(over.to_string(), "the battle is over");

    let PageResponse::GetReplay(file) = play.respond(&mut battle, PageRequest::GetReplay {}).unwrap() else {
        panic!()
    };
    assert_eq!(file.name, "2s3z-seed5.smreplay");
    let replay = Replay::from_bytes(&STANDARD.decode(file.replay).unwrap(), &file.name).unwrap();
    replay.verify().unwrap();
    let episode = &replay.episodes()[0];
    assert_eq!((episode.outcome.steps, episode.start.seed), (last.steps.length, 5));
    assert_eq!(episode.opponent, Opponent::from_name("focus_fire").unwrap());

    // A page whose connection was lost goes on with the steps that it has.
    let again = BeginBattle { seed: "5".into(), actions: episode.actions.clone() };
    let PageResponse::BeginBattle(again) =
        play.respond(&mut battle, PageRequest::BeginBattle(again)).unwrap()
    else {
        panic!()
    };
    assert_eq!(again.steps.episode_return, last.steps.episode_return);
    assert!(again.steps.is_over);
}

#[test]
fn what_cannot_be_played_is_refused() {
    let play = play("3m", "attack_move");
    let mut battle = None;
    for (request, expected) in [
        (PageRequest::PlayStep {}, "begin a battle first"),
        (PageRequest::Unfollow {}, "one of another page"),
        (begin("-1"), "seed must be a whole number from 0 to 18446744073709551615, got `-1`"),
        (
            PageRequest::BeginBattle(BeginBattle { seed: "1".into(), actions: vec![1; 4] }),
            "actions must be 3 per step, got 4 in all",
        ),
        (
            PageRequest::BeginBattle(BeginBattle { seed: "1".into(), actions: vec![0; 3] }),
            "action 0 is not available",
        ),
    ] {
        let error = play.respond(&mut battle, request).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
    play.respond(&mut battle, begin("1")).unwrap();
    let early = play.respond(&mut battle, PageRequest::GetReplay {}).unwrap_err();
    assert_eq!(early.to_string(), "the battle has no step yet");
    let orders =
        vec![AgentOrder { agent: 0, order: Order::Stop }, AgentOrder { agent: 9, order: Order::Stop }];
    let refused = play.respond(&mut battle, PageRequest::GiveOrders { orders }).unwrap_err();
    assert_eq!(refused.to_string(), "agent must be below 3, got 9");
    assert_eq!(battle.unwrap().orders().current(), [Order::None; 3], "all of them or none");
}

#[test]
fn a_trained_team_plays_the_enemies() {
    let folder = tempfile::tempdir().unwrap();
    let (path, runtime_dir) = (folder.path().join("run"), folder.path().join("pools"));
    let small = Config {
        num_envs: 4,
        horizon: 8,
        minibatches: 2,
        hidden: vec![8],
        last_actions: 0,
        ..Config::for_agents(3)
    };
    let setup = resolve_scenario("3m", Rules::Smaclite).unwrap();
    let lanes = Lanes::start(&setup, 4, 0, 1, &RuntimeDir::at(runtime_dir).unwrap()).unwrap();
    let run = Run::begin(&path, Config { steps: 32, ..small }, &setup, lanes, 1).unwrap();
    drop(run);

    let team = || TrainedTeam::open(&path).unwrap();
    let play = Play::against_team(setup, team(), "runs/3m".into(), 1).unwrap();
    assert_eq!(play.info().against, "runs/3m");
    let mut battle = None;
    play.respond(&mut battle, begin("1")).unwrap();
    let mut last = None;
    for _ in 0..8 {
        let played = play.respond(&mut battle, PageRequest::PlayStep {}).unwrap();
        last = Some(match played {
            PageResponse::PlayStep(played) => played.steps,
            other => panic!("{other:?}"),
        });
    }
    let PageResponse::GetReplay(file) = play.respond(&mut battle, PageRequest::GetReplay {}).unwrap() else {
        panic!()
    };
    let replay = Replay::from_bytes(&STANDARD.decode(file.replay).unwrap(), &file.name).unwrap();
    replay.verify().unwrap();
    let joint = &replay.episodes()[0].actions;
    assert_eq!(joint.len(), 8 * 6, "three agents, and three enemies");
    assert!(joint.chunks(6).any(|joint| joint[3..] != [1; 3]), "the enemies do something");

    // The page knows the actions of its agents alone; the team chooses the same ones again.
    let actions = joint.chunks(6).flat_map(|joint| joint[..3].to_vec()).collect();
    let again = PageRequest::BeginBattle(BeginBattle { seed: "1".into(), actions });
    let PageResponse::BeginBattle(again) = play.respond(&mut battle, again).unwrap() else { panic!() };
    let last = last.unwrap();
    assert_eq!((again.steps.length, again.steps.episode_return), (8, last.episode_return));

    let unequal = resolve_scenario("5m_vs_6m", Rules::Smaclite).unwrap();
    let error = Play::against_team(unequal, team(), String::new(), 1).err().unwrap().to_string();
    assert!(error.contains("only of scenarios whose two sides are equal"), "{error}");
}
