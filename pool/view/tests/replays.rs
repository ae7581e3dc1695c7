//! Replays: files give back what was recorded, every map is reproduced, and damaged or hostile files are
//! errors.

use std::io::{Read, Write};

use flate2::{Compression, bufread::GzDecoder, write::GzEncoder};
use serde_json::{Value, json};
use smaclite_engine::policy::{self, Random};
use smaclite_engine::{BattleSetup, EpisodeLimit, Opponent, Rules, StreamPosition};
use smaclite_scenarios::{Scenario, ScenarioFiles};
use smaclite_view::{MAX_JSON_BYTES, Moment, Observer, Recorder, Replay, ReplayError};

fn setup(name_or_path: &str) -> BattleSetup {
    let (_, files) = ScenarioFiles::resolve(name_or_path).unwrap();
    BattleSetup::new(files)
}

/// Episodes of the random policy, and the moments of the last one.
fn record(setup: BattleSetup, seed: u64, episodes: usize) -> (Replay, Vec<Moment>) {
    let mut recorder = Recorder::new(setup, seed).unwrap();
    let mut policy = Random::new(seed);
    let mut actions = vec![0; recorder.battle().arena().sizes().n_agents];
    let scenario = recorder.scenario().clone();
    let mut moments = Vec::new();
    for episode in 0..episodes {
        if episode > 0 {
            recorder.reset();
        }
        let mut observer = Observer::new(&scenario, recorder.battle());
        moments = vec![observer.moment().clone()];
        while !recorder.battle().is_over() {
            policy.act(recorder.battle(), &mut actions);
            recorder.step_observed(&actions, |units| moments.push(observer.observe(units).clone())).unwrap();
        }
    }
    (recorder.finish(), moments)
}

/// Compares all but the last digit of the returns, which are decimal numbers in files.
fn assert_same_episodes(a: &Replay, b: &Replay) {
    assert_eq!(a.episodes().len(), b.episodes().len());
    for (a, b) in a.episodes().iter().zip(b.episodes()) {
        assert!((a.outcome.episode_return - b.outcome.episode_return).abs() < 1e-9);
        let mut b = b.clone();
        b.outcome.episode_return = a.outcome.episode_return;
        assert!(*a == b, "{a:?}, expected {b:?}");
    }
}

fn json_of(bytes: &[u8]) -> Value {
    let mut json = String::new();
    GzDecoder::new(bytes).read_to_string(&mut json).unwrap();
    serde_json::from_str(&json).unwrap()
}

fn gzip(text: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(text).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn every_map_is_reproduced_and_small() {
    for name in Scenario::standard_names() {
        let (replay, moments) = record(setup(name), 7, 3);
        let bytes = replay.to_bytes().unwrap();
        let copy = Replay::from_bytes(&bytes, name).unwrap();
        assert!(copy.setup() == replay.setup(), "{name}");
        assert_same_episodes(&copy, &replay);
        copy.verify().unwrap_or_else(|error| panic!("{name}: {error}"));
        let played = copy.play(2).unwrap().collect::<Result<Vec<_>, _>>().unwrap();
        assert!(played == moments, "{name}");

        let actions: usize = replay.episodes().iter().map(|episode| episode.actions.len()).sum();
        let per_episode = bytes.len() / 3;
        println!("{name}: {per_episode} bytes per episode of {} actions", actions / 3);
        // Random actions need most; the constant part is mainly the scenario's text.
        assert!(bytes.len() < 2500 + actions, "{name}: {} bytes for {actions} actions", bytes.len());
    }
}

#[test]
fn a_file_is_written_and_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("battle.smreplay");
    let (replay, _) = record(setup("MMM"), 1, 1);
    replay.write(&path).unwrap();
    let copy = Replay::read(&path).unwrap();
    assert_same_episodes(&copy, &replay);
    assert_eq!(copy.scenario(), &Scenario::standard("MMM").unwrap());

    let error = Replay::read(&folder.path().join("none.smreplay")).unwrap_err().to_string();
    assert!(error.contains("none.smreplay: No such file"), "{error}");
    let error = Replay::read(folder.path()).unwrap_err().to_string();
    assert!(error.contains("not a regular file"), "{error}");
}

#[test]
fn a_recording_can_be_read_while_it_goes_on() {
    let mut recorder = Recorder::new(setup("3m"), 1).unwrap();
    assert!(recorder.replay().episodes().is_empty());
    let play = |recorder: &mut Recorder, steps| {
        let mut actions = vec![0; 3];
        for _ in 0..steps {
            policy::nearest(recorder.battle(), &mut actions);
            recorder.step(&actions).unwrap();
        }
    };
    play(&mut recorder, 3);
    recorder.reset();
    play(&mut recorder, 2);
    let before = recorder.replay();
    before.verify().unwrap();
    assert_eq!(before.episodes()[1].actions, recorder.actions());
    play(&mut recorder, 2);
    let (now, after) = (recorder.replay(), recorder.finish());
    assert_same_episodes(&now, &after);
    assert_eq!(before.episodes()[0], after.episodes()[0]);
    assert_eq!(before.episodes()[1].actions, after.episodes()[1].actions[..2 * 3]);
}

#[test]
fn unit_files_are_in_the_replay() {
    let folder = tempfile::tempdir().unwrap();
    let zealot = json!({
        "hp": 40, "armor": 0, "attacks": 1, "damage": 8, "cooldown": 0.8,
        "speed": 3.0, "attack_range": 0.1, "size": 1,
        "valid_targets": ["GROUND"], "attributes": ["LIGHT"], "targeter": "STANDARD"
    });
    std::fs::write(folder.path().join("brawler.json"), zealot.to_string()).unwrap();
    // No group has this type, so its file is found and not read.
    std::fs::write(folder.path().join("absent.json"), "no unit").unwrap();
    let scenario = json!({
        "name": "brawl", "num_allied_units": 3, "num_enemy_units": 2,
        "groups": [
            {"x": 12, "y": 16, "faction": "ALLY", "units": {"brawler": 2, "MARINE": 1}},
            {"x": 20, "y": 16, "faction": "ENEMY", "units": {"brawler.json": 2}}
        ],
        "attack_point": [12, 16], "terrain_preset": "SIMPLE", "num_unit_types": 3,
        "unit_type_ids": {"brawler": 0, "MARINE": 1, "absent": 2},
        "ally_has_shields": false, "enemy_has_shields": false, "episode_limit": 60
    });
    let path = folder.path().join("brawl.json");
    std::fs::write(&path, scenario.to_string()).unwrap();
    let setup = BattleSetup {
        rules: Rules::Paper,
        episode_limit: EpisodeLimit::None,
        ..setup(path.to_str().unwrap())
    };
    let files = &setup.files.unit_files;
    let names: Vec<(&str, usize)> = files.iter().map(|file| (file.name.as_str(), file.keys.len())).collect();
    assert_eq!(names, [("brawler", 2), ("absent", 1)], "two names of a file are one file");
    let expected = Scenario::load(&path).unwrap();
    let (replay, _) = record(setup, 3, 1);
    let bytes = replay.to_bytes().unwrap();

    drop(folder);
    let copy = Replay::from_bytes(&bytes, "brawl.smreplay").unwrap();
    assert_eq!(copy.scenario(), &expected);
    assert_eq!((copy.arena().rules(), copy.arena().episode_limit()), (Rules::Paper, None));
    copy.verify().unwrap();
}

#[test]
fn episodes_start_anywhere_in_the_stream_of_a_seed() {
    let (replay, _) = record(setup("3m"), 5, 3);
    let starts: Vec<StreamPosition> = replay.episodes().iter().map(|episode| episode.start).collect();
    assert!(starts.iter().all(|start| start.seed == 5));
    assert!(starts[0].draws == 0 && starts[0].draws < starts[1].draws && starts[1].draws < starts[2].draws);

    // The second episode alone, as by a spectator who begins there.
    let mut recorder = Recorder::new(setup("3m"), 99).unwrap();
    recorder.begin(starts[1], Opponent::default());
    let second = &replay.episodes()[1];
    for actions in second.actions.chunks(3) {
        recorder.step(&actions.iter().map(|&action| action.into()).collect::<Vec<i32>>()).unwrap();
    }
    assert_eq!(recorder.finish().episodes(), std::slice::from_ref(second));
}

/// A page without an episode was written, and said only in the browser that it could not be shown.
#[test]
fn a_replay_without_an_episode_is_neither_played_nor_shown() {
    let replay = Recorder::new(setup("3m"), 1).unwrap().finish();
    let copy = Replay::from_bytes(&replay.to_bytes().unwrap(), "f").unwrap();
    let played = copy.play(0).map(|_| ()).map_err(|error| error.to_string());
    let page = smaclite_view::export_html(&copy).map(|_| ()).map_err(|error| error.to_string());
    let expected = Err("the replay has no episodes".to_owned());
    assert_eq!((played, page), (expected.clone(), expected));
}

/// A battle that was restored or forked begins where it was put.
#[test]
fn episodes_begin_in_the_state_of_a_snapshot() {
    let mut recorder = Recorder::new(setup("2s3z"), 3).unwrap();
    let mut policy = Random::new(3);
    let mut actions = vec![0; 5];
    let mut play = |recorder: &mut Recorder, steps: usize| {
        for _ in 0..steps {
            policy.act(recorder.battle(), &mut actions);
            recorder.step(&actions).unwrap();
        }
    };
    play(&mut recorder, 9);
    let snapshot = recorder.battle().save();
    play(&mut recorder, 5);
    recorder.begin_at(&snapshot).unwrap();
    play(&mut recorder, 7);
    let mut wounded = snapshot.clone();
    (wounded.units.hp[0], wounded.episode_length) = (1.0, 0);
    recorder.begin_at(&wounded).unwrap();
    play(&mut recorder, 3);
    let foreign = Recorder::new(setup("3m"), 0).unwrap().battle().save();
    assert!(recorder.begin_at(&foreign).is_err());
    let replay = recorder.finish();
    let copy = Replay::from_bytes(&replay.to_bytes().unwrap(), "f").unwrap();
    assert_same_episodes(&copy, &replay);
    copy.verify().unwrap();
    let steps = |replay: &Replay| -> Vec<_> {
        replay.episodes().iter().map(|episode| (episode.outcome.steps, episode.n_steps())).collect()
    };
    assert_eq!(steps(&copy), [(14, 14), (16, 7), (3, 3)]);
    let mut player = copy.play(1).unwrap();
    assert_eq!(
        player.moment().clone(),
        Observer::of_units(copy.scenario(), &snapshot.units).moment().clone()
    );
    player.seek(7).unwrap();
    let mut spoilt = json_of(&copy.to_bytes().unwrap());
    spoilt["episodes"][1]["snapshot"] = "AAAA".into();
    let error = Replay::from_bytes(&gzip(spoilt.to_string().as_bytes()), "f").unwrap_err().to_string();
    assert!(error.contains("`episodes[1].snapshot` must be a state of this scenario"), "{error}");
    // The page counts the steps of the second one from 9 on.
    let page = smaclite_view::export_html(&copy).unwrap();
    assert_eq!(page.matches("\"first_step\":0,").count(), 2);
    assert_eq!(page.matches("\"first_step\":9,").count(), 1);
}

/// The published code's greatest return grows with every reset, so that an episode depends on those before
/// it, and grows otherwise where an episode was left before its end.
#[test]
fn episodes_with_the_published_faults_are_reproduced_alone() {
    let stalkers = r#""groups": [
        {"x": 12, "y": 16, "faction": "ALLY", "units": {"STALKER": 2}},
        {"x": 20, "y": 16, "faction": "ENEMY", "units": {"STALKER": 2}}]"#;
    let drawn = r#"
        "teams": {"distribution": "weighted_teams", "unit_types": ["STALKER", "ZEALOT"], "weights": [1, 1]},
        "start_positions": {"distribution": "surrounded"}"#;
    for (kind, units) in [("fixed", stalkers), ("generated", drawn)] {
        let text = format!(
            r#"{{"name": "a", "num_allied_units": 2, "num_enemy_units": 2, {units}, "attack_point": [12, 16],
            "terrain_preset": "SIMPLE", "num_unit_types": 0, "ally_has_shields": true,
            "enemy_has_shields": true, "episode_limit": 40, "smacv2": {{"published": true}}}}"#
        );
        let files = ScenarioFiles { source: kind.into(), text, unit_files: Vec::new() };
        let mut recorder = Recorder::new(BattleSetup::new(files), 3).unwrap();
        let mut actions = vec![0; 2];
        for steps in [3, 1000, 5, 1000, 1000] {
            for _ in 0..steps {
                policy::nearest(recorder.battle(), &mut actions);
                recorder.step(&actions).unwrap();
                if recorder.battle().is_over() {
                    break;
                }
            }
            recorder.reset();
        }
        // As the player begins an episode without a state.
        recorder.begin(StreamPosition { seed: 8, draws: 0 }, Opponent::default());
        policy::nearest(recorder.battle(), &mut actions);
        recorder.step(&actions).unwrap();
        let replay = recorder.finish();
        let copy = Replay::from_bytes(&replay.to_bytes().unwrap(), "f").unwrap();
        assert_same_episodes(&copy, &replay);
        copy.verify().unwrap_or_else(|error| panic!("{kind}: {error}"));
        assert_eq!(copy.episodes().len(), 6, "{kind}");
        assert!(copy.episodes()[1].outcome.terminated, "{kind}");
    }
}

#[test]
fn seeking_gives_the_moments_of_playing_through() {
    let (replay, moments) = record(setup("2s3z"), 2, 1);
    let steps = replay.episodes()[0].step_checksums.len();
    let mut player = replay.play(0).unwrap();
    for step in [0, 33, 3, steps, 17, 16, 15, 0] {
        player.seek(step).unwrap();
        assert_eq!(player.next().unwrap().unwrap(), moments[step * 8], "step {step}");
        assert_eq!(player.step(), step);
    }
    player.seek(20).unwrap();
    let rest = player.by_ref().collect::<Result<Vec<_>, _>>().unwrap();
    assert_eq!(rest, moments[160..]);
    let error = player.seek(steps + 1).unwrap_err();
    assert!(matches!(error, ReplayError::NoSuchStep { .. }), "{error}");
    assert!(matches!(replay.play(1), Err(ReplayError::NoSuchEpisode { episode: 1, n_episodes: 1 })));
}

/// Its file was refused.
#[test]
fn an_episode_that_is_stepped_beyond_its_limit_is_read_again() {
    let limited = BattleSetup { episode_limit: EpisodeLimit::Steps(3), ..setup("3m") };
    let mut recorder = Recorder::new(limited, 1).unwrap();
    for _ in 0..5 {
        recorder.step(&[1; 3]).unwrap();
    }
    let copy = Replay::from_bytes(&recorder.finish().to_bytes().unwrap(), "test").unwrap();
    assert_eq!(copy.episodes()[0].outcome.steps, 5);
    copy.verify().unwrap();
}

/// The battle had gone on, and stood at another moment than the player said.
#[test]
fn after_a_step_that_diverges_a_player_goes_back_and_fails_again() {
    let (replay, moments) = record(setup("3m"), 4, 1);
    let mut changed = json_of(&replay.to_bytes().unwrap());
    let checksum = &mut changed["episodes"][0]["step_checksums"][5];
    *checksum = (checksum.as_u64().unwrap() ^ 1).into();
    let replay = Replay::from_bytes(&gzip(changed.to_string().as_bytes()), "test").unwrap();
    let mut player = replay.play(0).unwrap();
    for _ in 0..2 {
        assert!(matches!(player.seek(8), Err(ReplayError::Diverged { step: 5, .. })));
        assert!(matches!(player.play_step(), Err(ReplayError::Diverged { step: 5, .. })));
    }
    player.seek(5).unwrap();
    assert_eq!(player.next().unwrap().unwrap(), moments[5 * 8]);
    assert_eq!(player.battle().episode_length(), 5);
}

#[test]
fn what_cannot_be_reproduced_is_named_by_episode_and_step() {
    let (replay, _) = record(setup("3m"), 4, 2);
    let original = json_of(&replay.to_bytes().unwrap());
    let check = |change: &dyn Fn(&mut Value), expected: &str| {
        let mut changed = original.clone();
        change(&mut changed["episodes"][1]);
        let replay = Replay::from_bytes(&gzip(changed.to_string().as_bytes()), "test").unwrap();
        let error = replay.verify().unwrap_err().to_string();
        assert!(error.contains(expected), "{error}, expected {expected}");
        let mut player = replay.play(1).unwrap();
        assert_eq!(player.by_ref().filter(Result::is_err).count(), 1, "an iterator ends after its error");
    };
    check(
        &|episode| episode["step_checksums"][5] = (episode["step_checksums"][5].as_u64().unwrap() ^ 1).into(),
        "episode 1, step 5: the checksum of the step must be",
    );
    check(&|episode| episode["checksum"] = "0123456789abcdef".into(), "the checksum of the episode must be");
    check(&|episode| episode["seed"] = 8.into(), ": the checksum of the step must be");
    check(&|episode| episode["draws"] = 0.into(), ": the checksum of the step must be");
    check(&|episode| episode["dead_enemies"] = 77.into(), "`dead_enemies` must be");
    check(
        &|episode| episode["actions"][9] = 0.into(),
        "episode 1, step 3: agent 0: action 0 is not available",
    );
    check(
        &|episode| episode["actions"][9] = if episode["actions"][9] == 2 { 3.into() } else { 2.into() },
        "episode 1, step 3: the checksum of the step",
    );
}

#[test]
fn wrong_values_are_named() {
    let (replay, _) = record(setup("3m"), 4, 1);
    let original = json_of(&replay.to_bytes().unwrap());
    let check = |key: &str, value: Value, expected: &str| {
        let mut changed = original.clone();
        *changed.pointer_mut(key).unwrap_or_else(|| panic!("{key}")) = value;
        let error = Replay::from_bytes(&gzip(changed.to_string().as_bytes()), "f").unwrap_err().to_string();
        assert!(error.contains(expected), "{error}, expected {expected}");
    };
    check(
        "/format",
        "zip".into(),
        "f: expected a replay, which is JSON compressed by gzip: `format` must be",
    );
    check("/version", 2.into(), "f: `version` must be 1, got 2; it was written by smaclite-pool");
    let rules = "f: `rules` must be \"smaclite\", \"paper\" or \"starcraft-1\", got starcraft-2";
    check("/rules", "starcraft-2".into(), rules);
    check("/episode_limit", 0.into(), "`episode_limit` must be at least 1");
    check("/episodes/0/draws", (-1).into(), "invalid value: integer `-1`");
    check("/episodes/0/steps", 0.into(), "`episodes[0].steps` must be at least 1, got 0");
    check(
        "/episodes/0/steps",
        u32::MAX.into(),
        "`episodes[0].step_checksums` must be a list of length 4294967295",
    );
    check("/episodes/0/actions", json!([1, 2]), "`episodes[0].actions` must be a list of length");
    check("/episodes/0/actions/4", 9.into(), "`episodes[0].actions[4]` must be between 0 and 8, got 9");
    check("/episodes/0/actions/4", (-1).into(), "invalid value: integer `-1`");
    check("/episodes/0/checksum", "+123456789abcdef".into(), "must be 16 hexadecimal digits");
    check("/episodes/0/seed", json!({"more": 1}), "invalid type");
    let expected = "scenario of the replay: scenarios/data/3m.json:1:1: `name` is missing";
    check("/scenario/text", "{}".into(), expected);
    let mut hostile = original.clone();
    (hostile["scenario"]["file"], hostile["scenario"]["text"]) = ("\u{1b}[31mX".into(), "{}".into());
    let error = Replay::from_bytes(&gzip(hostile.to_string().as_bytes()), "f").unwrap_err().to_string();
    assert!(error.contains("scenario of the replay: ?[31mX:1:1"), "{error:?}");
    let unknown = original["scenario"]["text"].as_str().unwrap().replace("MARINE", "GHOST");
    let expected =
        "GHOST` is neither a standard unit type nor a unit file (no unit file came with the scenario)";
    check("/scenario/text", unknown.into(), expected);
}

/// A text where a number belongs was repeated at any length.
#[test]
fn wrong_values_are_cut() {
    let (replay, _) = record(setup("3m"), 4, 1);
    let mut changed = json_of(&replay.to_bytes().unwrap());
    changed["episodes"][0]["step_checksums"][3] = "x".repeat(3000).into();
    let error = Replay::from_bytes(&gzip(changed.to_string().as_bytes()), "f").unwrap_err().to_string();
    assert!(
        error.contains(": invalid type: string \"xxx") && error.contains(" at line 1 column "),
        "{error}"
    );
    assert!(error.len() < 400, "{error}");
}

#[test]
fn damaged_files_are_errors() {
    let (replay, _) = record(setup("2m_vs_1z"), 4, 1);
    let bytes = replay.to_bytes().unwrap();
    for length in 0..bytes.len() {
        let error = Replay::from_bytes(&bytes[..length], "f").unwrap_err();
        assert!(matches!(error, ReplayError::NotAReplay { .. }), "{length}: {error}");
    }
    // A changed bit is an error, or has no meaning: some are in gzip's header (time, level, system), and some
    // make the compressed data refer to another copy of the same text.
    let mut accepted = 0;
    for (at, bit) in (0..bytes.len()).flat_map(|at| (0..8).map(move |bit| (at, bit))) {
        let mut changed = bytes.clone();
        changed[at] ^= 1 << bit;
        if let Ok(copy) = Replay::from_bytes(&changed, "f") {
            assert_same_episodes(&copy, &replay);
            accepted += 1;
        }
    }
    assert!(accepted < 80, "{accepted} of {} bits", bytes.len() * 8);
    let error = Replay::from_bytes(&[&bytes[..], b"more"].concat(), "f").unwrap_err().to_string();
    assert!(error.contains("4 bytes follow the compressed data"), "{error}");
}

#[test]
fn a_file_that_inflates_without_end_is_refused() {
    let bomb = gzip(&vec![b' '; MAX_JSON_BYTES as usize + 1]);
    assert!(bomb.len() < 100_000);
    let error = Replay::from_bytes(&bomb, "bomb").unwrap_err().to_string();
    assert_eq!(error, "bomb: a replay must have at most 67108864 bytes of JSON");
    let nested = gzip("[".repeat(1 << 20).as_bytes());
    assert!(matches!(Replay::from_bytes(&nested, "nested"), Err(ReplayError::NotAReplay { .. })));
}
