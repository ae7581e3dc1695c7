//! What ends a training from outside, and files of runs that are not those that it wrote: signals, pipes,
//! parts of files, damaged values, and names of teams.

use crate::kit::{
    Place, SMALL, error, json_lines, make_pipe, output, program, send_signal, spawn, wait_until,
    wait_until_caught, warnings,
};
use rustix::process::Signal;
use serde_json::{Value, json};
use signal_hook::consts::SIGHUP;
use std::fs;
use std::sync::Arc;
use std::time::Duration;

/// An interrupted command had the exit status 0 of one that is complete, or the 1 of one that failed: scripts
/// evaluated half a team, and batch systems did not put the job into the queue again.
#[test]
fn an_interrupted_command_has_the_exit_status_of_its_signal() {
    let folder = &Place::new();
    output(folder, &format!("train 3m --steps 1e2 --seeds 2 --out runs {SMALL}"));
    let endless = [
        format!("train 3m --steps 100000000 --out run {SMALL}"),
        format!("train 3m --steps 100000000 --seeds 2 --out two {SMALL}"),
        "evaluate zoo:3m --episodes 1000000".to_owned(),
        "tournament zoo:3m hold --episodes 1000000".to_owned(),
        "exploit zoo:3m --steps 100000000".to_owned(),
        "dataset record random --scenario 3m --episodes 100000000 --out a.smdata".to_owned(),
        "bench 3m --seconds 1000".to_owned(),
    ];
    for (command, signal) in endless.iter().zip([Signal::INT, Signal::TERM].into_iter().cycle()) {
        let child = spawn(folder, &format!("{command} --threads 1"));
        wait_until_caught(&child);
        std::thread::sleep(Duration::from_millis(300)); // into its work
        send_signal(&child, signal);
        let done = child.wait_with_output().expect("an end");
        assert_eq!(done.status.code(), Some(128 + signal.as_raw()), "{command}: {done:?}");
    }
    for (run, first) in [("run", "run"), ("two", "two/seed-0")] {
        let log = fs::read_to_string(folder.join(first).join("log.csv")).expect("the log");
        let steps = log.lines().last().and_then(|line| line.split(',').nth(1)?.parse::<u64>().ok());
        output(folder, &format!("train --resume {run} --steps {}", steps.unwrap_or(0) + 1));
    }
}

/// To open a pipe is to wait for who reads or writes at its other end: `train --resume` waited without end.
#[test]
fn files_of_a_run_that_are_pipes_are_refused() {
    let folder = &Place::new();
    output(folder, &format!("train 3m --steps 600 --evaluate-every 300 --out run {SMALL}"));
    for name in ["run.json", "weights.safetensors", "checkpoint.safetensors", "log.csv", "evaluations.csv"] {
        let (path, kept) = (folder.join("run").join(name), folder.join("kept"));
        fs::rename(&path, &kept).expect("a file of a run");
        make_pipe(&path);
        folder.fails("train --resume run --steps 900", 1, "is not a regular file");
        fs::rename(&kept, &path).expect("a file of a run");
    }
    output(folder, "train --resume run --steps 900");
}

/// SIGKILL while a copy for the league was written left `league/.tmpXXXXXX`, which no later start removed.
#[test]
fn files_that_a_killed_process_did_not_complete_are_removed() {
    let folder = &Place::new();
    let league = "--opponent league --league-every 1";
    output(folder, &format!("train 3m --steps 600 --out run {league} {SMALL}"));
    let left = ["run/.tmpAbC123", "run/league/.tmpAbC123"].map(|name| folder.join(name));
    left.iter().for_each(|path| fs::write(path, "half").expect("a file"));
    output(folder, "train --resume run --steps 900");
    assert!(left.iter().all(|path| !path.exists()), "{left:?}");
    assert!(folder.join("run/league/000001.safetensors").exists());
}

/// `run.json` is edited by hand, too. The message had all 309 digits of 1e308, or the 3000 characters.
#[test]
fn values_of_a_damaged_run_are_cut() {
    let folder = &Place::new();
    output(folder, &format!("train 3m --steps 1e2 --out run {SMALL}"));
    let text = folder.read("run/run.json");
    let long = format!("\"{}\"", "x".repeat(3000));
    for (key, value) in [("gamma", "1e308"), ("epochs", "1e308"), ("epochs", &long), ("algorithm", &long)] {
        let mut run: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        run["config"][key] = serde_json::from_str(value).expect("JSON");
        folder.write("run/run.json", run.to_string());
        let message = error(folder, "train --resume run", 1);
        assert!(message.contains("run.json") && message.len() < 400, "{key}: {message}");
    }
}

/// They said what the system says of the folder `zoo:3m`, or of `3m`, and not what was meant.
#[test]
fn teams_of_the_zoo_that_are_named_otherwise_are_hints() {
    let folder = &Place::new();
    for command in ["evaluate 3m", "exploit 3m", "train --resume 3m"] {
        folder.fails(command, 1, "`3m` is not the folder of a run of `smaclite-pool train`: it has no");
        folder.fails(command, 1, "the team of the zoo is `zoo:3m`");
    }
    folder.fails("play zoo:3m", 1, "smaclite-pool play 3m --against zoo:3m");
    folder.fails("train --resume zoo:3m", 1, "a team of the zoo, which has no checkpoint");
    folder.fails("report zoo:3m --out report", 1, "a team of the zoo, which has no evaluations");
    folder.fails("dataset record kite --scenario 3m --out k.smdata", 2, "--episodes <N>");
    folder.fails("train 3m --league-every 5 --out run", 1, "--league-size need --opponent league");
}

/// The enemies' sizes lacked the phases of attacks that those of the agents have, so a tournament called
/// equal sides unequal, and `exploit` said so after its whole training.
#[test]
fn a_team_of_starcraft_rules_plays_tournaments_and_is_exploited() {
    let folder = &Place::new();
    output(folder, &format!("train 3m --rules starcraft --steps 1e2 --out run {SMALL}"));
    let printed = output(folder, "tournament run kite --episodes 4 --threads 1");
    assert!(printed.starts_with("3m, rules starcraft-1: 2 players, 4 pairings of 4 episodes"), "{printed}");
    let exploited = output(folder, "exploit run --steps 1e2 --seeds 1 --episodes 4");
    assert!(exploited.starts_with("3m, rules starcraft-1: best responses to run"), "{exploited}");
    let evaluated = output(folder, "evaluate run --episodes 4 --json");
    assert!(evaluated.contains(r#""rules":"starcraft-1""#), "results of other rules look alike: {evaluated}");
}

/// The weights of the maps were written to a run of one map, which nothing could read.
#[test]
fn a_team_of_weighted_maps_is_adapted_to_one_and_exploited() {
    let folder = &Place::new();
    output(folder, "train --maps 3m=2,8m --steps 1e2 --out team --num-envs 9 --horizon 16 --hidden 8,8");
    output(folder, "adapt team 8m --out on-8m");
    output(folder, "evaluate on-8m --episodes 2");
    output(folder, "exploit team --steps 1e2 --seeds 1 --episodes 2");
}

/// Evaluations and tournaments played battles without an end, and did not hear Ctrl-C meanwhile.
#[test]
fn battles_of_a_pool_without_a_limit_end_where_they_are_evaluated() {
    let folder = &Place::new();
    let mut pool = folder.serve("3m:8 --episode-limit none --name endless --threads 1");
    let train = "train --pool endless --steps 1e2 --evaluate-every 100 --horizon 16 --out run";
    let warning = warnings(folder, train);
    assert!(warning.contains("does not serve the field `snapshot`"), "{warning}");
    pool.kill();
    output(folder, "tournament run hold --episodes 2 --threads 1");
    output(folder, "evaluate run --episodes 2 --greedy");
}

/// The resumption failed, after it had removed the final result; where the file was missing, it was written
/// anew.
#[test]
fn damaged_best_weights_are_written_anew() {
    let folder = &Place::new();
    output(folder, &format!("train 3m --steps 600 --evaluate-every 300 --out run {SMALL}"));
    let best = folder.join("run/best.safetensors");
    let played = output(folder, "evaluate run --episodes 8 --json");
    folder.write("run/best.safetensors", &folder.bytes("run/best.safetensors")[..60]);
    output(folder, "train --resume run --steps 600");
    assert_eq!(output(folder, "evaluate run --episodes 8 --json"), played);
    assert!(folder.join("run/final.json").exists());
    // Without a word, the last weights played, which may win nothing.
    fs::remove_file(&best).expect("the best weights");
    for command in ["evaluate run", "tournament run hold", "dataset record run --episodes 2 --out a.smdata"] {
        let expected =
            "`run` has no best.safetensors: it was evaluated, so they were lost; `train --resume` writes";
        folder.fails(command, 1, expected);
    }
    output(folder, "evaluate run --weights last --episodes 8");
}

/// Every interrupted call left a hidden file or folder beside what it was to write.
#[test]
fn an_interrupted_conversion_leaves_nothing() {
    let folder = &Place::new();
    output(folder, "record 25m --policy hold --episodes 1 --out a.smreplay");
    for (to, catches) in [("pictures", true), ("a.gif", false)] {
        let child = spawn(folder, &format!("replay a.smreplay --to {to} --size 2000x2000"));
        if catches {
            wait_until_caught(&child);
        }
        std::thread::sleep(Duration::from_millis(300));
        send_signal(&child, Signal::TERM);
        let done = child.wait_with_output().expect("an end");
        assert!(!done.status.success(), "{to}: {done:?}");
        assert_eq!(folder.names_in(""), ["a.smreplay"], "{to}");
    }
}

/// With the status 0 and half of what was asked for, or without the file, when a pipe was closed.
#[test]
fn a_recording_that_is_not_complete_says_so_and_one_that_is_asked_for_is_written() {
    let folder = &Place::new();
    let mut child = spawn(folder, "evaluate zoo:3m --json --episodes 500 --record a.smreplay --threads 1");
    drop(child.stdout.take());
    child.wait().expect("an end");
    output(folder, "replay a.smreplay --to a.html");

    let mut pool = folder.serve("3m:4 --name brief --threads 1");
    let mut learner = spawn(folder, "train --pool brief --steps 1e8 --horizon 16 --out run");
    let record = spawn(folder, "record --pool brief --episodes 10000 --out b.smreplay");
    wait_until_caught(&record);
    std::thread::sleep(Duration::from_millis(1000)); // some episodes
    pool.kill();
    let done = record.wait_with_output().expect("an end");
    assert_eq!(done.status.code(), Some(1), "{done:?}");
    assert!(
        String::from_utf8_lossy(&done.stderr).contains("the supervisor of pool `brief` is gone"),
        "{done:?}"
    );
    output(folder, "replay b.smreplay --to b.html");
    learner.wait().expect("an end");
    output(folder, "clean");
}

/// A log in a file had colours, as escape sequences.
#[test]
fn a_log_that_no_terminal_shows_has_no_colours() {
    let folder = &Place::new();
    let train = format!("--log info train 3m --steps 1e2 --out run {SMALL}");
    let log = warnings(folder, &train);
    assert!(log.contains("INFO") && !log.contains('\u{1b}'), "{log}");
}

/// `exploit --out`, which needs no temporary folder, made one and failed where it could not.
#[test]
fn best_responses_that_are_kept_need_no_temporary_folder() {
    let folder = &Place::new();
    output(folder, &format!("train 3m --steps 1e2 --out run {SMALL}"));
    let exploit = "exploit run --steps 100 --seeds 1 --episodes 2 --out kept --threads 1";
    let done =
        program(folder, exploit).env("TMPDIR", folder.join("none")).output().expect("the program starts");
    assert!(done.status.success(), "{done:?}");
    assert!(folder.join("kept/seed-1/weights.safetensors").is_file());
}

/// Options that have no effect were silently ignored: clap does not ask for what another argument of
/// the same command excludes.
#[test]
fn options_without_effect_are_refused() {
    let folder = &Place::new();
    output(folder, &format!("train 3m --steps 1e2 --out run {SMALL}"));
    output(folder, "record 3m --out a.smreplay");
    output(folder, "replay a.smreplay --to a.snapshot --step 3");
    for (command, status, expected) in [
        ("record 2s3z --lane foo --out b.smreplay", 2, "cannot be used with '--lane <NAME>'"),
        ("record --from a.snapshot --env 1 --out b.smreplay", 2, "cannot be used with"),
        ("dataset record run --rules paper --episodes 1 --out a.smdata", 1, "--rules has no effect on a run"),
        ("bench 3m --mode engine --threads 4", 1, "--threads has no effect in the mode `engine`, which"),
        ("bench 3m --mode in-turn --batch-size 8", 1, "--batch-size has no effect in the mode `in-turn`"),
        ("bench 3m --mode engine --wait spin", 1, "--wait has no effect in the mode `engine`"),
        ("show 2s3z --seed 3", 1, "--seed is for generated scenarios; `2s3z` is none"),
        ("show a.snapshot --samples 2", 1, "is for generated scenarios; `a.snapshot` is a snapshot"),
        ("replay a.smreplay --to a.gif --fps 51", 1, "--fps must be between 0.01 and 50 for a GIF, got 51"),
    ] {
        folder.fails(command, status, expected);
    }
}

/// Battles were played, for hours, for a file that could not be written.
#[test]
fn a_file_without_a_folder_is_refused_before_the_battles() {
    let folder = &Place::new();
    output(folder, "record 3m --out a.smreplay");
    for (command, option) in [
        ("evaluate zoo:3m --episodes 1000000 --record none/a.smreplay", "--record"),
        ("record 3m --episodes 10000 --out none/a.smreplay", "--out"),
        ("replay a.smreplay --to none/frames", "--to"),
        ("dataset record nearest --scenario 3m --episodes 1000000 --out none/a.smdata", "--out"),
        ("dataset expand a.smdata --out none/arrays", "--out"),
    ] {
        let expected = format!("{option} must be in a folder that exists; there is no `none`");
        folder.fails(command, 1, &expected);
    }
    for (command, option, file) in [
        ("evaluate zoo:3m --episodes 1000000 --record", "--record", "taken.smreplay"),
        ("record 3m --episodes 10000 --out", "--out", "taken.smreplay"),
        ("dataset record nearest --scenario 3m --episodes 1000000 --out", "--out", "taken.smdata"),
    ] {
        fs::create_dir_all(folder.join(file)).expect("a folder");
        folder.fails(&format!("{command} {file}"), 1, &format!("{option} {file}: is a directory"));
    }
}

/// The enemies of drawn maps attack the nearest agent, and actions were recorded against others.
#[test]
fn a_benchmark_plays_the_scenarios_own_opponent() {
    let folder = &Place::new();
    for options in ["", " --mode attached --rules starcraft", " --mode in-turn"] {
        let bench = format!("bench protoss_5_vs_5 --policy nearest --num-envs 12 --seconds 0.01{options}");
        output(folder, &bench);
    }
}

/// On drawn maps, an evaluation, `adapt` and `play` had attack_move, against which no team was trained there.
#[test]
fn a_team_meets_the_enemies_of_its_map() {
    let folder = &Place::new();
    let of = |map: &str, options: &str| {
        let evaluate = format!("evaluate zoo:all-maps --map {map} --episodes 1 --json{options}");
        let printed = output(folder, &evaluate);
        json_lines(&printed).pop().expect("a result")["opponents"].clone()
    };
    assert_eq!(of("protoss_5_vs_5", ""), json!({"attack_nearest": 1.0}), "as in its training");
    assert_eq!(of("3m", ""), json!({"attack_move": 1.0}));
    assert_eq!(of("protoss_20_vs_23", ""), json!({"attack_nearest": 1.0}), "it never saw the map");
    assert_eq!(of("protoss_5_vs_5", " --opponent kite"), json!({"kite": 1.0}));
    output(folder, "adapt zoo:all-maps protoss_5_vs_5 --out adapted");
    let run: Value = serde_json::from_slice(&folder.bytes("adapted/run.json")).expect("JSON");
    assert_eq!(run["opponents"], json!({"attack_nearest": 1.0}));
    // A team of one map plays it, whether or not it is named.
    let own = "evaluate zoo:3m --episodes 8 --seed 2";
    assert_eq!(output(folder, own), output(folder, &format!("{own} --map 3m")));
}

/// A team of other rules played the enemies without a warning.
#[test]
fn a_team_of_other_rules_is_warned_of() {
    let folder = &Place::new();
    output(folder, &format!("train 3m --steps 1e2 --rules starcraft --out run {SMALL}"));
    let expected = "the team `run` was trained with rules starcraft-1, and the battles have rules smaclite";
    let warning = warnings(folder, "evaluate zoo:3m --opponent run --episodes 2");
    assert!(warning.contains(expected), "{warning}");
    assert_eq!(warnings(folder, "evaluate run --opponent run --episodes 2"), "");
}

#[test]
fn a_weight_of_a_map_names_the_map() {
    let folder = &Place::new();
    let expected = "--maps: the weight of `3m` must be a number above 0, got 0";
    folder.fails("train --maps 3m=0,MMM --out run", 1, expected);
}

/// The warning said that environments begin anew, and an error then refused the snapshots of the checkpoint.
#[test]
fn a_run_with_snapshots_is_resumed_on_a_pool_without_them() {
    let folder = &Place::new();
    output(folder, &format!("train 3m --steps 256 --last-actions 0 --out own {SMALL}"));
    let _pool = folder.serve("3m:8 --name bare --threads 1");
    let resume = "train --resume own --steps 512 --pool bare --threads 1";
    let message = warnings(folder, resume);
    let warning = "pool `bare` does not serve the field `snapshot`: where the run is resumed, environments";
    assert!(message.contains(warning), "{message}");
    // What refuses the run comes first: it needs no advice then.
    output(folder, &format!("train 3m --steps 256 --last-actions 2 --out other {SMALL}"));
    let message = error(folder, "train --resume other --steps 512 --pool bare --threads 1", 1);
    assert!(
        message.contains("serve it with `--obs-last-actions 2`") && !message.contains(warning),
        "{message}"
    );
}

/// Where the last units of both teams die in one step, tournaments counted a draw, and all else a victory.
#[test]
fn teams_that_destroy_each_other_do_not_win() {
    let folder = &Place::new();
    let units = json!({"BANELING": 1});
    let group = |x: u32, faction: &str| json!({"x": x, "y": 16, "faction": faction, "units": units});
    let scenario = json!({
        "name": "banelings", "num_allied_units": 1, "num_enemy_units": 1, "attack_point": [16, 16],
        "groups": [group(14, "ALLY"), group(18, "ENEMY")], "terrain_preset": "SIMPLE", "num_unit_types": 0,
        "ally_has_shields": false, "enemy_has_shields": false, "episode_limit": 40,
    });
    folder.write("banelings.json", scenario.to_string());
    output(folder, &format!("train banelings.json --opponent self --steps 2e3 --out run {SMALL}"));
    let log = folder.read("run/log.csv");
    let column = log.lines().next().expect("names").split(',').position(|name| name == "win_rate_self");
    let rates = log.lines().skip(1).filter_map(|row| row.split(',').nth(column.expect("a column")));
    assert!(rates.filter(|rate| !rate.is_empty()).all(|rate| rate == "0"), "{log}");
    let played = output(folder, "evaluate run --opponent run --episodes 10 --json");
    let played = json_lines(&played).pop().expect("a result");
    assert!(played["mean_return"].as_f64() > Some(10.0) && played["win_rate"] == 0.0, "{played}");
}

/// Closing a terminal ended a pool without its end: its files stayed in shared memory.
#[test]
fn a_closed_terminal_ends_a_pool_cleanly() {
    // Programs inherit that a signal is ignored, as under nohup, and not that it is handled.
    signal_hook::flag::register(SIGHUP, Arc::default()).expect("a handler");
    let folder = &Place::new();
    let mut pool = folder.serve("3m:2 --name closed --threads 1");
    send_signal(&pool.child, Signal::HUP);
    assert_eq!(pool.child.wait().expect("an end").code(), Some(0));
    assert!(!output(folder, "list").contains("closed"));
}

/// The pool of a benchmark never ended when the benchmark was killed.
#[test]
fn the_pool_of_a_killed_benchmark_ends() {
    let folder = &Place::new();
    let mut bench = spawn(folder, "bench 3m --mode attached --seconds 1000 --threads 1");
    let has_pool = || output(folder, "list").contains("bench-");
    wait_until(has_pool);
    bench.kill().expect("a signal");
    bench.wait().expect("an end");
    wait_until(|| !has_pool());
    output(folder, "clean"); // what the killed program itself left behind
}
