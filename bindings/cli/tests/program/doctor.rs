//! `doctor`, on this machine and where something is wrong.

use crate::kit::{Place, run};
use crate::skip::skip;
use serde_json::Value;
use std::process::{Command, Output};

/// Runs the program by a shell command, in which it is `"$@"`.
fn in_shell(place: &Place, script: &str, arguments: &str) -> Output {
    let mut command = Command::new("sh");
    command.args(["-c", script, "sh", env!("CARGO_BIN_EXE_smaclite-pool")]).args(arguments.split(' '));
    command.env(smaclite_ipc::ROOT_VARIABLE, place.join("pools")).output().expect("a shell")
}

fn printed(done: &Output) -> String {
    String::from_utf8_lossy(&done.stdout).into_owned()
}

/// Its error, if a check failed.
fn error(done: &Output, name: &str) -> Option<String> {
    let report: Value =
        serde_json::from_slice(&done.stdout).unwrap_or_else(|error| panic!("{error}: {}", printed(done)));
    let checks = report["checks"].as_array().expect("a list");
    let check = checks.iter().find(|check| check["name"] == name).expect(name);
    check["error"].as_str().map(str::to_owned)
}

#[test]
fn a_machine_on_which_pools_work_passes() {
    let place = &Place::new();
    let done = run(place, "doctor");
    let text = printed(&done);
    assert!(done.status.success(), "{text}");
    for line in [
        "kernel           Linux ",
        "engine uses      ",
        "/dev/shm         ",
        "open files       ",
        "left-over files  none",
        "ok      pool in this process: 4 x 2s3z started, stepped and ended",
        "ok      pool in another process: 4 x 2s3z started, stepped and ended",
    ] {
        assert!(text.contains(&format!("\n{line}")), "{line}\n{text}");
    }
    let done = run(place, "doctor --json");
    let report: Value = serde_json::from_slice(&done.stdout).expect("JSON");
    let version = report["facts"]["smaclite-pool"].as_str().expect("text");
    assert!(version.starts_with(env!("CARGO_PKG_VERSION")), "{version}");
    assert_eq!(report["environment"]["SMACLITE_POOL_ROOT"], place.join("pools").to_str().expect("text"));
}

#[test]
fn a_runtime_folder_that_cannot_be_used_fails() {
    let folder = &Place::new();
    folder.write("pools", "a file");
    let done = run(folder, "doctor");
    assert_eq!(done.status.code(), Some(1));
    assert!(printed(&done).contains("\nFAILED  runtime folder: "), "{}", printed(&done));
    assert!(printed(&done).contains(smaclite_ipc::ROOT_VARIABLE), "{}", printed(&done));
    let message = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(message.contains("1 of 1 checks failed"), "{message}");
}

#[test]
fn what_killed_pools_left_is_counted() {
    let place = &Place::new();
    let left_over =
        || printed(&run(place, "doctor")).lines().find(|line| line.starts_with("left")).map(str::to_owned);
    let mut pool = place.serve("3m:2 --name train");
    pool.kill();
    let found = left_over().expect("a line");
    assert!(found.contains(" of killed pools or learners; `smaclite-pool clean` removes them"), "{found}");
    assert!(run(place, "clean").status.success());
    assert_eq!(left_over().as_deref(), Some("left-over files  none"));
}

#[test]
fn too_little_or_unusable_shared_memory_is_what_the_pools_say() {
    if !Command::new("unshare").args(["-m", "true"]).status().is_ok_and(|status| status.success()) {
        return skip("no mount namespace is permitted here");
    }
    let place = &Place::new();
    for (options, expected) in
        [("size=64M", None), ("size=64k", Some("bytes free, but")), ("ro", Some("read-only"))]
    {
        let script = format!(
            "exec unshare -m sh -c 'mount -t tmpfs -o {options} tmpfs /dev/shm && exec \"$@\"' sh \"$@\""
        );
        let done = in_shell(place, &script, "doctor --json");
        assert_eq!(done.status.code(), Some(i32::from(expected.is_some())), "{options}: {}", printed(&done));
        for check in ["pool in this process", "pool in another process"] {
            let found = error(&done, check);
            let is_as_expected = match expected {
                None => found.is_none(),
                Some(text) => found.as_ref().is_some_and(|found| found.contains(text)),
            };
            assert!(is_as_expected, "{options}, {check}: {found:?}");
        }
    }
}
