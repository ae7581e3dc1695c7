//! Too little shared memory, in a mount namespace with a small `/dev/shm`.

use crate::assert_contains;
use smaclite_tests::process::{TIMEOUT, can_launch};
use smaclite_tests::{Child, LanePlan, PoolPlan, TestDir, skip};
use std::process::Command;

/// Starts a child in a mount namespace whose `/dev/shm` is mounted with these options; `None` if mounting is
/// not permitted.
fn with_shm(dir: &TestDir, options: &str, role: &str) -> Option<Child> {
    let mount = format!("mount -t tmpfs -o {options} tmpfs /dev/shm && exec \"$0\" \"$@\"");
    let launcher = ["unshare", "-m", "sh", "-c", &mount];
    if !can_launch(&launcher) {
        skip("no mount namespace is permitted here");
        return None;
    }
    Some(Child::launch(dir, &launcher, role))
}

fn plan() -> PoolPlan {
    PoolPlan::new([LanePlan::new("2s3z", 64)])
}

#[test]
fn too_little_memory_is_found_at_the_start() {
    let plan = plan();
    let mut started_with = None;
    // From far too little, over just too little for everything besides the frames, to enough.
    let sizes = [64, 3540, 3900, 4100, 4200, 16384];
    for kilobytes in sizes {
        let dir = TestDir::new();
        let size = format!("size={kilobytes}k");
        let Some(mut child) = with_shm(&dir, &size, &plan.role()) else { return };
        match child.answer(TIMEOUT * 2) {
            Err(error) => {
                println!("{kilobytes} kB: {error}");
                assert_contains(&error, &["/dev/shm", "bytes", "--shm-size"]);
                assert!(started_with.is_none(), "{kilobytes} kB: {error}");
                child.end();
                dir.assert_empty();
            }
            Ok(_) => {
                println!("{kilobytes} kB: starts");
                started_with.get_or_insert(kilobytes);
                serve_within(&dir, &child, &plan);
            }
        }
    }
    let enough = started_with.expect("16 MB are enough");
    assert!(enough > 1024, "{enough} kB cannot be enough");
}

/// If the folder in shared memory could not be created, the lock file was not removed.
#[test]
fn a_start_without_shared_memory_leaves_nothing() {
    let dir = TestDir::new();
    let Some(mut child) = with_shm(&dir, "ro", &plan().role()) else { return };
    let error = child.answer(TIMEOUT * 2).expect_err("no file can be created");
    assert_contains(&error, &["/dev/shm", "read-only"]);
    child.end();
    dir.assert_empty();
}

#[test]
fn a_lack_of_memory_after_the_start_affects_only_learners_that_attach_later() {
    let plan = plan();
    let dir = TestDir::new();
    let Some(supervisor) = with_shm(&dir, "size=8M", &plan.role()) else { return };
    assert_eq!(supervisor.answer(TIMEOUT * 2).as_deref(), Ok("ok"));
    let inside = |script: &str| {
        let mut command = Command::new("nsenter");
        command.args(["-m", "-t", &supervisor.pid().to_string(), "sh", "-c", script]);
        command.stderr(std::process::Stdio::null()).status().expect("a command in the namespace")
    };
    let mut learner = learner_beside(&dir, &supervisor, &plan);
    learner.must("connect train");
    learner.must("reset");
    inside("cat /dev/zero > /dev/shm/filler");
    learner.must("hold 4"); // its memory was reserved
    learner.must("drop");
    learner.must("step 40");
    learner.must("disconnect");
    let error = learner.ask("connect train").expect_err("no memory for its requests");
    assert_contains(&error, &["/dev/shm", "bytes", "requests of a learner"]);
    inside("rm /dev/shm/filler");
    learner.must("connect train");
    learner.must("reset");
    learner.must("step 10");
}

/// A learner in the supervisor's mount namespace.
fn learner_beside(dir: &TestDir, supervisor: &Child, plan: &PoolPlan) -> Child {
    let pid = supervisor.pid().to_string();
    Child::launch(dir, &["nsenter", "-m", "-t", &pid], &plan.lanes[0].role())
}

/// A learner in the same namespace either gets a clear error or steps; no process dies of SIGBUS.
fn serve_within(dir: &TestDir, supervisor: &Child, plan: &PoolPlan) {
    let mut learner = learner_beside(dir, supervisor, plan);
    match learner.ask("connect train") {
        Err(error) => assert_contains(&error, &["/dev/shm", "bytes"]),
        Ok(_) => {
            learner.must("reset");
            learner.must("hold 4");
            learner.must("check");
            learner.must("drop");
            learner.must("step 40");
        }
    }
}
