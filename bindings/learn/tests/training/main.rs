//! Whole runs, with pools in this process: a team learns, equal seeds give equal bits, a resumed run is the
//! uninterrupted one, and wrong lanes and files are refused.

mod kit;
mod maps;
mod seeds;
mod self_play;
mod single_battles;

use crate::kit::{Place, check_resumed, check_threads, complete, evaluated, scenario, small};
use serde_json::Value;
use smaclite_engine::{BattleSetup, EpisodeLimit, Rules};
use smaclite_ipc::{LaneConfig, Supervisor, SupervisorConfig};
use smaclite_learn::{
    Algorithm, Config, EvaluationFiles, Lanes, NetworkKind, Run, RunDescription, TrainedTeam, Weights,
};
use smaclite_pool::fields::FieldSet;
use smaclite_pool::{Autoreset, PoolOptions};
use smaclite_scenarios::ScenarioFiles;
use std::fs;

/// The random policy has a return of 1.4 (docs/reference/policies.md).
#[test]
fn a_team_learns() {
    let place = Place::new();
    let units = NetworkKind::Units;
    for (name, algorithm, network) in [
        ("mappo", Algorithm::Mappo, NetworkKind::Flat),
        ("ippo", Algorithm::Ippo, NetworkKind::Flat),
        ("mappo-units", Algorithm::Mappo, units),
        ("ippo-units", Algorithm::Ippo, units),
    ] {
        let config = Config { seed: 1, steps: 45_000, algorithm, ..Config::for_agents(3) };
        let record = place.train(name, &config.with_network(network), 2);
        assert!(record.steps >= 45_000 && record.mean_return > 3.5, "{name}: {record:?}");
        let (result, _) = place.evaluate(name, 64);
        assert!(result.mean_return > 3.5, "{name}: {result:?}");
    }
}

#[test]
fn equal_seeds_give_equal_bits_for_any_number_of_threads() {
    check_threads(&Config { lr_end: 0.5, entropy_end: 0.0, ..small() });
    check_threads(&Config { last_actions: 1, ..over_units() });
    let place = Place::new();
    place.train("one", &small(), 1);
    place.train("other", &Config { seed: 4, ..small() }, 1);
    assert_ne!(place.outcome("one").0, place.outcome("other").0);
}

/// The small run with networks over units, whose widths are no multiples of those of vectors.
fn over_units() -> Config {
    Config { network: NetworkKind::Units, hidden: vec![11, 9], ..small() }
}

#[test]
fn a_resumed_run_is_the_uninterrupted_one() {
    check_resumed(&Config { steps: 34 * 158, epochs: 1, ..small() }, &Place::new());
    check_resumed(&Config { steps: 34 * 158, epochs: 1, ..over_units() }, &Place::new());
}

/// They had no critic then.
#[test]
fn best_weights_that_were_lost_are_written_again_as_they_were() {
    let place = Place::new();
    place.train("run", &evaluated(), 1);
    let best = place.path("run/best.safetensors");
    let before = fs::read(&best).unwrap();
    fs::remove_file(&best).unwrap();
    drop(Run::resume(&place.path("run"), None, place.lanes(10, 1), 1).unwrap());
    assert!(fs::read(&best).unwrap() == before);
}

/// The header of its evaluations was taken for one, and its best weights for lost.
#[test]
fn a_run_that_was_interrupted_in_its_first_evaluation_plays_its_last_weights() {
    let place = Place::new();
    let mut run = place.begin("run", &evaluated(), 1);
    assert!(!run.train(&mut || true, &|_| {}).unwrap());
    let path = place.path("run");
    let played = || place.evaluate("run", 3).0.weights;
    let rows = fs::read_to_string(path.join("evaluations.csv")).unwrap();
    assert_eq!((rows.lines().count(), played()), (1, Weights::Last));
    let best = || TrainedTeam::open_with(&path, Some(Weights::Best)).unwrap_err().to_string();
    assert!(best().contains("/run` has no best.safetensors: it was not evaluated while"), "{}", best());
    // What a killed process left of a row is none.
    fs::write(path.join("evaluations.csv"), rows.clone() + "0,0,0,1.5").unwrap();
    assert_eq!(played(), Weights::Last);
    fs::write(path.join("evaluations.csv"), rows + "0,0,0,1.5,0.0,1.4,0.0,20.0,20.0,0.0,0.0\n").unwrap();
    assert!(best().contains("it was evaluated, so they were lost"), "{}", best());
    assert!(TrainedTeam::open(&path).unwrap_err().to_string() == best());
}

#[test]
fn networks_that_a_run_does_not_have_are_refused() {
    let place = Place::new();
    place.train("flat", &small(), 1);
    place.train("units", &over_units(), 1);
    assert_eq!(RunDescription::read(&place.path("units")).unwrap().config, over_units());
    let path = place.path("units/run.json");
    let mut file: Value = serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
    let mut refused = |key: &str, value: Value, expected: &str| {
        let before = std::mem::replace(&mut file["config"][key], value);
        fs::write(&path, file.to_string()).unwrap();
        let error = RunDescription::read(&place.path("units")).unwrap_err().to_string();
        assert!(error.contains("units/run.json` is") && error.contains(expected), "{error}");
        file["config"][key] = before;
    };
    let expected = "network must be `flat`, `units` or `universal`, got ";
    refused("network", "graph".into(), &format!("{expected}`graph`"));
    refused("network", Value::Null, &format!("{expected}`null`"));
    refused("hidden", vec![8].into(), "hidden must be 2 widths between 2 and 4096 for networks over units");
    // Weights of the other network are not those of this one.
    fs::copy(place.path("flat/weights.safetensors"), place.path("units/weights.safetensors")).unwrap();
    fs::write(path, file.to_string()).unwrap();
    let error = smaclite_learn::TrainedTeam::open(&place.path("units")).unwrap_err().to_string();
    assert!(error.contains("weights.safetensors") && error.contains("actor.own.weight"), "{error}");
}

#[test]
fn the_first_episodes_of_every_environment_count() {
    let place = Place::new();
    place.train("run", &small(), 1);
    let (result, counted) = place.evaluate("run", 150);
    assert_eq!((result.episodes, result.num_envs, counted.len()), (150, 64, 150));
    for env_id in 0..64 {
        let of_env = counted.iter().filter(|episode| episode.env_id == env_id);
        // 150 = 2 * 64 + 22
        let expected = 0..if env_id < 22 { 3 } else { 2 };
        assert!(of_env.map(|episode| episode.number).eq(expected), "environment {env_id}");
    }
    let mean = counted.iter().map(|counted| f64::from(counted.episode.episode_return)).sum::<f64>() / 150.0;
    assert!((result.mean_return - mean).abs() < 1e-9);
    assert_eq!(place.evaluate("run", 150), (result, counted), "equal seeds give equal episodes");
}

/// A pool with one lane, changed by `change`.
fn serve(place: &Place, map: &str, change: impl FnOnce(&mut LaneConfig)) -> Supervisor {
    let (_, files) = ScenarioFiles::resolve(map).unwrap();
    let mut lane = LaneConfig::new("lane", BattleSetup::new(files), 10);
    change(&mut lane);
    let config = SupervisorConfig {
        name: "pool".to_owned(),
        lanes: vec![lane],
        options: PoolOptions { threads: 1, ..PoolOptions::default() },
        runtime_dir: place.runtime_dir.clone(),
    };
    Supervisor::start(config).unwrap()
}

/// Its checkpoints have no snapshots, so a resumed run begins new episodes; with the field it is the
/// uninterrupted one.
#[test]
fn a_run_on_a_lane_without_snapshots_can_be_resumed() {
    let place = Place::new();
    let _pool = serve(&place, "3m", |_| {});
    let lanes = || Lanes::attach(&scenario(), &place.runtime_dir, "pool", &[], &mut || false).unwrap();
    let mut run = Run::begin(&place.path("run"), small(), &scenario(), lanes(), 1).unwrap();
    run.update(&mut || false).unwrap();
    run.checkpoint().unwrap();
    drop(run);
    assert!(complete(Run::resume(&place.path("run"), None, lanes(), 1).unwrap()).steps >= 930);
}

#[test]
fn a_team_observes_its_last_actions() {
    let place = Place::new();
    let config = Config { last_actions: 2, ..small() };
    let bits = |name: &str| {
        place.train(name, &config, 1);
        place.outcome(name)
    };
    assert_eq!(bits("run"), bits("again"));
    place.train("without", &small(), 1);
    assert_ne!(place.outcome("run"), place.outcome("without"));
    let description = RunDescription::read(&place.path("run")).unwrap();
    assert_eq!(description.config.last_actions, 2);
    assert_eq!(
        description.sizes.obs_size,
        place.lanes(10, 1).sizes().obs_size + 2 * description.sizes.n_actions
    );
    assert_eq!(place.evaluate("run", 12).0.episodes, 12);
    let lanes = place.lanes_with_history(10, 3, 1);
    let error = Run::resume(&place.path("run"), Some(2000), lanes, 1).err().unwrap().to_string();
    assert!(error.contains("appends 3 last actions") && error.contains("--obs-last-actions 2"), "{error}");
    let lanes = place.lanes_with_history(10, 2, 1);
    assert!(complete(Run::resume(&place.path("run"), Some(2000), lanes, 1).unwrap()).steps >= 2000);
}

/// Other programs read `run.json`, and later releases read those of this one.
#[test]
fn a_run_is_described_by_hyperparameters_files_rules_and_episode_limit() {
    let place = Place::new();
    let config = Config { advantage_floor: 0.0, ..small() };
    drop(place.begin("run", &config, 1));
    let path = place.path("run/run.json");
    let mut file: Value = serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
    let keys = |value: &Value| value.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    assert_eq!(keys(&file), ["config", "episode_limit", "files", "rules", "version"]);
    assert_eq!(keys(&file["files"]), ["source", "text", "unit_files"]);
    assert_eq!((&file["episode_limit"], &file["rules"]), (&60.into(), &"smaclite".into()));
    // Published weights and the files of older runs are of flat networks, and it does not say so.
    assert!(file["config"].get("network").is_none());
    // A run of an older release has no last actions and no floor of advantages.
    for name in ["last_actions", "advantage_floor"] {
        file["config"].as_object_mut().unwrap().remove(name).unwrap();
    }
    (file["episode_limit"], file["rules"]) = (Value::Null, "paper".into());
    fs::write(&path, file.to_string()).unwrap();
    let RunDescription { config: read, setup, .. } = RunDescription::read(&place.path("run")).unwrap();
    assert_eq!(read, config);
    assert_eq!(setup, BattleSetup { rules: Rules::Paper, episode_limit: EpisodeLimit::None, ..scenario() });
}

#[test]
fn lanes_that_a_team_cannot_play_on_are_refused() {
    let check = |map: &str, change: &dyn Fn(&mut LaneConfig), expected: &str| {
        let place = Place::new();
        let _pool = serve(&place, map, change);
        let error = Lanes::attach(&scenario(), &place.runtime_dir, "pool", &[], &mut || false)
            .err()
            .unwrap()
            .to_string();
        assert!(error.contains(expected), "{error}");
    };
    check("2s3z", &|_| {}, "lane `lane` plays 2s3z, but 3m was expected");
    check(
        "3m",
        &|lane| lane.setup.rules = Rules::Paper,
        "lane `lane` plays 3m, but 3m was expected; they differ in rules (paper instead of smaclite)",
    );
    check("3m", &|lane| lane.settings.batch_size = 5, "its batches have 5 of 10 environments");
    check("3m", &|lane| lane.settings.autoreset = Autoreset::SameStep, "has autoreset_mode `SameStep`, but");
    let without_state = |lane: &mut LaneConfig| {
        lane.settings.fields = FieldSet::from_names(["obs", "avail_actions"]).unwrap();
    };
    check("3m", &without_state, "does not serve the field `state`");
    check("3m", &|lane| lane.settings.obs_agent_id = true, "serve it without `--obs-agent-id`");
}

/// Two processes that write one folder would mix their logs and checkpoints. Locks are of open files, so two
/// runs of this process exclude each other as those of two processes do.
#[test]
fn a_folder_has_one_writer() {
    let place = Place::new();
    let run = place.begin("run", &small(), 1);
    let resume = || Run::resume(&place.path("run"), None, place.lanes(10, 1), 1);
    let error = resume().err().unwrap().to_string();
    assert!(error.contains("another process trains in") && error.contains("run"), "{error}");
    fs::remove_file(place.path("run").join("run.json")).unwrap();
    let begun = Run::begin(&place.path("run"), small(), &scenario(), place.lanes(10, 1), 1);
    assert!(begun.err().unwrap().to_string().contains("another process trains in"));
    drop(run);
    let begun = Run::begin(&place.path("run"), small(), &scenario(), place.lanes(10, 1), 1);
    drop(begun.unwrap());
    assert!(complete(resume().unwrap()).steps >= 930);
}

#[test]
fn folders_and_settings_that_do_not_fit_are_refused() {
    let place = Place::new();
    place.train("run", &small(), 1);
    let begin = |config: Config, num_envs| {
        let lanes = place.lanes(num_envs, 1);
        Run::begin(&place.path("run"), config, &scenario(), lanes, 1).err().unwrap().to_string()
    };
    assert!(begin(small(), 10).contains("already holds a run"));
    let path = place.path("run");
    fs::remove_file(path.join("run.json")).unwrap();
    let lost = "/run` has checkpoint.safetensors, a file of a run, but no run.json, which says what";
    assert!(begin(small(), 10).contains(lost), "{}", begin(small(), 10));
    fs::rename(path.join("checkpoint.safetensors"), path.join("kept")).unwrap();
    let error = begin(small(), 9);
    assert!(error.contains("the lanes have 9 environments, but the run has 10"), "{error}");
    let error = begin(Config { gamma: 1.5, ..small() }, 10);
    assert!(error.contains("gamma must be between 0 and 1, got 1.5"), "{error}");
    let resume = || Run::resume(&place.path("run"), None, place.lanes(10, 1), 1).err().unwrap().to_string();
    assert!(resume().contains("it has no run.json"), "{}", resume());
    fs::write(place.path("run").join("run.json"), "{}").unwrap();
    assert!(resume().contains("run.json` is damaged or not a file of a run: missing field"), "{}", resume());
}

/// A complete run that was extended kept the evaluations that it played before it was set back, and they
/// chose its best weights. And those before an interruption were missing in TensorBoard.
#[test]
fn a_run_that_is_set_back_has_no_evaluations_after_its_end() {
    let place = Place::new();
    let config = Config { steps: 20, evaluate_every: Some(20), ..small() };
    place.train("run", &config, 1);
    let rows = || EvaluationFiles::of(&place.path("run")).rows().unwrap();
    let steps = || rows().iter().map(|row| row.steps).collect::<Vec<_>>();
    assert_eq!(steps(), [0, 20]);
    let resume = |steps| Run::resume(&place.path("run"), Some(steps), place.lanes(10, 1), 1).unwrap();
    assert!(!resume(2000).train(&mut || rows().len() >= 4, &|_| {}).unwrap());
    let played = rows().len();
    assert!(played >= 4);
    let events = fs::read_dir(place.path("run")).unwrap().map(|entry| entry.unwrap().path());
    let events = events.filter(|path| path.file_name().unwrap().to_string_lossy().starts_with("events"));
    let logged = |path| {
        let bytes = fs::read(path).unwrap();
        bytes.windows(b"greedy_win_rate".len()).filter(|tag| tag == b"greedy_win_rate").count()
    };
    assert_eq!(events.map(logged).sum::<usize>(), played);
    assert!(resume(20).train(&mut || false, &|_| {}).unwrap());
    assert_eq!(steps(), [0, 20]);
}
