//! `doctor`, on this machine and where something is wrong.

use crate::kit::run;
use crate::page_kit::Place;
use crate::skip::skip;
use serde_json::Value;
use std::fs;
use std::process::{Command, Output};

/// Runs the program by a shell command, in which it is `"$@"`.
fn in_shell(place: &Place, script: &str, arguments: &str) -> Output {
    let mut command = Command::new("sh");
    command.args(["-c", script, "sh", env!("CARGO_BIN_EXE_smaclite-pool")]).args(arguments.split(' '));
    command.env(smaclite_ipc::ROOT_VARIABLE, place.root()).output().expect("a shell")
}

fn printed(done: &Output) -> String {
    String::from_utf8_lossy(&done.stdout).into_owned()
}

/// Result and text of the check with this name.
fn check(done: &Output, name: &str) -> (String, String) {
    let report: Value =
        serde_json::from_slice(&done.stdout).unwrap_or_else(|error| panic!("{error}: {}", printed(done)));
    let checks = report["checks"].as_array().expect("a list");
    let check = checks.iter().find(|check| check["name"] == name).expect(name);
    let has_remedy = check["remedy"].is_string();
    assert_eq!(has_remedy, check["result"] != "ok", "{check}");
    (check["result"].as_str().expect("text").to_owned(), check["found"].as_str().expect("text").to_owned())
}

#[test]
fn a_machine_on_which_pools_work_passes() {
    let place = Place::new();
    let _pool = place.serve("3m:2 --name train");
    let done = place.output("doctor");
    let text = printed(&done);
    assert!(done.status.success(), "{text}");
    for line in [
        "kernel         Linux ",
        "engine uses    ",
        "/dev/shm       ",
        "open files     ",
        "train ",
        "ok       pool in this process: 4 x 2s3z started, stepped and ended",
        "ok       pool in another process: 4 x 2s3z started, stepped and ended",
    ] {
        assert!(text.contains(&format!("\n{line}")), "{line}\n{text}");
    }
    let done = place.output("doctor --json");
    let report: Value = serde_json::from_slice(&done.stdout).expect("JSON");
    assert_eq!(report["machine"]["version"], env!("CARGO_PKG_VERSION"));
    assert!(report["machine"]["shared_memory"]["bytes"].as_u64() > Some(0), "{report}");
    assert_eq!(report["machine"]["environment"]["SMACLITE_POOL_ROOT"], place.root().to_str().expect("text"));
    assert_eq!(report["pools"][0]["pool"], "train");
    assert_eq!(check(&done, "left-over files"), ("ok".into(), "none".into()));
}

#[test]
fn a_runtime_folder_that_cannot_be_used_fails() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("pools"), "a file").expect("a file");
    let done = run(folder.path(), "doctor");
    assert_eq!(done.status.code(), Some(1));
    assert!(printed(&done).contains("\nFAILED   runtime folder: "), "{}", printed(&done));
    assert!(printed(&done).contains("SMACLITE_POOL_ROOT names another one"), "{}", printed(&done));
    let message = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(message.contains(" checks failed"), "{message}");
}

#[test]
fn what_killed_pools_left_is_a_warning() {
    let place = Place::new();
    let mut pool = place.serve("3m:2 --name train");
    pool.child.kill().and_then(|()| pool.child.wait()).expect("it ran");
    let done = place.output("doctor --json");
    let (result, found) = check(&done, "left-over files");
    assert_eq!(result, "warning");
    assert!(found.ends_with(" of killed pools or learners") && !found.starts_with("1 "), "{found}");
    // The pools of the checks removed the files in shared memory; its socket and its lock are left.
    assert_eq!(check(&place.output("doctor --json"), "left-over files").1, "1 of killed pools or learners");
    assert!(place.output("clean").status.success());
    assert_eq!(check(&place.output("doctor --json"), "left-over files").0, "ok");
}

#[test]
fn low_limits_are_warnings() {
    let place = Place::new();
    let done = in_shell(&place, "ulimit -n 200 && exec \"$@\"", "doctor --json");
    assert_eq!(check(&done, "open files"), ("warning".into(), "at most 200".into()));
    let done = in_shell(&place, "ulimit -v 4000000 && exec \"$@\"", "doctor --json");
    assert_eq!(check(&done, "address space"), ("warning".into(), "at most 4096.0 MB".into()));
}

#[test]
fn too_little_or_unusable_shared_memory_is_found() {
    if !Command::new("unshare").args(["-m", "true"]).status().is_ok_and(|status| status.success()) {
        return skip("no mount namespace is permitted here");
    }
    let place = Place::new();
    for (options, status, result, pool) in [
        ("size=64M", 0, "warning", "ok"),
        ("size=64k", 1, "warning", "failed"),
        ("ro", 1, "failed", "failed"),
    ] {
        let script = format!(
            "exec unshare -m sh -c 'mount -t tmpfs -o {options} tmpfs /dev/shm && exec \"$@\"' sh \"$@\""
        );
        let done = in_shell(&place, &script, "doctor --json");
        assert_eq!(done.status.code(), Some(status), "{options}: {}", printed(&done));
        assert_eq!(check(&done, "shared memory").0, result, "{options}");
        for name in ["pool in this process", "pool in another process"] {
            assert_eq!(check(&done, name).0, pool, "{options}");
        }
    }
}
