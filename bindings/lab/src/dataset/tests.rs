//! Datasets are recorded, expanded and read with the same bits, for any number of threads and of episodes;
//! and files that are damaged are refused (`damage`).

mod damage;

use super::*;
use smaclite_engine::policy::Tactic;
use smaclite_engine::{Battle, EpisodeLimit, Faction, Rules, Scratch, Sides};
use smaclite_learn::{Config, EvaluationRow, Lanes, Run, Summary, Weights, resolve_scenario};
use smaclite_scenarios::ScenarioFiles;

/// Shorter than some of the episodes.
const LIMIT: u32 = 45;

fn script(scenario: &str, limit: u32) -> Source {
    let setup = resolve_scenario(scenario, Rules::Smaclite).unwrap();
    let setup = BattleSetup { episode_limit: EpisodeLimit::Steps(limit), ..setup };
    Source::Script { setup, tactic: Tactic::Random }
}

fn record(source: Source, amount: Amount, threads: usize) -> Result<Dataset, DatasetError> {
    let recording = Recording { source, amount, seed: 3, greedy: false, threads };
    Dataset::record(&recording, &mut || false)
}

/// Some episodes of 2s3z, of which the short limit truncates some.
pub(super) fn recorded(threads: usize) -> Dataset {
    let (source, amount) = (script("2s3z", LIMIT), Amount::Episodes(40));
    let recording = Recording { source, amount, seed: 7, greedy: false, threads };
    Dataset::record(&recording, &mut || false).unwrap()
}

fn bytes_of(dataset: &Dataset) -> Vec<u8> {
    let file = tempfile::NamedTempFile::new().unwrap();
    dataset.write(file.path()).unwrap();
    std::fs::read(file.path()).unwrap()
}

fn read(bytes: &[u8]) -> Result<Dataset, String> {
    Dataset::from_reader(bytes, "3m.smdata").map_err(|error| error.to_string())
}

fn all(dataset: &Dataset, threads: usize) -> Vec<(ArrayName, Values)> {
    dataset.expand(&ArrayName::ALL, threads, &mut || false).unwrap()
}

/// What is recorded, written, read and expanded does not depend on the number of threads.
#[test]
fn threads_change_no_bit() {
    let dataset = recorded(1);
    let bytes = bytes_of(&dataset);
    assert_eq!(bytes_of(&recorded(3)), bytes);
    let read = read(&bytes).unwrap();
    let expected = all(&dataset, 1);
    for threads in [1, 2, 5] {
        assert!(all(&read, threads) == expected, "{threads} threads");
    }
}

/// The arrays have the rows that a battle gives which is played step by step, and the last observations
/// apart.
#[test]
fn arrays_are_what_battles_give() {
    let dataset = recorded(2);
    let arrays = all(&dataset, 2);
    let floats = |array: ArrayName| -> &[f32] { bytemuck::cast_slice(arrays[array as usize].1.bytes()) };
    let Sizes { n_agents, obs_size, state_size, .. } = dataset.sizes();
    let (mut obs, mut state) = (vec![0.0; n_agents * obs_size], vec![0.0; state_size]);
    let mut scratch = Scratch::new();
    for (i, episode) in dataset.episodes().iter().enumerate() {
        let mut battle = Battle::new(Arc::clone(&dataset.arena), episode.seed);
        for step in dataset.steps_of(i) {
            battle.write_obs(Faction::Ally, &mut obs, &mut scratch);
            assert_eq!(floats(ArrayName::Obs)[step * obs.len()..][..obs.len()], obs);
            let actions: Vec<i32> = dataset.actions_of(step).iter().map(|&action| action.into()).collect();
            let reward = battle.step(&actions, &mut scratch).unwrap().reward as f32;
            assert_eq!(floats(ArrayName::Reward)[step], reward);
        }
        assert!(battle.is_over());
        battle.write_state(Faction::Ally, &mut state);
        assert_eq!(floats(ArrayName::FinalState)[i * state_size..][..state_size], state);
    }
}

/// Every episode ends in its last step and nowhere else, and a truncated one is not terminated.
#[test]
fn terminated_and_truncated_are_kept_apart() {
    let dataset = recorded(2);
    let arrays = all(&dataset, 2);
    let bools = |array: ArrayName| arrays[array as usize].1.bytes();
    let mut ends = [0; 2];
    for (i, episode) in dataset.episodes().iter().enumerate() {
        let steps = dataset.steps_of(i);
        for step in steps.clone() {
            let is_end = |array| bools(array)[step] != 0;
            let (terminated, truncated) = (is_end(ArrayName::Terminated), is_end(ArrayName::Truncated));
            assert_eq!(terminated || truncated, step + 1 == steps.end);
            assert!(!(terminated && truncated));
            assert_eq!(is_end(ArrayName::BattleWon), step + 1 == steps.end && episode.end.battle_won);
        }
        ends[usize::from(episode.end.truncated)] += 1;
    }
    assert!(ends.iter().all(|count| *count > 0), "the test needs both: {ends:?}");
}

#[test]
fn files_of_numpy_have_the_same_bytes() {
    let dataset = recorded(2);
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("arrays");
    dataset.expand_to(&out, &ArrayName::ALL, 3, &mut || false).unwrap();
    for (array, values) in all(&dataset, 1) {
        let bytes = std::fs::read(out.join(format!("{}.npy", array.spec().name))).unwrap();
        let (head, elements) = bytes.split_at(128);
        assert!(elements == values.bytes(), "{array:?}");
        assert!(head.starts_with(b"\x93NUMPY\x01\x00") && head.ends_with(b"\n"));
    }
    let error = dataset.expand_to(&out, &ArrayName::ALL, 3, &mut || false).unwrap_err().to_string();
    assert!(error.contains("must be written to a new folder"), "{error}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left beside it");
}

#[test]
fn the_card_counts_what_was_played() {
    let dataset = recorded(2);
    let card = dataset.card();
    let arrays = all(&dataset, 1);
    let rewards: &[f32] = bytemuck::cast_slice(arrays[ArrayName::Reward as usize].1.bytes());
    let total: f64 = rewards.iter().map(|reward| f64::from(*reward)).sum();
    assert!((card.returns.mean * 40.0 - total).abs() < 1e-6 * total);
    assert_eq!((card.episodes, card.steps), (40, dataset.n_steps()));
    assert!(card.coverage > 0.9 && card.coverage <= 1.0, "{}", card.coverage);
    assert_eq!(card.policies.len(), 1);
    assert_eq!(card.policies[0].name, "random");
    assert!(card.returns.min <= card.returns.median && card.returns.median <= card.returns.max);
}

#[test]
fn battles_that_do_not_end_or_have_two_players_are_refused() {
    let Source::Script { setup, tactic } = script("3m", 60) else { unreachable!() };
    let endless = BattleSetup { episode_limit: EpisodeLimit::None, ..setup.clone() };
    let both = setup.with_sides(Sides::Both);
    for (setup, expected) in [(endless, "must have an episode limit"), (both, "both sides")] {
        let source = Source::Script { setup, tactic };
        let error = record(source, Amount::Episodes(1), 1).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn as_many_steps_are_recorded_as_are_asked_for() {
    let dataset = record(script("3m", 60), Amount::Steps(500), 2).unwrap();
    let last = dataset.episodes().last().unwrap().length as usize;
    assert!(dataset.n_steps() >= 500 && dataset.n_steps() - last < 500, "{}", dataset.n_steps());
}

/// Teams, start positions and opponents that are drawn for each episode are drawn again.
#[test]
fn generated_battles_are_played_again() {
    let Source::Script { setup, tactic } = script("terran_5_vs_5", 60) else { unreachable!() };
    let opponents = "attack_move=1,focus_fire=3,kite=0.7".parse().unwrap();
    let source = Source::Script { setup: BattleSetup { opponents, ..setup }, tactic };
    let dataset = record(source, Amount::Episodes(20), 2).unwrap();
    assert_eq!(all(&read(&bytes_of(&dataset)).unwrap(), 1), all(&dataset, 2));
}

/// Battles in which one of two types is drawn for each unit, with these options of SMACv2's interface.
fn generated(types: [&str; 2], smacv2: &str) -> Source {
    let [a, b] = types;
    let text = format!(
        r#"{{"name": "drawn", "ally_has_shields": false, "enemy_has_shields": false, "episode_limit": 30,
        "terrain_preset": "FLAT", "start_positions": {{"distribution": "surrounded"}}, "smacv2": {smacv2},
        "teams": {{"distribution": "all_teams", "unit_types": ["{a}", "{b}"]}}, "num_allied_units": 2,
        "num_enemy_units": 2, "num_unit_types": 2, "unit_type_ids": {{"{a}": 0, "{b}": 1}}}}"#
    );
    let files = ScenarioFiles { source: "drawn.json".into(), text, unit_files: Vec::new() };
    Source::Script { setup: BattleSetup::new(files), tactic: Tactic::Kite }
}

/// Scripts were recorded that acted by what no learner sees, as `ScriptedPolicy` of Python refuses to.
#[test]
fn a_script_that_reads_more_than_states_have_is_refused() {
    let Source::Script { setup, .. } = generated(["MARINE", "MEDIVAC"], "{}") else { unreachable!() };
    let json = |text: &str| serde_json::from_str::<serde_json::Value>(text).unwrap();
    let no_numbers = [("num_unit_types", json("0")), ("unit_type_ids", json("null"))];
    let no_units = [("smacv2", json(r#"{"obs_instead_of_state": true}"#))];
    for (keys, expected) in [
        (&no_numbers[..], "the policy kite reads the types of units in states, but these do not tell apart"),
        (&no_units[..], "the policy kite reads the units of states, but `obs_instead_of_state` of `smacv2`"),
    ] {
        let keys = keys.iter().map(|(key, value)| ((*key).to_owned(), value.clone()));
        let setup = BattleSetup::new(setup.files.with_keys(keys));
        let play = |tactic| record(Source::Script { setup: setup.clone(), tactic }, Amount::Episodes(1), 1);
        let error = play(Tactic::Kite).unwrap_err().to_string();
        assert!(error.starts_with(expected), "{error}");
        play(Tactic::Random).unwrap();
    }
}

/// They were over before their only step, and a dataset of them could not be read.
#[test]
fn battles_that_draw_healers_alone_have_one_step() {
    let dataset = record(generated(["MARINE", "MEDIVAC"], "{}"), Amount::Episodes(30), 2).unwrap();
    let lengths = || dataset.episodes().iter().map(|episode| episode.length);
    assert!(lengths().any(|length| length == 1) && lengths().all(|length| length >= 1));
    assert_eq!(all(&read(&bytes_of(&dataset)).unwrap(), 1), all(&dataset, 2));
}

/// The published fault of SMACv2's interface leaves its greatest return to the next episode, so that rewards
/// depended on what the same thread had played before.
#[test]
fn episodes_do_not_depend_on_those_before_them() {
    let source = || generated(["MARINE", "MARAUDER"], r#"{"published": true}"#);
    let bytes = bytes_of(&record(source(), Amount::Episodes(30), 1).unwrap());
    assert_eq!(bytes_of(&record(source(), Amount::Episodes(30), 4).unwrap()), bytes);
    let dataset = read(&bytes).unwrap();
    assert_eq!(all(&dataset, 1), all(&dataset, 5));
}

/// The folder of a run with two evaluations.
fn run_with_evaluations(folder: &std::path::Path) {
    let runtime_dir = smaclite_ipc::RuntimeDir::at(folder.join("pools")).unwrap();
    let setup = resolve_scenario("3m", Rules::Smaclite).unwrap();
    let small = Config { num_envs: 4, horizon: 8, minibatches: 2, hidden: vec![8], ..Config::for_agents(3) };
    let begin = |name: &str, seed| {
        let lanes = Lanes::start(&setup, small.num_envs, small.last_actions, 1, &runtime_dir).unwrap();
        let config = Config { seed, ..small.clone() };
        Run::begin(&folder.join(name), config, &setup, lanes, 1).unwrap().checkpoint().unwrap();
    };
    begin("run", 1);
    begin("other", 2);
    std::fs::create_dir(folder.join("run/evaluations")).unwrap();
    for (steps, of) in [(100, "run"), (200, "other")] {
        let path = folder.join(format!("run/evaluations/{steps:012}.safetensors"));
        std::fs::copy(folder.join(of).join(Weights::Last.file_name()), path).unwrap();
    }
}

fn of_run(folder: &std::path::Path, quality: Option<Quality>) -> Source {
    Source::Run { folder: folder.join("run"), quality, opponents: None }
}

/// The table of evaluations of that run, with steps and sampled win rates.
fn write_evaluations(folder: &std::path::Path, evaluations: &[(u64, f64)]) {
    let line = |&(steps, win_rate): &(u64, f64)| {
        let (sampled, greedy) = (Summary { win_rate, ..Summary::default() }, Summary::default());
        let (trained_steps, updates, seconds, cpu_seconds) = (steps, 1, 1.0, 1.0);
        EvaluationRow { steps, trained_steps, updates, greedy, sampled, seconds, cpu_seconds }.line()
    };
    let lines: String = evaluations.iter().map(line).collect();
    let table = EvaluationRow::COLUMNS.join(",") + "\n" + &lines;
    std::fs::write(folder.join("run/evaluations.csv"), table).unwrap();
}

/// A team chooses the actions of some episodes at once. Which these are must not depend on the threads, nor
/// on how many episodes are wanted.
#[test]
fn threads_and_amounts_change_no_action_of_a_team() {
    let folder = tempfile::tempdir().unwrap();
    run_with_evaluations(folder.path());
    write_evaluations(folder.path(), &[(100, 0.25), (200, 0.5)]);
    let record =
        |quality, amount, threads| record(of_run(folder.path(), Some(quality)), amount, threads).unwrap();
    for amount in [Amount::Episodes(150), Amount::Steps(9000)] {
        let one = bytes_of(&record(Quality::Replay, amount, 1));
        for threads in [2, 3, 8] {
            assert!(
                bytes_of(&record(Quality::Replay, amount, threads)) == one,
                "{amount:?}, {threads} threads"
            );
        }
    }
    let all = record(Quality::Good, Amount::Episodes(70), 2);
    for episodes in [1, 33, 69] {
        let some = record(Quality::Good, Amount::Episodes(episodes), 2);
        assert_eq!(some.episodes, all.episodes[..episodes]);
        assert!(some.actions == all.actions[..some.actions.len()], "{episodes} of 70 episodes");
    }
}

#[test]
fn the_weights_of_evaluations_are_recorded_by_their_quality() {
    let folder = tempfile::tempdir().unwrap();
    run_with_evaluations(folder.path());
    let record = |quality| record(of_run(folder.path(), quality), Amount::Steps(400), 2);
    let names = |dataset: &Dataset| -> Vec<String> {
        dataset.policies().iter().map(|policy| policy.name.clone()).collect()
    };
    assert_eq!(names(&record(None).unwrap()), ["run/weights.safetensors"]);
    let error = record(Some(Quality::Good)).unwrap_err().to_string();
    assert!(error.contains("the run has no evaluations") && error.contains("leave --quality out"), "{error}");

    write_evaluations(folder.path(), &[(100, 0.25), (200, 0.5)]);
    let [good, medium] = [Quality::Good, Quality::Medium].map(|quality| record(Some(quality)).unwrap());
    assert_eq!(names(&good), ["run/evaluations/000000000200.safetensors"]);
    assert_eq!(names(&medium), ["run/evaluations/000000000100.safetensors"]);
    assert!(good.actions != medium.actions);

    let replay = record(Some(Quality::Replay)).unwrap();
    let cards = &replay.card().policies;
    assert_eq!(replay.policies()[0].sampled_win_rate, Some(0.25));
    assert!(cards.iter().all(|card| card.steps >= 200 && card.steps < 200 + 60), "{cards:?}");
    let of_episodes = |n| {
        let source = of_run(folder.path(), Some(Quality::Replay));
        let recording = Recording { source, amount: Amount::Episodes(n), seed: 3, greedy: true, threads: 2 };
        let dataset = Dataset::record(&recording, &mut || false).unwrap();
        dataset.card().policies.iter().map(|card| card.episodes).collect::<Vec<_>>()
    };
    assert_eq!((of_episodes(7), of_episodes(1)), (vec![3, 4], vec![0, 1]));

    let best = folder.path().join("run/best.safetensors");
    std::fs::copy(folder.path().join("run/weights.safetensors"), best).unwrap();
    assert_eq!(names(&record(None).unwrap()), ["run/best.safetensors"]);

    let seeds: Vec<u64> = replay.episodes().iter().map(|episode| episode.seed).collect();
    assert_eq!(seeds, (3..3 + seeds.len() as u64).collect::<Vec<_>>(), "no two episodes have the same seed");
    assert_eq!(all(&read(&bytes_of(&replay)).unwrap(), 1), all(&replay, 2));
}
