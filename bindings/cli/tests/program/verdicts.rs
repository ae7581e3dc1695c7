//! Commands whose exit status says what they found.

use crate::kit::{Place, output, program, with_other_return};
use smaclite_view::Replay;
use std::fs;
use std::path::Path;

/// A replay of one episode with another checksum than that of its battle.
fn write_damaged_replay(folder: &Path) {
    output(folder, "record 3m --out good.smreplay");
    let good = Replay::read(&folder.join("good.smreplay")).expect("a replay");
    let mut json: serde_json::Value =
        serde_json::from_slice(&good.to_json().expect("JSON")).expect("a document");
    json["episodes"][0]["checksum"] = "0123456789abcdef".into();
    let damaged = Replay::from_json(json.to_string().as_bytes(), "bad").expect("a replay");
    damaged.write(&folder.join("bad.smreplay")).expect("a file");
}

/// They ended at the first line that they could not print, with success: `check good.json bad.json | head -1`
/// in a script found nothing wrong.
#[test]
fn what_is_wrong_is_found_where_the_output_is_closed() {
    let folder = &Place::new();
    output(folder, "new scenario good.json");
    folder.write("bad.json", "{}");
    write_damaged_replay(folder);
    let small = "--num-envs 8 --horizon 16 --hidden 8,8 --steps 256 --evaluate-every 256";
    output(folder, &format!("train 3m {small} --seeds 2 --out runs"));
    folder.change("runs/seed-1/evaluations.csv", with_other_return);

    let status = |command: &str, is_closed: bool| {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        let reader = Some(reader).filter(|_| !is_closed);
        let done = program(folder, command).stdout(writer).output().expect("the program starts");
        drop(reader);
        (done.status.code(), String::from_utf8_lossy(&done.stderr).into_owned())
    };
    let check = |command: &str, expected: i32| {
        let (read, closed) = (status(command, false), status(command, true));
        assert_eq!(read.0, Some(expected), "{command}: {}", read.1);
        assert_eq!(closed, read, "{command}");
    };
    for (command, expected) in [
        ("check good.json", 0),
        ("check good.json bad.json", 1),
        ("check --json good.json bad.json", 1),
        ("replay good.smreplay", 0),
        ("replay bad.smreplay", 1),
        ("verify-run runs/seed-0", 0),
        ("verify-run runs/seed-0 runs/seed-1", 1),
        ("doctor", 0),
    ] {
        check(command, expected);
    }
    fs::remove_dir_all(folder.join("pools")).expect("the folder of pools");
    folder.write("pools", "a file");
    check("doctor", 1);
    // A list that its reader has cut off is no failure.
    assert_eq!(status("scenarios", true), (Some(0), String::new()));
}
