//! Crash points: `strace` kills a supervisor at a given system call; then `smaclite-pool clean` must remove
//! everything it left, and the next start must work.

use crate::process::{Child, TIMEOUT, can_launch};
use crate::{PoolPlan, TestDir};

/// System calls of a start and an end that leave something behind, and an upper bound of how often each is
/// made.
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

/// Whether `strace` is installed and may trace children.
pub fn has_strace() -> bool {
    can_launch(&["strace", "-qq", "-o", "/dev/null"])
}

/// Starts and ends a pool that is killed before its `nth` system call of this name, and checks what follows.
/// Returns whether it was killed; otherwise it made fewer such calls.
///
/// # Errors
/// What did not hold.
pub fn check(plan: &PoolPlan, call: &str, nth: u64) -> Result<bool, String> {
    let dir = TestDir::new();
    let (trace, inject) = (format!("trace={call}"), format!("inject={call}:signal=KILL:when={nth}"));
    let strace = ["strace", "-f", "-qq", "-o", "/dev/null", "-e", &trace, "-e", &inject];
    let mut victim = Child::launch(&dir, &strace, &plan.role());
    let _ = victim.answer(TIMEOUT * 2); // that it serves, or that it is gone
    let ended_normally = victim.end().is_some_and(|status| status.success());
    let error = |what: String| format!("killed before {call} {nth}: {what}");
    let is_empty = |after: &str| match dir.files() {
        files if files.is_empty() => Ok(()),
        files => Err(error(format!("{after} left {files:#?}"))),
    };

    let mut clean = Child::program(&dir, "clean");
    match clean.wait(TIMEOUT * 2).and_then(|status| status.code()) {
        Some(0) => is_empty("clean")?,
        status => return Err(error(format!("clean ended with {status:?}"))),
    }
    let mut next = Child::try_supervisor(&dir, plan);
    next.answer(TIMEOUT * 2).map_err(|what| error(format!("the next start: {what}")))?;
    next.end();
    is_empty("the next pool")?;
    Ok(!ended_normally)
}
