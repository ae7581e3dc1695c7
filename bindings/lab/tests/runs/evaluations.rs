//! Evaluations of runs while they train: they change no bit of the training, an interrupted run has the same
//! ones, what was recorded can be verified, and the best weights are those that play.

use crate::foreign::{with_field, with_value};
use crate::kit::{Place, check_resumed, complete, evaluated, evaluation, scenario, small};
use serde_json::json;
use smaclite_engine::Rules;
use smaclite_lab::{Benchmark, verify};
use smaclite_learn::{
    Algorithm, Config, Enemies, EvaluationRow, FinalResult, Lanes, NetworkKind, Run, SelfPlay, TrainedTeam,
    Weights, resolve_scenario,
};
use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

#[test]
fn evaluations_change_no_bit_of_the_training() {
    let place = Place::new();
    place.train("without", &small(), 1);
    place.train("with", &evaluated(), 1);
    place.train("threads", &evaluated(), 3);
    assert_eq!(place.outcome("with"), place.outcome("without"));
    assert_eq!(place.outcome("with"), place.outcome("threads"));
    assert_eq!(place.evaluations("with"), place.evaluations("threads"));
    assert!(place.evaluations("without").is_empty());
    let result = FinalResult::read(&place.path("with")).unwrap().unwrap();
    assert_eq!((result.greedy_episodes.len(), result.sampled_episodes.len()), (320, 320));
}

/// The step counts are the same for every seed, although updates end at others.
#[test]
fn runs_are_evaluated_at_exact_step_counts() {
    let place = Place::new();
    for seed in [3, 4] {
        let name = format!("{seed}");
        let mut run = place.begin(&name, &Config { seed, ..evaluated() }, 1);
        while run.update(&mut || false).unwrap().is_some() {}
        let rows = run.evaluations();
        assert!(rows.iter().map(|row| row.steps).eq([0, 400, 800, 930]), "{rows:?}");
        // An update has at most 160 steps.
        assert!(rows.iter().all(|row| (row.steps..row.steps + 160).contains(&row.trained_steps)), "{rows:?}");
        let best = EvaluationRow::best(rows).unwrap();
        let result = FinalResult::read(&place.path(&name)).unwrap().unwrap();
        assert_eq!((result.steps, result.trained_steps), (best.steps, best.trained_steps));
        let episodes = fs::read_to_string(place.path(&name).join("evaluation_episodes.csv")).unwrap();
        assert_eq!(episodes.lines().count(), 1 + 4 * 64);
    }
    assert_ne!(place.evaluations("3"), place.evaluations("4"));
}

#[test]
fn a_resumed_run_has_the_evaluations_of_the_uninterrupted_one() {
    check_resumed(
        &Config { steps: 34 * 158, epochs: 1, evaluate_every: Some(700), ..small() },
        &Place::new(),
    );
}

/// A run that was killed after its checkpoint, and is resumed with another number of steps, could not play
/// the best evaluation again. Its best weights are those of a row that it has.
#[test]
fn the_best_weights_are_those_of_a_row() {
    let place = Place::new();
    let mut run = place.begin("run", &evaluated(), 1);
    let path = place.path("run");
    run.update(&mut || false).unwrap();
    run.checkpoint().unwrap();
    let error = verify(&path, 0, 1, &mut || false).unwrap_err().to_string();
    assert!(error.contains("has no final episodes (final.json), as it is not complete"), "{error}");
    assert_eq!(verify(&path, 1, 1, &mut || false).unwrap().evaluations, 1);
    let first = fs::read(path.join("evaluations/000000000000.safetensors")).unwrap();
    while run.update(&mut || false).unwrap().is_some() {}
    drop(run);
    fs::write(path.join("best.safetensors"), fs::read(path.join("weights.safetensors")).unwrap()).unwrap();
    let run = Run::resume(&path, Some(300), place.lanes(10, 1), 1).unwrap();
    assert!(run.evaluations().iter().map(|row| row.steps).eq([0]));
    assert!(!path.join("final.json").exists());
    assert_eq!(fs::read_dir(path.join("evaluations")).unwrap().count(), 1);
    assert_eq!(fs::read(path.join("best.safetensors")).unwrap(), first);
    complete(run);
    assert!(verify(&path, usize::MAX, 1, &mut || false).unwrap().is_final);
    // Extended: the evaluation at the old end, 300, stays.
    complete(Run::resume(&path, Some(930), place.lanes(10, 1), 1).unwrap());
    assert_eq!(verify(&path, usize::MAX, 1, &mut || false).unwrap().evaluations, 5);
}

#[test]
fn recorded_evaluations_are_played_again_to_the_bit() {
    let place = Place::new();
    place.train("run", &evaluated(), 1);
    let path = place.path("run");
    let verified = verify(&path, 2, 2, &mut || false).unwrap();
    assert_eq!((verified.evaluations, verified.is_final, verified.episodes), (2, true, 128 + 640));

    let episodes = path.join("evaluation_episodes.csv");
    let text = fs::read_to_string(&episodes).unwrap();
    fs::write(&episodes, with_field("800,sampled,7,", 4, "61")(&text)).unwrap();
    let error = verify(&path, usize::MAX, 1, &mut || false).unwrap_err().to_string();
    assert!(error.contains("evaluation at 800 steps, sampled episode 7: recorded return"), "{error}");
    assert!(error.contains("61 steps") && error.contains("vector instructions"), "{error}");

    fs::write(&episodes, &text).unwrap();
    fs::copy(
        path.join("evaluations/000000000000.safetensors"),
        path.join("evaluations/000000000800.safetensors"),
    )
    .unwrap();
    let error = verify(&path, usize::MAX, 1, &mut || false).unwrap_err().to_string();
    assert!(error.contains("the evaluation at 800 steps"), "{error}");

    // What only reads a run wrote a folder into it, and needed the permission to.
    fs::remove_dir_all(path.join("evaluations")).unwrap();
    verify(&path, 1, 1, &mut || false).unwrap_err();
    assert!(!path.join("evaluations").exists());

    place.train("without", &small(), 1);
    let error = verify(&place.path("without"), 1, 1, &mut || false).unwrap_err().to_string();
    assert!(error.contains("has no evaluations; `train --evaluate-every N` makes them"), "{error}");
}

/// A text without the lines that begin so.
fn without(start: &str) -> impl Fn(&str) -> String {
    move |text| text.split_inclusive('\n').filter(|line| !line.starts_with(start)).collect()
}

/// Lets a change to a file of a run be verified, and compares the error.
fn check_change(path: &Path, file: &str, change: impl Fn(Vec<u8>) -> Vec<u8>, expected: &str) {
    let file = path.join(file);
    let before = fs::read(&file).unwrap();
    let after = change(before.clone());
    assert_ne!(before, after, "the change must change {}", file.display());
    fs::write(&file, after).unwrap();
    let error = verify(path, usize::MAX, 1, &mut || false).unwrap_err().to_string();
    assert!(error.contains(expected), "{error}");
    fs::write(&file, before).unwrap();
}

/// Numbers, weights, episodes that were left out, and weights that were chosen by their final episodes.
#[test]
fn every_change_to_the_results_is_found() {
    let place = Place::new();
    place.train("run", &evaluated(), 1);
    let path = place.path("run");
    let result = FinalResult::read(&path).unwrap().unwrap();
    let check = |file: &str, change: &dyn Fn(&str) -> String, expected: &str| {
        let change = |bytes: Vec<u8>| change(&String::from_utf8(bytes).unwrap()).into_bytes();
        check_change(&path, file, change, expected);
    };
    let rows = "evaluations.csv";
    check(rows, &with_field("400,", 7, "19.5"), "the evaluation at 400 steps, sampled means");
    let of_log = "the evaluation at 400 steps is of 401 trained steps in evaluations.csv, but of";
    check(rows, &with_field("400,", 1, "401"), of_log);
    check(rows, &with_field("400,", 2, "1"), "in evaluations.csv, but of 1"); // of the log's first line
    check(rows, &with_field("400,", 0, "many"), "line 3 is `many,");
    check(rows, &with_field("steps,", 0, "step"), "its first line is `step,trained_steps");
    for steps in ["0", "400", "930"] {
        let expected = format!("it has no evaluation at {steps} steps, but run.json says");
        check(rows, &without(&format!("{steps},")), &expected);
    }
    let few = "the evaluation at 400 steps has 31 greedy episodes, but 32 are played";
    check("evaluation_episodes.csv", &without("400,greedy,31,"), few);
    let won = result.sampled_episodes[319].won;
    for (pointer, value, expected) in [
        ("/steps", json!(1), "final.json is of 1 steps, but the best evaluation is at"),
        ("/trained_steps", json!(1), "but of 1 in final.json"),
        ("/sampled_episodes/319/won", json!(!won), "the final evaluation, sampled episode 319"),
        ("/run_steps", json!(800), "final.json is of a run of 800 steps, but run.json says"),
    ] {
        check("final.json", &with_value(pointer, value), expected);
    }
    let one_weight = |mut bytes: Vec<u8>| {
        *bytes.last_mut().unwrap() ^= 1;
        bytes
    };
    let damaged = "000000000400.safetensors` is damaged or not a file of a run: its checksum differs";
    check_change(&path, "evaluations/000000000400.safetensors", one_weight, damaged);
    let other = if result.steps == 0 { "000000000400" } else { "000000000000" };
    let of_other = fs::read(path.join(format!("evaluations/{other}.safetensors"))).unwrap();
    let other_weights = "best.safetensors has other weights than the evaluation at";
    check_change(&path, "best.safetensors", |_| of_other.clone(), other_weights);
    verify(&path, usize::MAX, 1, &mut || false).unwrap();
}

/// A process that was killed leaves rows of evaluations after its checkpoint, a part of a line, and weights
/// of an evaluation without a row.
#[test]
fn half_an_evaluation_is_played_again() {
    let place = Place::new();
    place.train("whole", &evaluated(), 1);
    let mut run = place.begin("killed", &evaluated(), 1);
    let path = place.path("killed");
    for _ in 0..4 {
        run.update(&mut || false).unwrap();
    }
    assert!(run.evaluations().len() > 1);
    drop(run); // the only checkpoint is that of the beginning
    let append = |name: &str, text: &str| {
        let mut file = fs::OpenOptions::new().append(true).open(path.join(name)).unwrap();
        file.write_all(text.as_bytes()).unwrap();
    };
    append("evaluation_episodes.csv", "800,greedy,0,1.5,20,0\n800,greedy,1,1.");
    append("evaluations.csv", "800,81");
    fs::copy(path.join("weights.safetensors"), path.join("evaluations/000000000800.safetensors")).unwrap();
    fs::copy(path.join("weights.safetensors"), path.join("best.safetensors")).unwrap();
    complete(Run::resume(&path, None, place.lanes(10, 1), 1).unwrap());
    assert_eq!(place.outcome("killed"), place.outcome("whole"));
    assert!(place.evaluations("killed") == place.evaluations("whole"));
}

/// All files in the folder of a run and in its folders, by path.
fn all_files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            all.extend(all_files(&path));
        } else {
            all.insert(path.clone(), fs::read(&path).unwrap());
        }
    }
    all
}

/// What was missing was taken for evaluations that were still to be played: those that were there, the best
/// weights and the final result were removed.
#[test]
fn a_run_whose_files_are_not_whole_is_not_continued() {
    let place = Place::new();
    place.train("complete", &evaluated(), 1);
    let mut run = place.begin("interrupted", &evaluated(), 1);
    (0..5).for_each(|_| drop(run.update(&mut || false).unwrap()));
    run.checkpoint().unwrap();
    drop(run);
    let refused = |name: &str, file: &str, change: &dyn Fn(&str) -> String, expected: &str| {
        let path = place.path(name);
        let text = fs::read_to_string(path.join(file)).unwrap();
        assert_ne!(change(&text), text, "{name} {file}");
        fs::write(path.join(file), change(&text)).unwrap();
        let before = all_files(&path);
        for steps in [None, Some(2000)] {
            let resumed = Run::resume(&path, steps, place.lanes(10, 1), 1);
            let error = resumed.err().expect(expected).to_string();
            let parts = [&format!("{name}/{file}` is damaged"), expected];
            assert!(parts.iter().all(|part| error.contains(part)), "expected {parts:?}, got {error}");
            assert!(all_files(&path) == before, "{name} {file}: files were changed");
        }
        fs::write(path.join(file), text).unwrap();
    };
    let nothing = |_: &str| String::new();
    let torn = |text: &str| text[..text.len() - 5].to_owned();
    for name in ["complete", "interrupted"] {
        refused(name, "evaluations.csv", &nothing, "no evaluation at 0 steps, but the checkpoint is of ");
        refused(
            name,
            "evaluations.csv",
            &without("400,"),
            "no evaluation at 400 steps, but the checkpoint is",
        );
        let expected = "it has 31 sampled episodes of the evaluation at 400 steps, but 32 were played";
        refused(name, "evaluation_episodes.csv", &without("400,sampled,9,"), expected);
        refused(name, "evaluation_episodes.csv", &nothing, "it has 0 greedy episodes of the evaluation at 0");
        refused(name, "log.csv", &nothing, "it has no line of update 1, but the checkpoint is of ");
        refused(name, "log.csv", &without("4,"), "it has no line of update 4, but the checkpoint is of ");
        refused(name, "log.csv", &torn, "it has no line of update ");
    }
    refused("interrupted", "evaluations.csv", &torn, "no evaluation at 400 steps");
    let no_line_break = "its last line has no line break at its end, although the run is complete";
    refused("complete", "evaluations.csv", &torn, no_line_break);
    refused("complete", "evaluation_episodes.csv", &torn, no_line_break);
    // Both are of the last update.
    let end = |text: &str| without("930,")(&without("800,")(text));
    refused("complete", "evaluations.csv", &end, "it has no evaluation after ");
    for name in ["complete", "interrupted"] {
        fs::remove_file(place.path(name).join("evaluations.csv")).unwrap();
        let resumed = Run::resume(&place.path(name), None, place.lanes(10, 1), 1);
        assert!(resumed.err().unwrap().to_string().contains("no evaluation at 0 steps"));
    }
    assert!(place.path("complete/final.json").exists() && place.path("complete/best.safetensors").exists());
}

/// run.json said then that the run had made fewer steps than it had.
#[test]
fn a_run_is_not_resumed_with_fewer_steps_than_it_has_made() {
    let place = Place::new();
    let made = place.train("run", &evaluated(), 1).steps;
    let path = place.path("run");
    let before = all_files(&path);
    let resume = |steps| Run::resume(&path, steps, place.lanes(10, 1), 1);
    for given in [1, 400, 929] {
        let error = resume(Some(given)).err().unwrap().to_string();
        let expected =
            format!("/run` has made {made} steps: --steps must be at least that many, got {given}");
        assert!(error.contains(&expected), "{error}");
        assert!(all_files(&path) == before, "files were changed");
    }
    drop(resume(Some(930)).unwrap()); // the number that it has, or none
    drop(resume(None).unwrap());
    drop(resume(Some(made + 1)).unwrap());
}

/// `--resume --steps 4000000`, interrupted before it had made an update, removed the final episodes of a
/// complete run, which could not be set back to its own number of steps: it has made some more.
#[test]
fn a_complete_run_is_set_back_until_it_learns_more() {
    let place = Place::new();
    let made = place.train("run", &evaluated(), 1).steps;
    let path = place.path("run");
    let before = all_files(&path);
    let resume = |steps| Run::resume(&path, Some(steps), place.lanes(10, 1), 1);
    for longer in [[made + 1000, made + 1000], [made + 1000, made + 2000]] {
        longer.iter().for_each(|steps| drop(resume(*steps).unwrap()));
        let report = Benchmark::read(&[("run".to_owned(), path.clone())]).unwrap_err().to_string();
        assert!(report.contains("is not complete") && report.contains("of an earlier end"), "{report}");
        // Without the final episodes, which are of the earlier end; an evaluation at the new one was missed.
        assert!(!verify(&path, 2, 1, &mut || false).unwrap().is_final);
        drop(resume(930).unwrap());
        assert!(all_files(&path) == before, "files were changed");
    }
    complete(resume(made + 1).unwrap());
    let error = resume(930).err().unwrap().to_string();
    assert!(error.contains("--steps must be at least that many, got 930"), "{error}");
}

/// One that began in a folder with some files of another kept its best weights, and these played.
#[test]
fn a_run_that_begins_has_no_best_weights_of_another() {
    let place = Place::new();
    place.train("run", &evaluated(), 1);
    let path = place.path("run");
    fs::remove_file(path.join("run.json")).unwrap();
    for name in ["final.json", "evaluations.csv", "checkpoint.safetensors"] {
        let lanes = place.lanes(10, 1);
        let begun = Run::begin(&path, small(), &scenario(), lanes, 1).err().unwrap().to_string();
        assert!(begun.contains(&format!("/run` has {name}, a file of a run, but no run.json")), "{begun}");
        fs::remove_file(path.join(name)).unwrap(); // nothing else was removed
    }
    fs::write(path.join("evaluations/notes.txt"), "not a file of a run").unwrap();
    drop(place.begin("run", &Config { seed: 4, ..small() }, 1));
    for name in ["evaluations.csv", "evaluation_episodes.csv", "best.safetensors", "final.json"] {
        assert!(!path.join(name).exists(), "{name}");
    }
    let kept: Vec<_> = fs::read_dir(path.join("evaluations")).unwrap().collect();
    assert!(kept.len() == 1 && path.join("evaluations/notes.txt").exists(), "{kept:?}");
    assert_eq!(place.evaluate("run", 3).0.weights, Weights::Last);
}

#[test]
fn the_best_weights_play_where_there_are_some() {
    let place = Place::new();
    place.train("run", &evaluated(), 1);
    let path = place.path("run");
    // Marks the best weights, so that they are told from the last.
    fs::copy(path.join("evaluations/000000000000.safetensors"), path.join("best.safetensors")).unwrap();
    let returns = |weights| {
        let evaluation = smaclite_learn::Evaluation { weights, ..evaluation(20) };
        let ignore = &mut |_: smaclite_learn::EvaluationEvent<'_>| {};
        smaclite_learn::evaluate(&path, evaluation, &place.runtime_dir, &mut || false, ignore).unwrap()
    };
    let [default, best, last] = [None, Some(Weights::Best), Some(Weights::Last)].map(returns);
    assert_eq!(default, best);
    assert_eq!((best.weights, last.weights), (Weights::Best, Weights::Last));
    assert_ne!(best.mean_return, last.mean_return);

    place.train("against", &Config { enemies: Enemies::Team { folder: path.clone() }, ..evaluated() }, 1);
    let copied = fs::read(place.path("against/opponent/weights.safetensors")).unwrap();
    assert_eq!(copied, fs::read(path.join("best.safetensors")).unwrap());
    assert!(verify(&place.path("against"), 1, 1, &mut || false).unwrap().is_final);

    let enemies = Enemies::SelfPlay(SelfPlay::ALONE);
    place.train("self", &Config { enemies, ..evaluated() }, 1);
    assert!(place.path("self/best.safetensors").exists());
    TrainedTeam::open(&place.path("self")).unwrap();
    assert_eq!(place.evaluate("self", 3).0.weights, Weights::Last);
}

/// Figures of types are those of the rules, in lanes and where the folder of the run is read.
#[test]
fn a_universal_team_of_other_rules_is_evaluated_and_verified() {
    let place = Place::new();
    let setup = resolve_scenario("2s3z", Rules::Starcraft).unwrap();
    let universal = evaluated().with_network(NetworkKind::Universal);
    let config = Config { hidden: vec![8, 16], algorithm: Algorithm::Mappo, ..universal };
    let lanes = Lanes::start(&setup, config.num_envs, config.last_actions, 1, &place.runtime_dir).unwrap();
    complete(Run::begin(&place.path("run"), config, &setup, lanes, 1).unwrap());
    let verified = verify(&place.path("run"), usize::MAX, 1, &mut || false).unwrap();
    assert!(verified.is_final && verified.evaluations == 4, "{verified:?}");
}
