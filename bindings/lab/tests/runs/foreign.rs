//! Runs of learners that are not `smaclite-pool train`: what reports read of them, and refuse.

use crate::kit::{Place, evaluated};
use crate::report::{read, train};
use serde_json::Value;
use smaclite_lab::{FirstWin, TimeToWin, time_to_win};
use smaclite_learn::Choice;
use std::fs;
use std::path::PathBuf;

/// The run of such a learner.
struct Foreign {
    place: Place,
    path: PathBuf,
}

impl Foreign {
    fn new() -> Foreign {
        let place = Place::new();
        train(&place, "runs", 1, &evaluated());
        let path = place.path("runs/seed-3");
        fs::remove_file(path.join("run.json")).unwrap();
        let run = Foreign { place, path };
        run.write("options.json", r#"{"scenario": "maps/hill.json", "seed": 8}"#);
        run
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.path.join(name), text).unwrap();
    }

    /// Checks the message of a report of the run, which names a file of it.
    fn check_refused(&self, name: &str, expected: &[&str]) {
        let error = read(&self.place, &[("a", "runs")]).err().unwrap();
        let parts = [&[name, "seed-3"], expected].concat();
        assert!(parts.iter().all(|part| error.contains(part)), "expected {parts:?}, got {error}");
    }

    /// The same after a change to the file, which is taken back.
    fn check_change(&self, name: &str, change: impl Fn(&str) -> String, expected: &[&str]) {
        let before = fs::read_to_string(self.path.join(name)).unwrap();
        self.write(name, &change(&before));
        self.check_refused(name, expected);
        self.write(name, &before);
    }
}

/// Replaces a field of the lines that begin so.
pub fn with_field(line: &str, field: usize, value: &str) -> impl Fn(&str) -> String {
    move |text: &str| {
        let change = |old: &str| {
            let mut fields: Vec<&str> = old.split(',').collect();
            if old.starts_with(line) {
                fields[field] = value;
            }
            fields.join(",") + "\n"
        };
        text.lines().map(change).collect()
    }
}

/// Replaces a value of a JSON file.
pub fn with_value(place: &str, value: impl Into<Value>) -> impl Fn(&str) -> String {
    let value = value.into();
    move |text: &str| {
        let mut result: Value = serde_json::from_str(text).unwrap();
        *result.pointer_mut(place).unwrap() = value.clone();
        result.to_string()
    }
}

/// Whatever was not `1` was a loss, and the message was about win rates; NaN was a return.
#[test]
fn rows_that_are_no_numbers_are_refused() {
    let run = Foreign::new();
    let no_episode = ["line ", "which is no episode: expected steps,actions,episode,", "0 or 1 for won"];
    for (field, value) in [(5, "True"), (5, "1.0"), (5, ""), (3, "nan"), (3, "inf")] {
        run.check_change("evaluation_episodes.csv", with_field("400,greedy,3,", field, value), &no_episode);
    }
    let no_number = ["line 3 is", "which is no evaluation: expected a finite number in each"];
    run.check_change("evaluations.csv", with_field("400,", 4, "nan"), &no_number);
    for name in ["evaluations.csv", "evaluation_episodes.csv"] {
        let without_end = |text: &str| text.trim_end().to_owned();
        run.check_change(name, without_end, &["its last line has no line break at its end"]);
    }
}

/// Nothing compared the means of final.json, which the tables show, with its episodes.
#[test]
fn means_are_those_of_the_episodes() {
    let run = Foreign::new();
    let differs = ["at 400 steps it has the mean return 99 of greedy episodes, and"];
    run.check_change("evaluations.csv", with_field("400,", 4, "99"), &differs);
    let differs = ["its sampled mean return is 99, but that of its 320 episodes"];
    run.check_change("final.json", with_value("/sampled/mean_return", 99.0), &differs);
    let differs = ["its greedy win rate is 0.987, but that of its 320 episodes"];
    run.check_change("final.json", with_value("/greedy/win_rate", 0.987), &differs);
    let too_large = ["is damaged", "number out of range"];
    run.check_change("final.json", with_value("/sampled_episodes/5/episode_return", 1e300), &too_large);
    assert_eq!(read(&run.place, &[("a", "runs")]).unwrap().tasks(), ["hill"], "what is right is read");
}

/// Battles by the paper's rules were compared with those by SMAClite's.
#[test]
fn the_rules_are_a_part_of_the_task() {
    let run = Foreign::new();
    let with_rules = |rules| format!(r#"{{"scenario": "maps/hill.json", "seed": 8, "rules": {rules}}}"#);
    for (rules, task) in [("\"paper\"", "hill-paper"), ("\"smaclite\"", "hill")] {
        run.write("options.json", &with_rules(rules));
        assert_eq!(read(&run.place, &[("a", "runs")]).unwrap().tasks(), [task]);
    }
    for (rules, expected) in
        [("\"papre\"", "papre"), ("3", "`rules` must be `smaclite`, `paper` or `starcraft`, got 3")]
    {
        run.write("options.json", &with_rules(rules));
        run.check_refused("options.json", &[expected]);
    }
}

/// A run that lacks the optional file was one that never won.
#[test]
fn without_a_file_the_time_to_win_is_not_measured() {
    let run = Foreign::new();
    let benchmark = read(&run.place, &[("a", "runs")]).unwrap();
    let evaluated = &benchmark.algorithms[0].tasks["hill"][0];
    let read_times = || Choice::BOTH.map(|actions| time_to_win(evaluated, actions, 1, &mut || false));
    assert_eq!(read_times().map(Result::unwrap), [FirstWin::NotMeasured; 2]);

    let write = |wins: u64| {
        let time = format!(
            r#"{{"steps": 400, "wins": {wins}, "episodes": 200, "seconds": 1.5, "cpu_seconds": 2.5}}"#
        );
        run.write("time_to_win.json", &format!(r#"{{"greedy": {time}, "sampled": null}}"#));
    };
    write(190);
    let time = TimeToWin { steps: 400, wins: 190, episodes: 200, seconds: 1.5, cpu_seconds: 2.5 };
    assert_eq!(read_times().map(Result::unwrap), [FirstWin::At(time), FirstWin::Never]);
    let check_error = |expected: &str| {
        let [greedy, _] = read_times();
        let error = greedy.unwrap_err().to_string();
        assert!(error.contains("time_to_win.json") && error.contains(expected), "{error}");
    };
    write(188);
    check_error("188 wins of 200 episodes are too few: the lower end");
    write(201);
    check_error("201 wins are more than there are episodes, 200");
    run.write("time_to_win.json", r#"{"greedy": null}"#);
    check_error("missing field `sampled`");
}
