//! Reports by the program: tables, files, errors.

use crate::kit::{Place, output, parsed};
use std::collections::BTreeMap;
use std::fs;

const SMALL: &str = "--num-envs 8 --horizon 16 --hidden 16,16 --steps 600 --evaluate-every 300";

/// All files in a folder, by name.
fn files(place: &Place, folder: &str) -> BTreeMap<String, String> {
    let with_text = |name: String| (name.clone(), place.read(&format!("{folder}/{name}")));
    place.names_in(folder).into_iter().map(with_text).collect()
}

#[test]
fn two_algorithms_are_reported() {
    let folder = &Place::new();
    output(folder, &format!("train 3m --seeds 2 --out runs/ippo {SMALL}"));
    output(folder, &format!("train 3m --seeds 2 --out runs/other --algorithm mappo {SMALL}"));
    let report = "report runs/ippo/ mappo=runs/other --actions sampled";
    let printed = output(folder, &format!("{report} --out one --threads 1"));
    assert!(printed.starts_with("2 algorithms, 1 task, 2 seeds each, sampled actions\n\n"), "{printed}");
    for part in ["\nalgorithm  tasks  runs  won ", "\nippo       1      2     ", "\nmappo   ippo  "] {
        assert!(printed.contains(part), "{part} in {printed}");
    }
    let again = output(folder, &format!("{report} --out again --threads 3"));
    assert_eq!(printed, again);
    let one = files(folder, "one");
    assert_eq!(one, files(folder, "again"), "threads change nothing");
    let pictures = one.keys().filter(|name| name.ends_with(".svg"));
    assert_eq!(pictures.clone().count(), 2 * 4 * 2, "two metrics, four kinds, light and dark");
    for picture in pictures.filter(|name| !name.contains("-dark")) {
        assert!(one["report.md"].contains(&format!("src=\"{picture}\"")), "{picture}");
        let dark = picture.replace(".svg", "-dark.svg");
        assert!(one["report.md"].contains(&dark) && one.contains_key(&dark), "{dark}");
        assert_ne!(one[picture], one[&dark]);
    }
    let rows = |name: &str| one[name].lines().count() - 1;
    assert_eq!([rows("runs.csv"), rows("aggregates.csv"), rows("improvement.csv")], [4, 8, 4]);
    assert_eq!([rows("curves.csv"), rows("profiles.csv")], [8 * 3, 4 * 101]);
    let columns = |line: &str| line.split(',').count();
    assert!(one.iter().filter(|(name, _)| name.ends_with(".csv")).all(|(_, text)| {
        text.lines().all(|line| columns(line) == columns(text.lines().next().expect("a header")))
    }));
    let metrics = parsed(&one["metrics.json"]);
    assert_eq!(metrics["smaclite"]["3m"]["mappo"]["run_1"]["step_1"]["step_count"], 300);

    // In the folder of the report of two, whose pictures of who is better stayed beside an empty table.
    let quick = output(folder, "report runs/ippo --out one --skip-times");
    assert!(!quick.contains("until a team won"), "{quick}");
    output(folder, "report runs/ippo --out quick --skip-times");
    assert_eq!(files(folder, "one"), files(folder, "quick"));
}

/// The end of the shorter run is no multiple of the interval between evaluations: `report` refused the seeds
/// because they "were evaluated at other steps".
#[test]
fn seeds_that_were_added_to_a_longer_run_are_reported_with_it() {
    let folder = &Place::new();
    let small = SMALL.replace("--steps 600", "--steps 500");
    output(folder, &format!("train 3m --seeds 1 --out runs {small}"));
    output(folder, "train --resume runs --seeds 2 --steps 800");
    let evaluated = |seed: u64| {
        let rows = folder.read(&format!("runs/seed-{seed}/evaluations.csv"));
        let steps = rows.lines().skip(1).map(|line| line.split(',').next().expect("steps"));
        steps.collect::<Vec<_>>().join(" ")
    };
    assert_eq!([evaluated(0), evaluated(1)], ["0 300 500 600 800", "0 300 600 800"]);
    output(folder, "report runs --out report --skip-times");
    let curves = &files(folder, "report")["curves.csv"];
    assert!(curves.contains(",600,") && !curves.contains(",500,"), "{curves}");
}

/// A bad evaluation could be left out, and the report said nothing.
#[test]
fn an_evaluation_that_was_left_out_is_missed() {
    let folder = &Place::new();
    output(folder, &format!("train 3m --out run {SMALL}"));
    folder.change("run/evaluations.csv", |rows| {
        rows.split_inclusive('\n').filter(|row| !row.starts_with("300,")).collect()
    });
    folder.fails("report run --out report", 1, "it has no evaluation at 300 steps, but run.json says");
}

/// A learner of one's own may leave no `time_to_win.json`: its teams were reported as ones that never won.
#[test]
fn who_was_not_measured_is_not_who_never_won() {
    let folder = &Place::new();
    output(folder, &format!("train 3m --seeds 3 --out runs {SMALL}"));
    for seed in 0..3 {
        fs::remove_file(folder.join(format!("runs/seed-{seed}/run.json"))).expect("a description");
        let options = format!("{{\"scenario\": \"3m\", \"seed\": {seed}}}");
        folder.write(&format!("runs/seed-{seed}/options.json"), options);
    }
    let cells = |printed: &str, actions: &str| -> Vec<String> {
        let of_task = |line: &&str| line.starts_with("3m ") && line.contains(actions);
        let row = printed.lines().find(of_task).expect("a row");
        row.split("  ").map(str::trim).filter(|cell| !cell.is_empty()).map(str::to_owned).collect()
    };
    let printed = output(folder, "report runs --out all");
    for actions in [" greedy ", " sampled "] {
        let row = &cells(&printed, actions)[3..];
        assert_eq!(row, ["not measured", "- (-)", "- (-)", "- (-)"], "{printed}");
    }
    let note = "note: the time to win of 3 of 3 runs of runs on 3m was not measured: `runs/seed-0` has no";
    assert!(printed.contains(note), "{printed}");

    let time = r#"{"steps": 300, "wins": 190, "episodes": 200, "seconds": 1.5, "cpu_seconds": 2.5}"#;
    let times = format!("{{\"greedy\": {time}, \"sampled\": null}}");
    folder.write("runs/seed-1/time_to_win.json", times);
    let printed = output(folder, "report runs --out all");
    let rows = [" greedy ", " sampled "].map(|actions| cells(&printed, actions)[3..].join("; "));
    assert_eq!(rows, ["1 of 1; 300 (300); 2.5 (2.5); 1.5 (1.5)", "0 of 1; - (-); - (-); - (-)"], "{printed}");
    assert!(printed.contains("note: the time to win of 2 of 3 runs of runs on 3m"), "{printed}");
}

/// A file of an earlier report would be taken for one of these runs.
#[test]
fn there_is_no_file_for_marl_eval_if_seeds_differ() {
    let folder = &Place::new();
    output(folder, &format!("train 3m --seeds 2 --out a {SMALL}"));
    output(folder, &format!("train 3m --out b {SMALL}"));
    output(folder, "report a --out all");
    assert!(folder.join("all/metrics.json").exists());
    let printed = output(folder, "report a b --out all");
    assert!(!folder.join("all/metrics.json").exists());
    let why = "note: there is no metrics.json, which marl-eval would not read: numbers of seeds differ\n";
    assert!(printed.ends_with(why), "{printed}");
    assert!(folder.read("all/report.md").contains("no metrics.json"));
}

/// The options of self-play were taken for the battles of the evaluations, which are against the script; and
/// the path of an opponent for the opponent.
#[test]
fn runs_are_compared_that_were_evaluated_in_the_same_battles() {
    let folder = &Place::new();
    let train = |options: &str| output(folder, &format!("train 3m {options} {SMALL}"));
    train("--out script");
    train("--opponent league --out league");
    train("--opponent league --self-share 0.3 --out other");
    output(folder, "report script league other --out all");

    train("--out opponent");
    train("--seed 1 --opponent opponent --out runs/one");
    train("--seed 2 --opponent ./opponent --out runs/two");
    let printed = output(folder, "report runs --out all");
    assert!(!printed.contains("differ in more than their seeds"), "{printed}");
    fs::remove_dir_all(folder.join("opponent")).expect("a run");
    train("--seed 9 --out opponent");
    train("--seed 3 --opponent opponent --out runs/three");
    folder.fails("report runs --out all", 1, "play 3m, but not the same battles");

    // Other learners say it themselves.
    for (run, battles) in [("script", "one"), ("league", "one"), ("other", "two")] {
        fs::remove_file(folder.join(run).join("run.json")).expect("a run");
        let options = format!(r#"{{"scenario": "3m", "seed": 0, "battles": "{battles}"}}"#);
        fs::write(folder.join(run).join("options.json"), options).expect("a file");
    }
    output(folder, "report script league --out all --skip-times");
    folder.fails("report script other --out all --skip-times", 1, "not the same battles");
}

/// Weights of opponents are shares: the runs have equal bits, and were not the same battles to the report.
#[test]
fn opponents_are_compared_by_their_shares() {
    let folder = &Place::new();
    let train = |options: &str| output(folder, &format!("train 3m {options} {SMALL}"));
    train("--opponent kite=0.5,attack_move=0.5 --out a");
    train("--opponent attack_move=2,kite=2 --out b");
    train("--opponent attack_move=2,kite=1 --out c");
    let episodes = |run: &str| folder.bytes(&format!("{run}/evaluation_episodes.csv"));
    assert!(episodes("a") == episodes("b") && episodes("a") != episodes("c"));
    output(folder, "report a b --out report --skip-times");
    folder.fails("report a c --out report --skip-times", 1, "not the same battles");
}

#[test]
fn errors_say_what_is_accepted() {
    let folder = &Place::new();
    folder.fails("report", 2, "<[NAME=]FOLDER>");
    folder.fails("report empty", 2, "--out <FOLDER>");
    folder.fails("report x=nowhere --out all", 1, "cannot read `nowhere`");
    assert!(!folder.join("all").exists(), "a command that fails leaves no folder");
    output(folder, &format!("train 3m --out evaluated {SMALL}"));
    fs::remove_file(folder.join("evaluated/evaluations/000000000300.safetensors")).expect("weights");
    folder.fails("report evaluated --out all", 1, "000000000300.safetensors`: No such file");
    folder.fails("report evaluated --out all", 1, "first won; --skip-times leaves this out");
    output(folder, "report evaluated --out all --skip-times");
    folder.fails("report evaluated --out all --actions both", 2, "[possible values: greedy, sampled]");
}

/// The times were those of the folder, so each map of a run had those of its last map.
#[test]
fn each_map_of_a_run_has_its_own_time_to_win() {
    let folder = &Place::new();
    let easy = r#"{"name": "easy", "num_allied_units": 5, "num_enemy_units": 1, "groups": [
        {"x": 9, "y": 16, "faction": "ALLY", "units": {"MARINE": 5}},
        {"x": 12, "y": 16, "faction": "ENEMY", "units": {"MARINE": 1}}], "attack_point": [9, 16],
        "terrain_preset": "SIMPLE", "width": 32, "height": 32, "num_unit_types": 0, "ally_has_shields": false,
        "enemy_has_shields": false, "episode_limit": 60}"#;
    folder.write("easy.json", easy);
    output(folder, &format!("train --maps easy.json,2s3z --out runs/one {SMALL}"));
    output(folder, "report runs --out report");
    let files = files(folder, "report");
    let mut rows = files["runs.csv"].lines().map(|row| row.split(',').collect::<Vec<_>>());
    let columns = rows.next().expect("a header");
    let column = |name: &str| columns.iter().position(|column| *column == name).expect("a column");
    let wins: BTreeMap<&str, &str> =
        rows.map(|row| (row[column("task")], row[column("sampled_win_steps")])).collect();
    assert_eq!(wins, BTreeMap::from([("2s3z", ""), ("easy", "0")]));
}
