//! Settings that are refused before anything starts, and clients without access or without a pool.

use crate::assert_contains;
use smaclite_tests::process::{can_launch, role_command, run_to_end};
use smaclite_tests::{Child, LanePlan, PoolPlan, TestDir, skip};
use std::os::unix::fs::PermissionsExt;

/// Runs the program with these arguments to its end. Returns its exit code and standard error.
fn program(dir: &TestDir, launcher: &[&str], arguments: &str) -> (Option<i32>, String) {
    let (status, _, error) = run_to_end(&mut role_command(dir, launcher, &format!("program {arguments}")));
    (status, error)
}

#[test]
fn a_wrong_scenario_file_is_an_error_before_anything_starts() {
    let dir = TestDir::new();
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).expect("a file");
        path.display().to_string()
    };
    let check = |scenario: &str, parts: &[&str]| {
        let (status, error) = program(&dir, &[], &format!("serve {scenario}:4 --name train"));
        assert_eq!(status, Some(1), "{error}");
        assert_contains(&error, parts);
        dir.assert_empty();
    };
    check(&write("cut.json", "{\"name\": \"x\""), &["cut.json"]);
    check(&write("empty.json", "{}"), &["empty.json"]);
    check(&write("type.json", r#"{"name": 3}"#), &["type.json", "name"]);
    check("no/such/file.json", &["no/such/file.json"]);
    check("2s3y", &["2s3y", "2s3z"]);
}

#[test]
fn wrong_settings_are_errors_before_anything_starts() {
    let dir = TestDir::new();
    let check = |arguments: &str, status: i32, parts: &[&str]| {
        let (found, error) = program(&dir, &[], arguments);
        assert_eq!(found, Some(status), "{error}");
        assert_contains(&error, parts);
        dir.assert_empty();
    };
    check("serve 2s3z:0", 2, &["2s3z", "environments", "got `0`"]);
    check("serve 2s3z:many", 2, &["many"]);
    check("serve 2s3z:4 2s3z:4", 1, &["2s3z", "two lanes"]);
    check("serve 2s3z:4 --batch-size 5", 1, &["batch size", "between 1 and 4", "got 5"]);
    check("serve 2s3z:4 --name a/b", 1, &["`a/b`"]);
    check("serve 2s3z:4 --autoreset-mode perhaps", 2, &["perhaps", "NextStep"]);
    check("serve 2s3z:4 --fields obs,hp", 2, &["`hp`", "avail_actions"]);
}

/// iceoryx2 reports a lack of file descriptors as an internal error, and the error of a read-only disk was
/// the debug output of a Rust value. The highest limit here leaves room: how many descriptors a pool needs
/// depends on how many it inherits, and a pool that has enough serves until it is stopped.
#[test]
fn an_error_names_too_few_file_descriptors_as_its_cause() {
    let dir = TestDir::new();
    for limit in [9, 10, 12] {
        let limited = format!("ulimit -n {limit} && exec \"$0\" \"$@\"");
        let serve = "serve 2s3z:2 --name train --threads 1";
        let (status, error) = program(&dir, &["sh", "-c", &limited], serve);
        assert_eq!(status, Some(1), "with {limit}: {error}");
        assert_contains(&error, &["file descriptors are open, and the limit is", "`ulimit -n`"]);
        assert!(!error.contains("Os {"), "{error}");
    }
}

/// The error was "Read-only file system", without a remedy.
#[test]
fn a_folder_that_cannot_be_cleaned_says_what_to_do() {
    let dir = TestDir::new();
    let root = dir.root().display();
    let mount =
        format!("mount --bind {root} {root} && mount -o remount,bind,ro {root} && exec \"$0\" \"$@\"");
    let launcher = ["unshare", "-m", "sh", "-c", &mount];
    if !can_launch(&launcher) {
        return skip("no mount namespace is permitted here");
    }
    let (status, error) = program(&dir, &launcher, "clean");
    assert_eq!(status, Some(1), "{error}");
    assert_contains(&error, &["is on a read-only file system: mount it writable"]);
}

/// SIGXFSZ ended the program without a word.
#[test]
fn an_error_names_a_limit_on_the_size_of_files_as_its_cause() {
    let dir = TestDir::new();
    for limit in [8, 64] {
        let limited = format!("ulimit -f {limit} && exec \"$0\" \"$@\"");
        let serve = "serve 27m_vs_30m:64 --name train --threads 1";
        let (status, error) = program(&dir, &["sh", "-c", &limited], serve);
        assert_eq!(status, Some(1), "with {limit}: {error}");
        assert_contains(&error, &["files of at most", "`ulimit -f unlimited`"]);
    }
}

#[test]
fn another_user_cannot_attach_or_read() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2)]);
    let (_supervisor, mut learner) = Child::supervisor_and_learner(&dir, &plan);
    for file in dir.files() {
        let Ok(metadata) = file.metadata() else { continue };
        let open = metadata.permissions().mode() & 0o077;
        assert!(open == 0 || !reachable(&file), "{} has mode {open:o}", file.display());
    }
    if !rustix::process::getuid().is_root() {
        return skip("only root can start a child as another user");
    }
    let folder = tempfile::tempdir_in("/tmp").expect("a folder");
    let mut other_user = Child::other_user(&dir, folder.path(), &plan.lanes[0].role());
    let error = other_user.ask("connect train").expect_err("the pool of another user");
    assert!(!error.contains("is gone"), "the other user's process did not start");
    println!("the error for another user: {error}");
    let reasons = ["Permission denied", "belongs to user"];
    assert!(reasons.iter().any(|part| error.contains(part)), "{error}");
    learner.must("step 5");
}

/// Whether all folders above the file can be entered by other users.
fn reachable(file: &std::path::Path) -> bool {
    let folders = file.ancestors().skip(1);
    folders.filter_map(|f| f.metadata().ok()).all(|m| m.permissions().mode() & 0o001 != 0)
}

#[test]
fn an_error_of_a_missing_pool_or_lane_lists_those_that_exist() {
    let dir = TestDir::new();
    let plan = PoolPlan::new([LanePlan::new("2s3z", 2), LanePlan::new("3s5z", 2)]);
    let mut learner = Child::learner(&dir, &LanePlan::new("MMM", 2));
    assert_contains(
        &learner.ask("connect train").expect_err("nothing runs"),
        &["`train`", "smaclite-pool serve"],
    );
    let _supervisor = Child::supervisor(&dir, &plan);
    assert_contains(&learner.ask("connect eval").expect_err("another name"), &["`eval`", "running: train"]);
    assert_contains(&learner.ask("connect train").expect_err("no such lane"), &["`MMM`", "`2s3z`, `3s5z`"]);
}
