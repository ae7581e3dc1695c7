//! Crash points: a supervisor that is killed at a chosen system call, by `strace`, and what must hold
//! afterwards.

use super::process::{ROLE_VARIABLE, SOON};
use super::{Child, PoolPlan, Room};
use std::process::{Command, Stdio};

/// System calls of a start and an end that leave something behind, and how often each is made at most.
pub const CALLS: [(&str, u64); 12] = [
    ("mkdir", 8),
    ("openat", 90),
    ("ftruncate", 8),
    ("fallocate", 2),
    ("fchmod", 60),
    ("flock", 6),
    ("pwrite64", 3),
    ("bind", 3),
    ("listen", 1),
    ("unlink", 30),
    ("unlinkat", 40),
    ("rmdir", 4),
];

/// Can crash points be made here?
pub fn has_strace() -> bool {
    let mut strace = Command::new("strace");
    let traced = strace.args(["-qq", "-o", "/dev/null", "true"]).stderr(Stdio::null()).status();
    traced.is_ok_and(|status| status.success())
}

/// Starts and ends a pool that is killed before its `nth` system call of this name. Then one `clean` must
/// leave nothing, and the next start must work. Says whether the pool lived to make that call.
///
/// # Errors
/// What did not hold.
pub fn survives(plan: &PoolPlan, call: &str, nth: u64) -> Result<bool, String> {
    let room = Room::new();
    let program = std::env::current_exe().expect("a path of this program");
    let mut command = Command::new("strace");
    command.args(["-f", "-qq", "-o", "/dev/null", "-e"]).arg(format!("trace={call}"));
    command.arg("-e").arg(format!("inject={call}:signal=KILL:when={nth}")).arg(program);
    command.args(["--exact", "role", "--ignored", "--nocapture"]);
    command.env(ROLE_VARIABLE, format!("supervisor {}", serde_json::to_string(plan).expect("plain data")));
    let mut victim = Child::of_command(command.env(smaclite_ipc::ROOT_VARIABLE, room.root()), "victim");
    let _ = victim.answer(SOON * 2); // that it serves, or that it is gone
    let lived = victim.end().is_some_and(|status| status.success());
    let at = |what: &str| format!("killed before {call} {nth}: {what}");

    let mut clean = Child::start(&room, "program", "smaclite-pool clean");
    match clean.wait(SOON * 2).and_then(|status| status.code()) {
        Some(0) => {}
        status => return Err(at(&format!("clean ended with {status:?}"))),
    }
    if !room.files().is_empty() {
        return Err(at(&format!("clean left {:#?}", room.files())));
    }
    let mut next = Child::supervisor_refused(&room, plan);
    next.answer(SOON * 2).map_err(|error| at(&format!("the next start: {error}")))?;
    next.end();
    if !room.files().is_empty() {
        return Err(at(&format!("the next pool left {:#?}", room.files())));
    }
    Ok(!lived)
}
