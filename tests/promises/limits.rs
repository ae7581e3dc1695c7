//! What is refused before anything starts, and other users.

use crate::assert_says;
use smaclite_tests::pools::process::ROLE_VARIABLE;
use smaclite_tests::pools::{Child, LanePlan, PoolPlan, Room};
use std::os::unix::fs::PermissionsExt;
use std::process::Command;

/// Runs the program with these arguments to its end: its status and what it said on standard error.
fn program(room: &Room, arguments: &str) -> (Option<i32>, String) {
    let mut command = Command::new(std::env::current_exe().expect("a path of this program"));
    command.args(["--exact", "role", "--ignored", "--nocapture"]);
    command.env(ROLE_VARIABLE, format!("program smaclite-pool {arguments}"));
    command.env(smaclite_ipc::ROOT_VARIABLE, room.root());
    let output = command.output().expect("a child process");
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn a_wrong_scenario_file_is_an_error_before_anything_starts() {
    let room = Room::new();
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).expect("a file");
        path.display().to_string()
    };
    let check = |scenario: &str, parts: &[&str]| {
        let (status, error) = program(&room, &format!("serve {scenario}:4 --name train"));
        assert_eq!(status, Some(1), "{error}");
        assert_says(&error, parts);
        room.assert_empty();
    };
    check(&write("cut.json", "{\"name\": \"x\""), &["cut.json"]);
    check(&write("empty.json", "{}"), &["empty.json"]);
    check(&write("type.json", r#"{"name": 3}"#), &["type.json", "name"]);
    check("no/such/file.json", &["no/such/file.json"]);
    check("2s3y", &["2s3y", "2s3z"]);
}

#[test]
fn wrong_settings_are_errors_before_anything_starts() {
    let room = Room::new();
    let check = |arguments: &str, status: i32, parts: &[&str]| {
        let (found, error) = program(&room, arguments);
        assert_eq!(found, Some(status), "{error}");
        assert_says(&error, parts);
        room.assert_empty();
    };
    check("serve 2s3z:0", 1, &["2s3z", "environments", "got 0"]);
    check("serve 2s3z:many", 1, &["many"]);
    check("serve 2s3z:4 2s3z:4", 1, &["2s3z", "two lanes"]);
    check("serve 2s3z:4 --batch-size 5", 1, &["batch size", "between 1 and 4", "got 5"]);
    check("serve 2s3z:4 --name a/b", 1, &["`a/b`"]);
    check("serve 2s3z:4 --autoreset perhaps", 2, &["perhaps", "next_step"]);
    check("serve 2s3z:4 --fields obs,hp", 1, &["`hp`", "avail_actions"]);
}

/// iceoryx2 calls a lack of file descriptors an internal error, and a read-only disk was shown as a Rust
/// value.
#[test]
fn too_few_file_descriptors_are_named_as_the_cause() {
    let room = Room::new();
    for limit in [9, 14, 20, 26, 32] {
        let limited = format!("ulimit -n {limit} && exec \"$0\" --exact role --ignored --nocapture");
        let mut command = Command::new("sh");
        command.args(["-c", &limited]).arg(std::env::current_exe().expect("a path of this program"));
        command.env(ROLE_VARIABLE, "program smaclite-pool serve 2s3z:2 --name train --threads 1");
        let output = command.env(smaclite_ipc::ROOT_VARIABLE, room.root()).output().expect("a child process");
        let error = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "with {limit}: {error}");
        assert!(error.contains("file descriptors") || error.contains("Too many open files"), "{error}");
        assert!(!error.contains("Os {"), "{error}");
    }
}

#[test]
fn another_user_cannot_attach_or_read() {
    let room = Room::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2)]);
    let _supervisor = Child::supervisor(&room, &plan);
    let mut learner = Child::attached(&room, &plan.lanes[0]);
    learner.must("reset");
    for file in room.files() {
        let Ok(metadata) = file.metadata() else { continue };
        let open = metadata.permissions().mode() & 0o077;
        assert!(open == 0 || !reachable(&file), "{} has mode {open:o}", file.display());
    }
    let folder = tempfile::tempdir_in("/tmp").expect("a folder");
    let copy = folder.path().join("program");
    std::fs::set_permissions(folder.path(), PermissionsExt::from_mode(0o755)).expect("an own folder");
    std::fs::copy(std::env::current_exe().expect("a path"), &copy).expect("a copy others can run");
    let mut command = Command::new("setpriv");
    command.args(["--reuid", "65534", "--regid", "65534", "--clear-groups"]).arg(&copy);
    command.args(["--exact", "role", "--ignored", "--nocapture"]);
    let role = format!("learner {}", serde_json::to_string(&plan.lanes[0]).expect("plain data"));
    command.env(ROLE_VARIABLE, role).env(smaclite_ipc::ROOT_VARIABLE, room.root());
    if !rustix::process::getuid().is_root() {
        println!("skipped: only root can start a child as another user");
        return;
    }
    let mut stranger = Child::of_command(&mut command, "stranger");
    let error = stranger.ask("connect train").expect_err("not its pool");
    assert!(!error.contains("is gone"), "the stranger could not even try");
    println!("the stranger is told: {error}");
    let said = ["Permission denied", "belongs to user"];
    assert!(said.iter().any(|part| error.contains(part)), "{error}");
    learner.must("step 5");
}

/// Can others get to the file at all, or does a folder above it keep them out?
fn reachable(file: &std::path::Path) -> bool {
    let folders = file.ancestors().skip(1);
    folders.filter_map(|f| f.metadata().ok()).all(|m| m.permissions().mode() & 0o001 != 0)
}

#[test]
fn learners_that_come_before_the_pool_are_told_what_runs() {
    let room = Room::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2), LanePlan::new("3s5z", 2)]);
    let mut learner = Child::learner(&room, &LanePlan::new("MMM", 2));
    assert_says(
        &learner.ask("connect train").expect_err("nothing runs"),
        &["`train`", "smaclite-pool serve"],
    );
    let _supervisor = Child::supervisor(&room, &plan);
    assert_says(&learner.ask("connect eval").expect_err("another name"), &["`eval`", "running: train"]);
    assert_says(&learner.ask("connect train").expect_err("no such lane"), &["`MMM`", "`2s3z`, `3s5z`"]);
}
