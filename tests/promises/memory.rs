//! Too little shared memory, in a mount namespace with a small `/dev/shm`.

use crate::assert_says;
use smaclite_tests::pools::process::{ROLE_VARIABLE, SOON};
use smaclite_tests::pools::{Child, LanePlan, PoolPlan, Room};
use std::process::Command;

/// A child of the role that sees a `/dev/shm` of so many kilobytes; `None` where mounting is not permitted.
fn with_small_memory(room: &Room, kilobytes: usize, role: &str) -> Option<Child> {
    with_memory(room, &format!("size={kilobytes}k"), role)
}

/// The same with these options of `mount`.
fn with_memory(room: &Room, options: &str, role: &str) -> Option<Child> {
    let mount = |script: &str| {
        let mut command = Command::new("unshare");
        command.args(["-m", "sh", "-c", script]);
        command
    };
    let small = format!("mount -t tmpfs -o {options} tmpfs /dev/shm");
    if !mount(&small).status().is_ok_and(|status| status.success()) {
        println!("skipped: no mount namespace is permitted here");
        return None;
    }
    let program = std::env::current_exe().expect("a path of this program");
    let run = format!("{small} && exec {} --exact role --ignored --nocapture", program.display());
    let mut command = mount(&run);
    command.env(ROLE_VARIABLE, role).env(smaclite_ipc::ROOT_VARIABLE, room.root());
    Some(Child::of_command(&mut command, "child with little memory"))
}

fn plan() -> PoolPlan {
    PoolPlan::new([LanePlan::new("2s3z", 64)])
}

#[test]
fn too_little_memory_is_found_at_the_start() {
    let plan = plan();
    let role = format!("supervisor {}", serde_json::to_string(&plan).expect("plain data"));
    let mut started_with = None;
    // The whole range: by far too little, just too little for what lies beside the frames, enough.
    let sizes = [64, 3540, 3900, 4100, 4200, 16384];
    for kilobytes in sizes {
        let room = Room::new();
        let Some(mut child) = with_small_memory(&room, kilobytes, &role) else { return };
        match child.answer(SOON * 2) {
            Err(error) => {
                println!("{kilobytes} kB: {error}");
                assert_says(&error, &["/dev/shm", "bytes", "--shm-size"]);
                assert!(started_with.is_none(), "{kilobytes} kB: {error}");
                child.end();
                room.assert_empty();
            }
            Ok(_) => {
                println!("{kilobytes} kB: starts");
                started_with.get_or_insert(kilobytes);
                serve_within(&room, &child, &plan);
            }
        }
    }
    let enough = started_with.expect("16 MB are enough");
    assert!(enough > 1024, "{enough} kB cannot be enough");
}

/// The lock file stayed where the folder in shared memory could not be made.
#[test]
fn a_start_without_shared_memory_leaves_nothing() {
    let role = format!("supervisor {}", serde_json::to_string(&plan()).expect("plain data"));
    let room = Room::new();
    let Some(mut child) = with_memory(&room, "ro", &role) else { return };
    let error = child.answer(SOON * 2).expect_err("no file can be made");
    assert_says(&error, &["/dev/shm", "read-only"]);
    child.end();
    room.assert_empty();
}

#[test]
fn memory_that_others_take_later_harms_only_who_comes_later() {
    let plan = plan();
    let role = format!("supervisor {}", serde_json::to_string(&plan).expect("plain data"));
    let room = Room::new();
    let Some(supervisor) = with_small_memory(&room, 8 << 10, &role) else { return };
    assert_eq!(supervisor.answer(SOON * 2).as_deref(), Ok("ok"));
    let inside = |script: &str| {
        let mut command = Command::new("nsenter");
        command.args(["-m", "-t", &supervisor.pid().to_string(), "sh", "-c", script]);
        command.stderr(std::process::Stdio::null()).status().expect("a command in the namespace")
    };
    let mut learner = learner_beside(&room, &supervisor, &plan);
    learner.must("connect train");
    learner.must("reset");
    inside("cat /dev/zero > /dev/shm/filler");
    learner.must("hold 4"); // what it uses was set aside
    learner.must("drop");
    learner.must("step 40");
    learner.must("disconnect");
    let error = learner.ask("connect train").expect_err("no memory for its requests");
    assert_says(&error, &["/dev/shm", "bytes", "requests of a learner"]);
    inside("rm /dev/shm/filler");
    learner.must("connect train");
    learner.must("reset");
    learner.must("step 10");
}

/// A learner in the supervisor's namespace.
fn learner_beside(room: &Room, supervisor: &Child, plan: &PoolPlan) -> Child {
    let program = std::env::current_exe().expect("a path of this program");
    let mut command = Command::new("nsenter");
    command.args(["-m", "-t", &supervisor.pid().to_string()]).arg(program);
    command.args(["--exact", "role", "--ignored", "--nocapture"]);
    let role = format!("learner {}", serde_json::to_string(&plan.lanes[0]).expect("plain data"));
    command.env(ROLE_VARIABLE, role).env(smaclite_ipc::ROOT_VARIABLE, room.root());
    Child::of_command(&mut command, "learner with little memory")
}

/// A learner in the same namespace either gets a clear error or steps; nobody dies of SIGBUS.
fn serve_within(room: &Room, supervisor: &Child, plan: &PoolPlan) {
    let mut learner = learner_beside(room, supervisor, plan);
    match learner.ask("connect train") {
        Err(error) => assert_says(&error, &["/dev/shm", "bytes"]),
        Ok(_) => {
            learner.must("reset");
            learner.must("hold 4");
            learner.must("check");
            learner.must("drop");
            learner.must("step 40");
        }
    }
}
