//! What ends a training from outside, and files of runs that are not those that it wrote: signals, pipes,
//! parts of files, damaged values, and names of teams.

use crate::kit::{catches_interruptions, check_error, error, output, program};
use rustix::process::Signal;
use std::fs;
use std::process::Stdio;
use std::time::Duration;

const SMALL: &str = "--num-envs 8 --horizon 16 --hidden 16,16";

/// An interrupted command had the exit status 0 of one that is complete, or the 1 of one that failed: scripts
/// evaluated half a team, and batch systems did not put the job into the queue again.
#[test]
fn an_interrupted_command_has_the_exit_status_of_its_signal() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
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
        let mut started = program(folder, &format!("{command} --threads 1"));
        let child = started.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("the program starts");
        while !catches_interruptions(child.id()) {
            std::thread::sleep(Duration::from_millis(5));
        }
        std::thread::sleep(Duration::from_millis(300)); // into its work
        let pid = rustix::process::Pid::from_child(&child);
        rustix::process::kill_process(pid, signal).expect("a signal");
        let done = child.wait_with_output().expect("an end");
        assert_eq!(done.status.code(), Some(128 + signal.as_raw()), "{command}: {done:?}");
    }
    output(folder, "train --resume run --steps 1e2");
    output(folder, "train --resume two --steps 1e2");
}

/// To open a pipe is to wait for who reads or writes at its other end: `train --resume` waited without end.
#[test]
fn files_of_a_run_that_are_pipes_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    output(folder, &format!("train 3m --steps 600 --evaluate-every 300 --out run {SMALL}"));
    for name in ["run.json", "weights.safetensors", "checkpoint.safetensors", "log.csv", "evaluations.csv"] {
        let (path, kept) = (folder.join("run").join(name), folder.join("kept"));
        fs::rename(&path, &kept).expect("a file of a run");
        let (fifo, mode) = (rustix::fs::FileType::Fifo, rustix::fs::Mode::RWXU);
        rustix::fs::mknodat(rustix::fs::CWD, &path, fifo, mode, 0).expect("a pipe");
        check_error(folder, "train --resume run --steps 900", 1, "is not a regular file");
        fs::rename(&kept, &path).expect("a file of a run");
    }
    output(folder, "train --resume run --steps 900");
}

/// SIGKILL while a copy for the league was written left `league/.tmpXXXXXX`, which no later start removed.
#[test]
fn files_that_a_killed_process_did_not_complete_are_removed() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
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
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    output(folder, &format!("train 3m --steps 1e2 --out run {SMALL}"));
    let text = fs::read_to_string(folder.join("run/run.json")).expect("the run");
    let long = format!("\"{}\"", "x".repeat(3000));
    for (key, value) in [("gamma", "1e308"), ("epochs", "1e308"), ("epochs", &long), ("algorithm", &long)] {
        let mut run: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        run["config"][key] = serde_json::from_str(value).expect("JSON");
        fs::write(folder.join("run/run.json"), run.to_string()).expect("a file");
        let message = error(folder, "train --resume run", 1);
        assert!(message.contains("run.json") && message.len() < 400, "{key}: {message}");
    }
}

/// They said what the system says of the folder `zoo:3m`, or of `3m`, and not what was meant.
#[test]
fn teams_of_the_zoo_that_are_named_otherwise_are_hints() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    for command in ["evaluate 3m", "exploit 3m", "train --resume 3m"] {
        check_error(
            folder,
            command,
            1,
            "`3m` is not the folder of a run of `smaclite-pool train`: it has no",
        );
        check_error(folder, command, 1, "the team of the zoo is `zoo:3m`");
    }
    check_error(folder, "play zoo:3m", 1, "smaclite-pool play 3m --against zoo:3m");
    check_error(folder, "train --resume zoo:3m", 1, "a team of the zoo, which has no checkpoint");
    check_error(folder, "report zoo:3m --out report", 1, "a team of the zoo, which has no evaluations");
    check_error(folder, "dataset record kite --scenario 3m --out k.smdata", 2, "--episodes <N>");
    check_error(folder, "train 3m --league-every 5 --out run", 1, "--league-size need --opponent league");
}
