//! Runs of several seeds in one process: each has the bits that it has alone, and only runs that were
//! trained together continue together.

use crate::kit::{Place, evaluated, scenario, small};
use smaclite_learn::{Config, Enemies, RunDescription, Seeds, TrainError, TrainEvent};
use std::fs;
use std::sync::Mutex;

/// Runs that train at the same time have the bits that they have alone, also after an interruption.
#[test]
fn seeds_train_together_as_they_do_alone() {
    let place = Place::new();
    for seed in 3..6 {
        place.train(&format!("alone-{seed}"), &Config { seed, ..evaluated() }, 2);
    }
    let folder = place.path("runs");
    let seeds =
        Seeds::begin(&folder, &evaluated(), 3, &[scenario()], &place.runtime_dir, &mut || false).unwrap();
    let updates = Mutex::new(0);
    let count = |_: u64, event: TrainEvent| {
        if let TrainEvent::Updated(_) = event {
            *updates.lock().unwrap() += 1;
        }
    };
    let interrupted = || *updates.lock().unwrap() > 4;
    let results = seeds.train(None, 2, &place.runtime_dir, &interrupted, &count);
    assert!(results.iter().all(|(_, result)| result.is_ok()), "{results:?}");
    assert!(!folder.join("seed-5/final.json").exists());

    let seeds = Seeds::open(&folder, None).unwrap().unwrap();
    let completed = Mutex::new(Vec::new());
    let note = |seed: u64, event: TrainEvent| {
        if let TrainEvent::Completed = event {
            completed.lock().unwrap().push(seed);
        }
    };
    seeds.train(None, 2, &place.runtime_dir, &|| false, &note);
    let mut completed = completed.into_inner().unwrap();
    completed.sort_unstable();
    assert_eq!(completed, [3, 4, 5]);
    for seed in 3..6 {
        let (alone, together) = (format!("alone-{seed}"), format!("runs/seed-{seed}"));
        assert_eq!(place.outcome(&alone), place.outcome(&together), "seed {seed}");
        assert!(place.evaluations(&alone) == place.evaluations(&together), "evaluations of seed {seed}");
    }
}

#[test]
fn no_seeds_are_refused_before_a_run_begins() {
    let place = Place::new();
    let folder = place.path("runs");
    let begun = Seeds::begin(&folder, &small(), 0, &[scenario()], &place.runtime_dir, &mut || false);
    assert_eq!(begun.err().unwrap().to_string(), "the number of seeds must be at least 1, got 0");
    assert!(!folder.exists());
}

#[test]
fn an_error_of_one_seed_does_not_end_the_others() {
    let place = Place::new();
    let folder = place.path("runs");
    let seeds = Seeds::begin(&folder, &small(), 3, &[scenario()], &place.runtime_dir, &mut || false).unwrap();
    fs::write(folder.join("seed-4/checkpoint.safetensors"), "nothing").unwrap();
    let results = seeds.train(None, 1, &place.runtime_dir, &|| false, &|_, _| {});
    let failed: Vec<u64> =
        results.iter().filter(|(_, result)| result.is_err()).map(|(seed, _)| *seed).collect();
    assert_eq!(failed, [4]);
    assert!(matches!(results[1].1, Err(TrainError::File(_))), "{results:?}");
    // Also with other seeds: they began, with any options, and from then on nothing continued the folder.
    for seed in [3, 6] {
        let config = Config { seed, ..small() };
        let again = Seeds::begin(&folder, &config, 3, &[scenario()], &place.runtime_dir, &mut || false);
        assert!(again.err().unwrap().to_string().contains("seed-3` already holds a run"));
    }
}

/// When the sixth of ten runs could not begin, five were trained from then on, and nothing said so.
#[test]
fn seeds_that_are_missing_begin_later() {
    let place = Place::new();
    place.train("team", &small(), 1);
    let enemies = Enemies::Team { folder: place.path("team") };
    let config = Config { enemies, ..evaluated() };
    let folder = place.path("runs");
    fs::create_dir_all(folder.join("seed-5/checkpoint.safetensors")).unwrap(); // in the way
    let error = Seeds::begin(&folder, &config, 4, &[scenario()], &place.runtime_dir, &mut || false)
        .err()
        .unwrap()
        .to_string();
    assert!(error.contains("the run with seed 5 could not begin: `"), "{error}");
    assert!(error.contains("/runs --seeds 4` begins the missing runs"), "{error}");
    fs::remove_dir(folder.join("seed-5/checkpoint.safetensors")).unwrap();
    // The team that the first runs have copied is that of all, also if its own run goes on.
    let copied = fs::read(folder.join("seed-3/opponent/weights.safetensors")).unwrap();
    place.train("later", &Config { seed: 9, ..small() }, 1);
    fs::copy(place.path("later/weights.safetensors"), place.path("team/weights.safetensors")).unwrap();

    let open = || Seeds::open(&folder, None).unwrap().unwrap();
    let seeds_of = |runs: &Seeds| runs.runs().iter().map(|(seed, _)| *seed).collect::<Vec<_>>();
    assert_eq!(seeds_of(&open()), [3, 4]);
    let too_few = open().complete(1, &place.runtime_dir, &mut || false).unwrap_err().to_string();
    assert!(too_few.contains("/runs` has seeds from 3 to 4: --seeds must be at least 2, got 1"), "{too_few}");
    let runs = open().complete(4, &place.runtime_dir, &mut || false).unwrap();
    assert_eq!((seeds_of(&runs), seeds_of(&open())), (vec![3, 4, 5, 6], vec![3, 4, 5, 6]));
    for (seed, path) in runs.runs() {
        let opponent = fs::read(path.join("opponent/weights.safetensors")).unwrap();
        assert!(opponent == copied, "the opponent of seed {seed}");
        assert_eq!(RunDescription::read(path).unwrap().config, Config { seed: *seed, ..config.clone() });
    }
    let results = runs.train(None, 2, &place.runtime_dir, &|| false, &|_, _| {});
    assert!(results.iter().all(|(_, result)| result.is_ok()), "{results:?}");

    // More seeds for runs that are complete, which keep their files.
    let files = || place.evaluations("runs/seed-6");
    let before = files();
    let runs = open().complete(5, &place.runtime_dir, &mut || false).unwrap();
    runs.train(None, 2, &place.runtime_dir, &|| false, &|_, _| {});
    assert!(before == files() && folder.join("seed-7/final.json").exists());
}

/// All of ten thousand runs began first.
#[test]
fn an_interruption_between_two_seeds_leaves_the_others_to_be_begun() {
    let place = Place::new();
    let folder = place.path("runs");
    let mut asked = 0;
    let mut interrupted = || {
        asked += 1;
        asked == 2
    };
    let begun = Seeds::begin(&folder, &small(), 9, &[scenario()], &place.runtime_dir, &mut interrupted);
    let error = begun.unwrap_err().to_string();
    assert!(error.starts_with("interrupted when 2 of 9 seeds had begun; `train --resume "), "{error}");
    let open = || Seeds::open(&folder, None).unwrap().unwrap();
    assert_eq!(open().runs().len(), 2);
    let error = open().complete(4, &place.runtime_dir, &mut || true).unwrap_err().to_string();
    assert!(error.starts_with("interrupted when 2 of 4 seeds had begun"), "{error}");
    // Where none is missing, nothing is interrupted.
    assert_eq!(open().complete(2, &place.runtime_dir, &mut || true).unwrap().runs().len(), 2);
    assert_eq!(open().complete(3, &place.runtime_dir, &mut || false).unwrap().runs().len(), 3);
}

/// It was taken for one that had not begun: it began anew, over what it had learnt.
#[test]
fn a_seed_without_its_description_is_no_seed_that_is_missing() {
    let place = Place::new();
    let folder = place.path("runs");
    let begin = || Seeds::begin(&folder, &evaluated(), 2, &[scenario()], &place.runtime_dir, &mut || false);
    begin().unwrap().train(None, 2, &place.runtime_dir, &|| false, &|_, _| {});
    fs::remove_file(folder.join("seed-4/run.json")).unwrap();
    let expected =
        "/runs/seed-4` has final.json, a file of a run, but no run.json, which says what the run is";
    let errors = [Seeds::open(&folder, None).err().unwrap().to_string(), {
        fs::rename(folder.join("seed-3"), place.path("seed-3")).unwrap();
        begin().err().unwrap().to_string()
    }];
    assert!(errors.iter().all(|error| error.contains(expected)), "{errors:?}");
    assert!(folder.join("seed-4/final.json").exists() && !folder.join("seed-3").exists());

    // What a process leaves that is killed before it has written run.json is no run.
    drop(place.begin("killed/seed-3", &evaluated(), 1));
    fs::remove_file(place.path("killed/seed-3/run.json")).unwrap();
    assert!(Seeds::open(&place.path("killed"), None).unwrap().is_none());
    drop(place.begin("killed/seed-3", &evaluated(), 1));
}

/// Any folder with runs was taken for one of several seeds: all its runs were trained, and those that were
/// complete lost their final episodes.
#[test]
fn runs_that_were_not_trained_together_are_not_continued_together() {
    let place = Place::new();
    let folder = place.path("runs");
    let check = |steps, expected: &[&str]| {
        let error = Seeds::open(&folder, steps).unwrap_err().to_string();
        assert!(expected.iter().all(|part| error.contains(part)), "{error}");
    };
    place.train("runs/first", &evaluated(), 1);
    check(Some(2000), &["/runs/first` is no run of `train --seeds`", "name `seed-3`"]);
    fs::rename(folder.join("first"), folder.join("seed-3")).unwrap();
    assert_eq!(Seeds::open(&folder, Some(2000)).unwrap().unwrap().runs().len(), 1);

    let change = |name: &str, from: &str, to: &str| {
        let path = folder.join(name).join("run.json");
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.contains(from), "{text}");
        fs::write(&path, text.replacen(from, to, 1)).unwrap();
    };
    let together = ["/runs/seed-4` differs from `", "/runs/seed-3` in "];
    drop(place.begin("runs/seed-4", &Config { seed: 4, gamma: 0.5, ..evaluated() }, 1));
    check(None, &[together[0], together[1], "gamma (0.5 instead of 0.9"]);
    change("seed-4", "\"gamma\": 0.5", &format!("\"gamma\": {}", evaluated().gamma));
    assert_eq!(Seeds::open(&folder, None).unwrap().unwrap().runs().len(), 2);
    change("seed-4", "\"rules\": \"smaclite\"", "\"rules\": \"paper\"");
    check(None, &[together[0], together[1], "rules (paper instead of smaclite)"]);
    change("seed-4", "\"rules\": \"paper\"", "\"rules\": \"smaclite\"");
    // An extension of all that was interrupted after the first leaves this.
    change("seed-4", "\"steps\": 930", "\"steps\": 2000");
    check(None, &["/runs/seed-4` are runs of 930 and of 2000 steps; --steps says how many"]);
    assert!(Seeds::open(&folder, Some(2000)).unwrap().is_some());
    assert!(folder.join("seed-3/final.json").exists(), "nothing was changed");
}

/// The other runs were trained to their ends with fewer steps than one had made, and could not be set back.
#[test]
fn too_few_steps_for_one_seed_train_none() {
    let place = Place::new();
    let folder = place.path("runs");
    let train = |name: &str, seed, steps| place.train(name, &Config { seed, steps, ..small() }, 1).steps;
    let [first, second] = [train("runs/seed-3", 3, 600), train("runs/seed-4", 4, 930)];
    assert!(first < 930);
    drop(place.begin("runs/seed-5", &Config { seed: 5, ..small() }, 1));
    // The first run is complete with 600.
    for given in [1, 300, 600, 929] {
        let error = Seeds::open(&folder, Some(given)).unwrap_err().to_string();
        let expected = format!("/runs/seed-4` has made {second} steps: --steps must be at least that many");
        assert!(error.contains(&expected), "{given}: {error}");
    }
    for given in [930, second + 1] {
        let runs = Seeds::open(&folder, Some(given)).unwrap().unwrap();
        let results = runs.train(Some(given), 2, &place.runtime_dir, &|| false, &|_, _| {});
        assert!(results.iter().all(|(_, result)| result.is_ok()), "{results:?}");
    }
}
