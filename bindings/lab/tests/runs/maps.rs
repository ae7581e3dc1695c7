//! Evaluations of runs on several maps: every map is played, and each is reported, verified and recorded as
//! one of its own.

use crate::kit::{Place, evaluated};
use crate::report::read;
use smaclite_engine::{BattleSetup, Rules};
use smaclite_lab::{time_to_win, verify};
use smaclite_learn::{
    Algorithm, Choice, Config, EvaluationFiles, NetworkKind, RunDescription, Seeds, TrainEvent, on_map,
    resolve_scenario,
};
use std::fs;
use std::sync::atomic::{AtomicUsize, Ordering};

fn universal() -> Config {
    let hidden = vec![8, 16];
    Config { hidden, algorithm: Algorithm::Mappo, ..evaluated().with_network(NetworkKind::Universal) }
}

fn begin(place: &Place, name: &str, count: u64) -> Seeds {
    let setups: Vec<BattleSetup> =
        ["3m", "2s3z"].iter().map(|name| resolve_scenario(name, Rules::default()).unwrap()).collect();
    Seeds::begin(&place.path(name), &universal(), count, &setups, &place.runtime_dir, &mut || false).unwrap()
}

#[test]
fn every_map_of_a_run_is_evaluated_and_reported() {
    let place = Place::new();
    begin(&place, "whole", 2).train(None, 2, &place.runtime_dir, &|| false, &|_, _| {});
    let updates = AtomicUsize::new(0);
    let count = |_: u64, event: TrainEvent| {
        let updated = matches!(event, TrainEvent::Updated(_));
        updates.fetch_add(usize::from(updated), Ordering::Relaxed);
    };
    let interrupted = || updates.load(Ordering::Relaxed) > 3;
    begin(&place, "resumed", 2).train(None, 1, &place.runtime_dir, &interrupted, &count);
    assert!(!place.path("resumed/seed-4/final.json").exists());
    let resumed = Seeds::open(&place.path("resumed"), None).unwrap().unwrap();
    resumed.train(None, 2, &place.runtime_dir, &|| false, &|_, _| {});
    for seed in ["seed-3", "seed-4"] {
        let [whole, resumed] = ["whole", "resumed"].map(|name| format!("{name}/{seed}"));
        assert_eq!(place.outcome(&whole), place.outcome(&resumed));
        assert!(place.evaluations(&whole) == place.evaluations(&resumed), "{seed}");
        let verified = verify(&place.path(&whole), 10, 2, &mut || false).unwrap();
        assert_eq!((verified.evaluations, verified.episodes), (4, 2 * (4 * 64 + 640)));
    }

    let benchmark = read(&place, &[("both", "whole")]).unwrap();
    assert_eq!(benchmark.tasks(), ["2s3z", "3m"]);
    let runs = &benchmark.algorithms[0].tasks;
    let of_maps = [&runs["3m"][0], &runs["2s3z"][0]];
    assert!(runs.values().all(|runs| runs.len() == 2));
    for run in of_maps {
        assert_eq!(run.final_episodes(Choice::Greedy).len(), 320);
        assert!(run.evaluations.iter().all(|evaluation| evaluation.episodes(Choice::Sampled).len() == 32));
        let time = time_to_win(run, Choice::Greedy, 2, &mut || false).unwrap();
        assert!(time.is_measured(), "{}: {time:?}", run.task);
    }
    // The means of the run are those of both maps.
    let [a, b] = of_maps.map(|run| run.evaluations[2].row.sampled.mean_length);
    let files = EvaluationFiles::of(&place.path("whole/seed-3"));
    let row = files.rows().unwrap()[2];
    assert!((row.sampled.mean_length - f64::midpoint(a, b)).abs() < 1e-9 && a != b, "{row:?}, {a}, {b}");
    // Datasets are of the first map, and so are the win rates of their policies.
    assert_eq!(files.rows_on_first(2).unwrap()[2].sampled.mean_length, a);
    let (_, both) = &files.episodes().unwrap()[2];
    let lengths = |map| on_map(&both[1], map, 2).iter().map(|episode| f64::from(episode.length)).sum::<f64>();
    assert_eq!([lengths(0) / 32.0, lengths(1) / 32.0], [a, b]);
}

#[test]
fn maps_that_do_not_share_their_episodes_are_refused() {
    let place = Place::new();
    begin(&place, "runs", 1).train(None, 1, &place.runtime_dir, &|| false, &|_, _| {});
    let folder = place.path("runs/seed-3");
    let other = RunDescription::read(&folder).unwrap().other_maps;
    let path = folder.join("run.json");
    let mut run: serde_json::Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    let mut third = serde_json::to_value(&other[0]).unwrap();
    let text = third["files"]["text"].as_str().unwrap().replacen("2s3z", "other", 1);
    third["files"]["text"] = text.into();
    run["other_maps"].as_array_mut().unwrap().push(third);
    fs::write(&path, run.to_string()).unwrap();
    let error = read(&place, &[("both", "runs")]).unwrap_err();
    assert!(error.contains("it has an evaluation of 64 episodes, which 3 maps cannot share"), "{error}");
}
