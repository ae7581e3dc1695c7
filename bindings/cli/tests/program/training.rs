//! Training and evaluation by the program: train, evaluate, resume, Ctrl-C.

use crate::kit::{
    PATIENCE, Place, SMALL, json_lines, output, parsed, run, send_signal, spawn, wait_until,
    with_other_return,
};
use rustix::process::Signal;
use serde_json::Value;
use smaclite_learn::{STATE_CRITIC_AGENTS, TEAM_ENTROPY};
use std::fs;
use std::io::{BufRead, BufReader};
use std::time::Duration;

#[test]
fn a_team_is_trained_resumed_and_evaluated() {
    let folder = &Place::new();
    let train = format!("train 3m --steps 1000 --seed 1 --out runs/3m {SMALL}");
    let printed = output(folder, &train);
    assert!(printed.contains(" of 1000 steps  ") && printed.ends_with("complete\n"), "{printed}");
    let mut names = folder.names_in("runs/3m");
    assert!(names[1].starts_with("events.out.tfevents."), "{names:?}");
    output(folder, "train --resume runs/3m"); // which is complete: there are no events, so no file of them
    assert_eq!(folder.names_in("runs/3m"), names);
    names.remove(1);
    assert_eq!(names, ["checkpoint.safetensors", "log.csv", "run.json", "weights.safetensors"]);

    let count_updates = || {
        let log = folder.read("runs/3m/log.csv");
        log.lines().count() as u64 - 1
    };
    let before = count_updates();
    let updates = json_lines(&output(folder, "train --resume runs/3m --steps 1500 --json"));
    let numbers = updates.iter().filter_map(|update| update["update"].as_u64());
    assert!(numbers.eq(before + 1..=count_updates()) && !updates.is_empty(), "{updates:?}");
    assert!(updates[updates.len() - 1]["steps"].as_u64().expect("a number") >= 1500, "{updates:?}");

    let lines = json_lines(&output(folder, "evaluate runs/3m --episodes 20 --seed 3 --json"));
    assert_eq!(lines.len(), 21);
    let result = &lines[20];
    assert_eq!((result["episodes"].as_u64(), result["scenario"].as_str()), (Some(20), Some("3m")));
    let returns: f64 = lines[..20].iter().filter_map(|line| line["episode_return"].as_f64()).sum();
    assert!((result["mean_return"].as_f64().expect("a number") - returns / 20.0).abs() < 1e-6);
    assert!(result["win_rate"].is_number());

    // Of 70 episodes in 64 environments, environment 0 plays two.
    let lines = json_lines(&output(folder, "evaluate runs/3m --episodes 70 --json --record quiet.smreplay"));
    let first = lines.iter().filter(|line| line["env_id"] == 0);
    let outcome = |line: &Value| {
        let end = if line["won"] == true { "won" } else { "lost" };
        let episode_return = line["episode_return"].as_f64().expect("a number");
        format!(
            "episode {}: {end} after {} steps, return {episode_return:.2}, ",
            line["number"], line["length"]
        )
    };
    let outcomes: Vec<String> = first.map(outcome).collect();
    let printed = output(folder, "evaluate runs/3m --episodes 70 --record 3m.smreplay");
    let replayed = output(folder, "replay 3m.smreplay");
    assert!(outcomes.len() == 2 && printed.contains("3m.smreplay: "), "{outcomes:?} {printed}");
    for outcome in outcomes {
        assert!(printed.contains(&outcome) && replayed.contains(&outcome), "{outcome} {printed} {replayed}");
    }
    assert_eq!(folder.bytes("quiet.smreplay"), folder.bytes("3m.smreplay"));

    let printed = output(folder, "evaluate runs/3m --episodes 5 --greedy");
    let expected =
        "3m: 5 episodes in 5 environments, greedy actions, seed 0\nopponent     attack_move\nwin rate";
    assert!(printed.starts_with(expected), "{printed}");
}

/// The enemies of a run can be a script, a trained team, or the team itself.
#[test]
fn teams_play_the_enemies() {
    let folder = &Place::new();
    output(folder, &format!("train 3m --steps 500 --seed 1 --out first {SMALL}"));
    output(folder, &format!("train 3m --steps 500 --seed 2 --out second --opponent first {SMALL}"));
    let league = "--opponent league --league-every 1 --league-size 2 --script-share 0.3 --zero-sum";
    let updates =
        json_lines(&output(folder, &format!("train 3m --steps 600 --out third --json {league} {SMALL}")));
    assert_eq!(updates[updates.len() - 1]["league_size"].as_f64(), Some(2.0), "{updates:?}");
    let resumed = output(folder, "train --resume third --steps 2000");
    assert!(resumed.contains("  wins ") && resumed.contains(" % (self "), "{resumed}");
    for (run, names) in [("second", "opponent"), ("third", "league")] {
        assert!(folder.names_in(&format!("{run}/{names}")).len() >= 2, "{run}/{names}");
        let printed = output(folder, &format!("evaluate {run} --episodes 5"));
        assert!(printed.contains("opponent     attack_move\n"), "{printed}");
    }
    let record = "evaluate second --episodes 3 --opponent first --record both.smreplay";
    let (printed, replayed) = (output(folder, record), output(folder, "replay both.smreplay"));
    assert!(printed.contains("opponent     the team of first\n"), "{printed}");
    assert!(replayed.contains("episode 0: "), "{replayed}");
}

#[test]
fn opponents_that_do_not_exist_or_fit_are_refused() {
    let folder = &Place::new();
    let train = "train 3m --out run";
    folder.fails(&format!("{train} --opponent kites"), 2, "unknown opponent `kites`; the opponents are");
    folder.fails(&format!("{train} --opponent ./kite"), 1, "`./kite` is not the folder of a run");
    let seeds = format!("{train} --seed 18446744073709551615 --seeds 2");
    folder.fails(&seeds, 1, "the last of 2 seeds from 18446744073709551615 on would be above");
    let mixed = "a trained team cannot be mixed with scripts here";
    folder.fails(&format!("{train} --opponent zoo:3m=0.8,kite=0.2"), 2, mixed);
    folder.fails(&format!("{train} --opponent self --script-share 1"), 1, "between 0 and 0.9");
    folder.fails(&format!("{train} --opponent learner"), 2, "`learner` is no opponent of a team");
    folder.fails(&format!("{train} --opponent self --league-size 3"), 1, "need --opponent league");
    folder.fails(&format!("{train} --opponent kite --zero-sum"), 1, "need --opponent self or league");
    folder.fails(&format!("{train} --opponent league --self-share 2"), 1, "between 0 and 1, got 2");
    let unequal = "but in 5m_vs_6m the agents are 5 units with 12 actions";
    folder.fails("train 5m_vs_6m --out run --opponent self", 1, unequal);
    assert!(!folder.join("run").exists(), "a command that fails leaves no folder");
    output(folder, &format!("train 3m --steps 1e2 --out run {SMALL}"));
    folder.fails("evaluate run --opponent self", 1, "name its folder twice");
    folder.fails("train --resume run --opponent self", 2, "cannot be used with");
}

#[test]
fn ctrl_c_writes_a_checkpoint() {
    let folder = &Place::new();
    let child = spawn(folder, &format!("train 3m --steps 100000000 --out run {SMALL}"));
    let log = folder.join("run/log.csv");
    wait_until(|| fs::read_to_string(&log).is_ok_and(|log| log.lines().count() > 3));
    folder.fails("train --resume run", 1, "another process trains in `run`; wait until it ends");
    send_signal(&child, Signal::INT);
    let done = child.wait_with_output().expect("an end");
    let printed = String::from_utf8_lossy(&done.stdout);
    assert_eq!(done.status.code(), Some(128 + 2), "{done:?}"); // SIGINT
    assert!(printed.ends_with("interrupted; resume with --resume\n"), "{done:?}");
    let updates = fs::read_to_string(&log).expect("the log").lines().count() - 1;
    let steps = (updates * 128 + 100).to_string();
    let resumed = json_lines(&output(folder, &format!("train --resume run --steps {steps} --json")));
    assert_eq!(resumed[0]["update"].as_u64(), Some(updates as u64 + 1), "nothing is made twice");
}

/// Where the line of an evaluation could not be printed, no checkpoint was written: `train | head` lost up to
/// a minute of training.
#[test]
fn an_output_that_is_closed_loses_no_training() {
    let folder = &Place::new();
    let arguments = format!("train 3m --steps 1e8 --evaluate-every 2k --out run {SMALL}");
    let mut child = spawn(folder, &arguments);
    // The next line of an update comes five seconds after the first, so that of an evaluation fails.
    let mut printed = BufReader::new(child.stdout.take().expect("a pipe")).lines();
    let lines = [(); 2].map(|()| printed.next().expect("a line").expect("text"));
    assert!(lines[0].starts_with("3m: evaluated at 0 steps"), "{lines:?}");
    assert!(lines[1].contains(" of 100000000 steps"), "{lines:?}");
    drop(printed);
    let done = child.wait_with_output().expect("an end");
    assert_eq!(done.status.code(), Some(1), "the training is not complete");
    let message = "smaclite-pool: standard output was closed; resume with --resume run\n"; // there was none
    assert_eq!(String::from_utf8_lossy(&done.stderr), message);
    let log = folder.read("run/log.csv");
    let updates = log.lines().count() as u64 - 1;
    let steps = updates * 128 + 100;
    let resumed = json_lines(&output(folder, &format!("train --resume run --steps {steps} --json")));
    assert_eq!(resumed[0]["update"].as_u64(), Some(updates + 1), "nothing is made twice");
}

/// What a killed process leaves, also of an evaluation, changes nothing: the resumed run has the bits of one
/// that was not killed.
#[test]
fn a_killed_run_has_the_evaluations_of_the_uninterrupted_one() {
    let folder = &Place::new();
    let train = |out: &str| format!("train 3m --steps 40k --evaluate-every 1k --seed 1 --out {out} {SMALL}");
    output(folder, &train("whole"));
    let mut child = spawn(folder, &train("killed"));
    let rows = folder.join("killed/evaluations.csv");
    wait_until(|| fs::read_to_string(&rows).is_ok_and(|rows| rows.lines().count() > 3));
    child.kill().expect("a signal"); // SIGKILL
    child.wait().expect("an end");
    assert!(!folder.join("killed/final.json").exists(), "it was to be killed before its end");
    folder.change("killed/evaluations.csv", |rows| rows.to_owned() + "7000,70"); // half a row
    output(folder, "train --resume killed");
    let read = |run: &str, name: &str| folder.bytes(&format!("{run}/{name}"));
    for name in ["weights.safetensors", "best.safetensors", "evaluation_episodes.csv"] {
        assert!(read("killed", name) == read("whole", name), "{name}");
    }
    let verified = output(folder, "verify-run killed whole --evaluations all");
    let expected = "killed: 41 evaluations and the final one played again, 3264 episodes: \
                    every return, length and win is equal\n";
    assert!(verified.starts_with(expected) && verified.lines().count() == 2, "{verified}");

    folder.change("killed/evaluations.csv", with_other_return);
    let expected = "`killed` is not verified: the evaluation at 40000 steps, greedy means: recorded Summary";
    folder.fails("verify-run whole killed", 1, expected);
    folder.fails("verify-run nowhere", 1, "`nowhere` is not the folder of a run");
}

#[test]
fn seeds_train_in_folders_of_their_own() {
    let folder = &Place::new();
    let seeds = "train 3m --steps 600 --seeds 3 --seed 4 --evaluate-every 300 --out runs";
    let printed = output(folder, &format!("{seeds} {SMALL}"));
    assert!(printed.ends_with("complete: 3 seeds\n"), "{printed}");
    let evaluated = printed.lines().filter(|line| line.contains(": evaluated at ")).count();
    assert_eq!(evaluated, 3 * 3, "{printed}");
    output(folder, &format!("train 3m --steps 600 --seed 5 --out alone {SMALL}"));
    let weights = |run: &str| folder.bytes(&format!("{run}/weights.safetensors"));
    assert!(weights("runs/seed-5") == weights("alone"), "alone, and without evaluations");
    let verified = output(folder, "verify-run runs --evaluations final");
    assert_eq!(verified.lines().count(), 3, "{verified}");
    let taken = "`runs/seed-4` already holds a run; continue the runs in `runs` with --resume";
    folder.fails(&format!("{seeds} {SMALL}"), 1, taken);
    let resumed = output(folder, "train --resume runs --steps 900 --json");
    // Before a run is trained or begins: an error of one that trains names its seed.
    folder.fails("train --resume runs --steps 700 --seeds 4", 1, "smaclite-pool: `runs/seed-");
    assert!(!folder.join("runs/seed-7").exists());
    let seeds: std::collections::BTreeSet<u64> =
        json_lines(&resumed).iter().filter_map(|update| update["seed"].as_u64()).collect();
    assert!(seeds.iter().copied().eq(4..7), "{resumed}");
    folder.fails("train 3m --seeds 0 --out none", 2, "number between 1 and 10000");
    let too_few = "`runs` has seeds from 4 to 6: --seeds must be at least 3, got 2";
    folder.fails("train --resume runs --seeds 2", 1, too_few);
    let printed = output(folder, "train --resume runs --seeds 4");
    assert!(printed.ends_with("complete: 4 seeds\n"), "{printed}");
    assert!(folder.join("runs/seed-7/final.json").exists());
    folder.fails("train --resume alone --seeds 4", 1, "with folders such as seed-1 in it; `alone` is none");
    folder.fails("train --resume runs --evaluate-every 5", 2, "cannot be used with");
    fs::rename(folder.join("alone"), folder.join("runs/alone")).expect("another run");
    // It was begun anew.
    fs::rename(folder.join("runs/seed-7/run.json"), folder.join("lost")).expect("a description");
    let undescribed = "`runs/seed-7` has final.json, a file of a run, but no run.json, which says what";
    for command in ["train --resume runs --seeds 4", "verify-run runs", "report runs --out report"] {
        folder.fails(command, 1, undescribed);
    }
    folder.fails("train 3m --out runs/seed-7", 1, undescribed);
    folder.fails("zoo --export 3m runs/seed-7", 1, undescribed);
    fs::rename(folder.join("lost"), folder.join("runs/seed-7/run.json")).expect("a description");
    let other = "`runs/alone` is no run of `train --seeds`, which would be in a folder of the name `seed-5`";
    folder.fails("train --resume runs --steps 9000", 1, other);
}

#[test]
fn ctrl_c_ends_the_beginning_of_many_seeds() {
    let folder = &Place::new();
    let child = spawn(folder, &format!("train 3m --steps 1e8 --seeds 2000 --out runs {SMALL}"));
    wait_until(|| folder.join("runs/seed-1/run.json").exists());
    send_signal(&child, Signal::INT);
    let done = child.wait_with_output().expect("an end");
    let message = String::from_utf8_lossy(&done.stderr);
    assert_eq!(done.status.code(), Some(128 + 2), "{done:?}"); // SIGINT
    let expected = "of 2000 seeds had begun; `train --resume runs --seeds 2000` begins the missing runs";
    assert!(
        message.starts_with("smaclite-pool: interrupted when ") && message.contains(expected),
        "{message}"
    );
    assert!(!folder.join("runs/seed-1999").exists());
}

/// "say which one" did not say how, and MAP had said it already.
#[test]
fn the_lane_of_a_pool_is_the_one_that_plays_the_map() {
    let place = &Place::new();
    let _pool = place.serve("3m:8 2s3z:8 --name two");
    let done = run(place, "train --pool two --steps 1e2 --out run");
    let message = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(message.ends_with("several lanes; name one, by `lane=` or --lane: `3m`, `2s3z`\n"), "{message}");
    let options = "--horizon 16 --hidden 16,16 --out run";
    let done = run(place, &format!("train 2s3z --pool two --steps 1e2 {options}"));
    assert!(done.status.success(), "{done:?}");
    let description = place.read("run/run.json");
    assert!(description.contains("2s3z"), "{description}");
    let done = run(place, "train --resume run --pool two --steps 2e2");
    assert!(done.status.success(), "{done:?}");
}

/// An update of a large network takes long. It did not react at all, not even to a second signal.
#[test]
fn ctrl_c_ends_an_update() {
    let folder = &Place::new();
    // Several seconds per update, in which the log stays empty.
    let large = "--num-envs 64 --horizon 256 --epochs 100 --hidden 512,512 --threads 1 --seed 1";
    let mut child = spawn(folder, &format!("train 3m --steps 100000000 --out run {large}"));
    let run = folder.join("run/run.json");
    wait_until(|| run.exists());
    std::thread::sleep(Duration::from_secs(2)); // the rollout takes a part of a second
    send_signal(&child, Signal::INT);
    let begin = std::time::Instant::now();
    while child.try_wait().expect("a child").is_none() && begin.elapsed() < PATIENCE {
        std::thread::sleep(Duration::from_millis(10));
    }
    let _ = child.kill(); // a program that does not react must not hang the test
    let done = child.wait_with_output().expect("an end");
    let printed = String::from_utf8_lossy(&done.stdout);
    assert_eq!(done.status.code(), Some(128 + 2), "{done:?}"); // SIGINT
    assert!(printed.ends_with("interrupted; resume with --resume\n"), "{done:?}");
    let log = folder.read("run/log.csv");
    assert_eq!(log, "", "it ended the update first, or was not in it");
    output(folder, "evaluate run --episodes 5"); // the weights of before the update
}

/// The folder of a run whose first checkpoint could not be written was no run, and could not become one.
#[test]
fn a_run_that_could_not_begin_can_be_begun_again() {
    let folder = &Place::new();
    fs::create_dir_all(folder.join("run/checkpoint.safetensors")).expect("a folder in the way");
    folder.fails(&format!("train 3m --steps 1e2 --out run {SMALL}"), 1, "checkpoint.safetensors");
    fs::remove_dir(folder.join("run/checkpoint.safetensors")).expect("no folder in the way");
    output(folder, &format!("train 3m --steps 1e2 --out run {SMALL}"));
}

#[test]
fn errors_say_what_is_accepted() {
    let folder = &Place::new();
    folder.fails("train 3m", 2, "--out <FOLDER>");
    folder.fails("train 3n --out run", 1, "3n");
    folder.fails("train 3m --out run --last-actions 17", 2, "number between 0 and 16");
    folder.fails("train 3m --out run --steps 1.5", 2, "number between 1 and 281474976710656");
    folder.fails("train 3m --out run --advantage-floor -1", 1, "advantage_floor must be between 0 and 10");
    folder.fails("train 3m --out run --gamma 2", 1, "gamma must be between 0 and 1, got 2");
    folder.fails("train 3m --out run --num-envs 0", 2, "must be a whole number between 1 and 65536");
    folder.fails("train 3m --out run --algorithm qmix", 2, "algorithm must be `mappo` or `ippo`");
    folder.fails("train 3m --out run --network gnn", 2, "must be `flat`, `units` or `universal`, got `gnn`");
    let hidden =
        "hidden must be 2 widths between 2 and 4096 for networks over units (`flat` ones have others";
    folder.fails("train 3m --out run --network units --hidden 64", 1, hidden);
    folder.fails("train 3m --out run --pool none", 1, "none");
    folder.fails("train --resume nowhere", 1, "`nowhere`");
    folder.fails("train --resume nowhere --gamma 0.9", 2, "cannot be used with");
    folder.fails("evaluate .", 1, "`.` is not the folder of a run of `smaclite-pool train`: it has no");
    folder.write("moat.json", "{}");
    folder.fails("train 3m --out moat.json", 1, "--out must name a folder, but `moat.json` is a file");
    assert!(!folder.join("run").exists(), "a command that fails leaves no folder");
    output(folder, &format!("train 3m --steps 1e2 --out run {SMALL}"));
    folder.fails("train 3m --steps 100 --out run", 1, "`run` already holds a run");
    let none = "`run` has no best.safetensors: it was not evaluated while it trained (--evaluate-every);";
    folder.fails("evaluate run --weights best", 1, none);
    folder.write("run/weights.safetensors", "nothing");
    folder.fails("evaluate run", 1, "`run/weights.safetensors` is damaged or not a file of a run");
    folder.fails("evaluate run --episodes 0", 2, "number between 1 and 1000000");
    folder.fails("evaluate run --record run.gif", 2, "'--record <FILE>': must end in .smreplay");
}

#[test]
fn the_help_states_the_defaults() {
    let folder = &Place::new();
    let help = output(folder, "train --help").split_whitespace().collect::<Vec<_>>().join(" ");
    // Teams that are fixed, and that are drawn; flat networks, and those over units.
    let [fixed, drawn] = [("3m", " --network flat"), ("zerg_5_vs_5", "")].map(|(map, options)| {
        output(folder, &format!("train {map}{options} --out {map} --steps 1"));
        let run = parsed(&folder.read(&format!("{map}/run.json")));
        run["config"].as_object().expect("an object").clone()
    });
    let text = |value: &Value| match value {
        Value::Array(widths) => widths.iter().map(Value::to_string).collect::<Vec<_>>().join(","),
        Value::String(keyword) => keyword.clone(),
        number => number.as_f64().expect("a number").to_string(),
    };
    for (name, value) in drawn.iter().filter(|(name, _)| *name != "steps") {
        let default = match (name.as_str(), value) {
            ("network", _) => "units, or flat where observations have none".to_owned(),
            ("entropy", _) => format!("{TEAM_ENTROPY} divided by the number of agents"),
            ("last_actions", drawn) => format!("{}, or {drawn} for drawn teams", fixed["last_actions"]),
            ("algorithm", _) => {
                format!("mappo for {STATE_CRITIC_AGENTS} agents or more and for drawn teams, otherwise ippo")
            }
            (name, value) if fixed[name] != *value => {
                format!("{}, over units {}", text(&fixed[name]), text(value))
            }
            (_, value) => text(value),
        };
        let option = format!(" --{} <", name.replace('_', "-"));
        let (_, text) = help.split_once(&option).unwrap_or_else(|| panic!("no{option} in {help}"));
        let stated = text.split_once("[default: ").and_then(|(_, text)| text.split_once(']'));
        assert_eq!(stated.map(|(stated, _)| stated), Some(default.as_str()), "{option}");
    }
}
