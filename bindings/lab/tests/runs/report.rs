//! Reports of runs that were evaluated: what is found in folders, compared, and refused.

use crate::kit::{Place, evaluated, scenario, small};
use serde_json::Value;
use smaclite_lab::{Benchmark, Estimate, FirstWin, Metric, Report, marl_eval_json, time_to_win};
use smaclite_learn::{Choice, Config, Seeds};
use std::fs;
use std::path::PathBuf;

/// Trains `count` seeds in a folder.
pub fn train(place: &Place, name: &str, count: u64, config: &Config) {
    let seeds =
        Seeds::begin(&place.path(name), config, count, &[scenario()], &place.runtime_dir, &mut || false)
            .unwrap();
    let results = seeds.train(None, 2, &place.runtime_dir, &|| false, &|_, _| {});
    assert!(results.iter().all(|(_, result)| result.is_ok()), "{results:?}");
}

pub fn read(place: &Place, folders: &[(&str, &str)]) -> Result<Benchmark, String> {
    let path = |(name, folder): &(&str, &str)| ((*name).to_owned(), place.path(folder));
    let folders: Vec<(String, PathBuf)> = folders.iter().map(path).collect();
    Benchmark::read(&folders).map_err(|error| error.to_string())
}

#[test]
fn runs_of_two_algorithms_are_compared() {
    let place = Place::new();
    train(&place, "runs/ours", 3, &evaluated());
    train(&place, "runs/theirs", 3, &Config { actor_lr: 0.01, ..evaluated() });
    let benchmark = read(&place, &[("ours", "runs/ours"), ("theirs", "runs/theirs")]).unwrap();
    let few = "ours and theirs have fewer than five runs of 3m (at least 3): their interval is narrow by \
               chance, and the interquartile mean of fewer than four is the mean";
    assert_eq!(benchmark.notes(), [few]); // the same note was printed once per algorithm
    assert_eq!((benchmark.tasks(), benchmark.common_tasks()), (vec!["3m"], vec!["3m"]));

    let report = Report::new(&benchmark, Choice::Sampled, 1);
    let curve = &report.curves[1];
    assert_eq!((curve.task.as_deref(), curve.metric), (Some("3m"), Metric::WinRate));
    assert!(curve.points.iter().map(|(steps, _)| *steps).eq([0, 400, 800, 930]));
    for aggregate in &report.aggregates {
        let Estimate { value, low, high } = aggregate.mean;
        assert!(0.0 <= low && low <= value && value <= high && high <= 1.0, "{aggregate:?}");
        assert!(aggregate.worst <= value && aggregate.runs == 3, "{aggregate:?}");
    }
    // The interquartile mean of three runs is their mean, as a quarter of three is none.
    let runs = &benchmark.algorithms[0].tasks["3m"];
    let mean = runs.iter().map(|run| run.result.sampled.win_rate).sum::<f64>() / 3.0;
    assert!((report.aggregates[0].mean.value - mean).abs() < 1e-12);
    let [ours, theirs] = [0, 1].map(|i| report.improvements[i].probability.value);
    assert!((ours + theirs - 1.0).abs() < 1e-12, "{ours} {theirs}");
    assert_eq!(report.profiles.len(), 4, "two algorithms, two metrics");

    let again = Report::new(&benchmark, Choice::Sampled, 1);
    let intervals = |report: &Report| report.aggregates.iter().map(|of| of.mean).collect::<Vec<_>>();
    assert_eq!(intervals(&report), intervals(&again));
}

/// The step sizes of a run that was extended fell twice: it was taken for a run of so many steps.
#[test]
fn runs_that_were_extended_are_noted_beside_others() {
    let place = Place::new();
    let steps = |steps| Config { steps, ..evaluated() };
    train(&place, "runs", 1, &steps(800));
    let extended = Seeds::open(&place.path("runs"), Some(1600)).unwrap().unwrap();
    extended.train(Some(1600), 1, &place.runtime_dir, &|| false, &|_, _| {});
    let notes = |folder| read(&place, &[("a", folder)]).unwrap().notes().join("\n");
    assert!(!notes("runs").contains("more than their seeds"));
    let folder = place.path("runs");
    let both =
        Seeds::open(&folder, None).unwrap().unwrap().complete(2, &place.runtime_dir, &mut || false).unwrap();
    both.train(None, 1, &place.runtime_dir, &|| false, &|_, _| {});
    let found = notes("runs");
    assert!(found.contains("the runs of a on 3m differ in more than their seeds"), "{found}");
}

/// As marl-eval scales those of `metrics.json`, which has the episodes with one kind of actions.
#[test]
fn returns_are_scaled_by_the_episodes_that_are_compared() {
    let place = Place::new();
    train(&place, "runs", 1, &evaluated());
    let benchmark = read(&place, &[("a", "runs")]).unwrap();
    let run = &benchmark.algorithms[0].tasks["3m"][0];
    let of_kinds = Choice::BOTH.map(|actions| {
        let played = run.evaluations.iter().flat_map(|played| played.episodes(actions));
        let returns =
            played.chain(run.final_episodes(actions)).map(|played| f64::from(played.episode_return));
        let widest = [f64::INFINITY, f64::NEG_INFINITY];
        returns.fold(widest, |[low, high], value| [low.min(value), high.max(value)])
    });
    assert_ne!(of_kinds[0], of_kinds[1]);
    for ((actions, result), [low, high]) in
        Choice::BOTH.into_iter().zip([run.result.greedy, run.result.sampled]).zip(of_kinds)
    {
        let report = Report::new(&benchmark, actions, 1);
        let of_return = |of: &&smaclite_lab::Aggregate| of.metric == Metric::Return && of.task.is_none();
        let mean = report.aggregates.iter().find(of_return).unwrap().mean.value;
        let expected = (result.mean_return - low) / (high - low);
        assert!((mean - expected).abs() < 1e-9, "{mean} instead of {expected}");
    }
}

/// The structure that marl-eval reads. A test in Python loads a file with its code.
#[test]
fn metrics_have_the_episodes_of_every_evaluation() {
    let place = Place::new();
    train(&place, "ours", 2, &evaluated());
    let benchmark = read(&place, &[("ours", "ours")]).unwrap();
    let text = marl_eval_json(&benchmark, Choice::Greedy).unwrap();
    let file: Value = serde_json::from_str(&text).unwrap();
    let run = &file["smaclite"]["3m"]["ours"]["run_2"];
    assert_eq!(run.as_object().unwrap().len(), 4 + 1);
    assert_eq!(run["step_3"]["step_count"], 930);
    let of_run = &benchmark.algorithms[0].tasks["3m"][1];
    assert_eq!(of_run.seed, 4);
    for (step, episodes) in [
        ("step_3", of_run.evaluations[3].episodes(Choice::Greedy)),
        ("absolute_metrics", of_run.final_episodes(Choice::Greedy)),
    ] {
        let returns = run[step]["return"].as_array().unwrap();
        let played = episodes.iter().map(|episode| f64::from(episode.episode_return));
        assert!(returns.iter().map(|value| value.as_f64().unwrap() as f32 as f64).eq(played), "{step}");
        let wins = run[step]["win_rate"].as_array().unwrap().iter().map(|value| value == 1);
        assert!(wins.eq(episodes.iter().map(|episode| episode.won)), "{step}");
    }
    assert_eq!(run["absolute_metrics"]["return"].as_array().unwrap().len(), 320);
}

#[test]
fn what_is_unequal_is_said_and_not_given_to_marl_eval() {
    let place = Place::new();
    train(&place, "two", 2, &evaluated());
    train(&place, "three", 3, &evaluated());
    train(&place, "other", 2, &Config { evaluate_every: Some(500), ..evaluated() });
    let check = |folders: &[(&str, &str)], note: &str, why: &str| {
        let benchmark = read(&place, folders).unwrap();
        let notes = benchmark.notes();
        assert!(notes.iter().any(|text| text.contains(note)), "{notes:?}");
        assert_eq!(marl_eval_json(&benchmark, Choice::Greedy), Err(why.to_owned()));
    };
    let seeds = "numbers of seeds differ: a on 3m 2, b on 3m 3";
    check(&[("a", "two"), ("b", "three")], seeds, "numbers of seeds differ");
    let steps = "evaluations of algorithms or tasks are at different steps";
    check(&[("a", "two"), ("b", "other")], steps, "evaluations are at different steps");
    let benchmark = read(&place, &[("a,b", "two")]).unwrap();
    assert!(marl_eval_json(&benchmark, Choice::Greedy).unwrap_err().contains("`a,b` has a comma"));
    let benchmark = read(&place, &[("A", "two"), ("a", "two")]).unwrap();
    assert!(marl_eval_json(&benchmark, Choice::Greedy).unwrap_err().contains("upper and lower case"));

    // Another task, as a learner that is not `smaclite-pool train` describes it.
    let path = place.path("two/seed-3");
    let moved = place.path("foreign/one");
    fs::create_dir_all(place.path("foreign")).unwrap();
    fs::rename(path, &moved).unwrap();
    fs::remove_file(moved.join("run.json")).unwrap();
    let foreign = moved.join("options.json");
    fs::write(&foreign, r#"{"scenario": "maps/hill,2.json", "seed": 8}"#).unwrap();
    let benchmark = read(&place, &[("b", "foreign")]).unwrap();
    assert!(marl_eval_json(&benchmark, Choice::Greedy).unwrap_err().contains("`hill,2` has a comma"));
    fs::write(&foreign, r#"{"scenario": "maps/hill.json", "seed": 8}"#).unwrap();
    check(
        &[("a", "three"), ("b", "foreign")],
        "hill is not compared: a has no runs of it",
        "not all algorithms have runs of all tasks",
    );
}

#[test]
fn runs_that_cannot_be_compared_are_refused() {
    let place = Place::new();
    let check = |folders: &[(&str, &str)], expected: &[&str]| {
        let error = read(&place, folders).err().unwrap();
        assert!(expected.iter().all(|part| error.contains(part)), "{error}");
    };
    train(&place, "runs", 2, &evaluated());
    train(&place, "other", 1, &Config { seed: 9, evaluate_every: Some(500), ..evaluated() });
    place.train("without", &small(), 1);
    fs::create_dir(place.path("empty")).unwrap();
    check(&[("a", "empty")], &["/empty` has no runs: expected the folder of a run"]);
    check(&[("a", "nowhere")], &["cannot read", "/nowhere`"]);
    check(&[("a", "without")], &["/without` has no evaluations: expected evaluations.csv"]);
    check(&[("a", "runs"), ("a", "runs")], &["are both runs of a on 3m with seed 3", "NAME="]);
    let few = |folder: &str| read(&place, &[("a", folder)]).unwrap().notes();
    assert!(few("other")[0].ends_with("of 3m (at least 1): the interval of a single run has no width"));
    let steps = "0, 400, 800, 930 and 0, 500, 930: expected equal ones";
    check(&[("a", "runs"), ("a", "other")], &["seed-4` and `", "seed-9`", steps]);

    let path = place.path("runs/seed-3");
    let changed = |name: &str, from: &str, to: &str, expected: &[&str]| {
        let before = fs::read_to_string(path.join(name)).unwrap();
        assert!(before.contains(from), "{name}");
        fs::write(path.join(name), before.replacen(from, to, 1)).unwrap();
        check(&[("a", "runs")], &[&[name, "seed-3"], expected].concat());
        fs::write(path.join(name), before).unwrap();
    };
    changed("evaluations.csv", "\n400,", "\nx,", &["line 3 is `x,", "which is no evaluation"]);
    changed("evaluations.csv", "\n400,", "\n0,", &["its steps do not rise at 0"]);
    changed("evaluation_episodes.csv", "\n400,greedy,3", "\n400,grady,3", &["which is no episode"]);
    changed("final.json", "{", "[", &["is damaged"]);
    let episodes = fs::read_to_string(path.join("evaluation_episodes.csv")).unwrap();
    fs::write(path.join("evaluation_episodes.csv"), episodes.replace("\n800,", "\n801,")).unwrap();
    check(&[("a", "runs")], &["at 800 steps", "evaluation_episodes.csv has 0 episodes"]);
    fs::write(path.join("evaluation_episodes.csv"), episodes).unwrap();
    // A run that lost its description was silently left out.
    fs::rename(path.join("run.json"), path.join("moved")).unwrap();
    for folder in ["runs", "runs/seed-3", ""] {
        check(&[("a", folder)], &["/runs/seed-3` has final.json, a file of a run, but no run.json"]);
    }
    fs::rename(path.join("moved"), path.join("run.json")).unwrap();
    fs::remove_file(path.join("final.json")).unwrap();
    check(&[("a", "runs")], &["seed-3` is not complete", "resume the run until its end"]);
}

/// The weights of every evaluation are played until they win often enough.
#[test]
fn the_time_to_win_is_that_of_an_evaluation() {
    let place = Place::new();
    let config = Config { steps: 40_000, evaluate_every: Some(8_000), ..Config::for_agents(3) };
    train(&place, "runs", 3, &config);
    let benchmark = read(&place, &[("a", "runs")]).unwrap();
    let mut won = 0;
    for run in &benchmark.algorithms[0].tasks["3m"] {
        let time = |threads| time_to_win(run, Choice::Greedy, threads, &mut || false).unwrap();
        assert_eq!(time(1), time(3));
        if let FirstWin::At(time) = time(1) {
            let row = run.evaluations.iter().map(|played| played.row).find(|row| row.steps == time.steps);
            assert_eq!(row.map(|row| (row.seconds, row.cpu_seconds)), Some((time.seconds, time.cpu_seconds)));
            assert!((189..=200).contains(&time.wins) && time.episodes == 200 && time.steps > 0, "{time:?}");
            won += 1;
        }
        assert!(time_to_win(run, Choice::Greedy, 1, &mut || true).is_err(), "it can be interrupted");
    }
    assert!(won > 0, "no team of 3m won");
}
