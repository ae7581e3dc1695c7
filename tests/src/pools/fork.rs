//! A process that forks while it steps: children read what the parent holds.

#![allow(unsafe_code)] // `fork`

use smaclite_ipc::Batch;
use std::time::{Duration, Instant};

/// Forks a child that compares a batch with its bytes, and waits for it.
///
/// # Errors
/// What the child saw, or that it hangs.
pub fn child_reads(batch: &Batch, bytes: &[u8], hang: Duration) -> Result<(), String> {
    // SAFETY: the child has this thread alone. It compares memory, takes no lock that another thread could
    // have held, and leaves by `_exit`, so nothing of its parent is dropped.
    let child = unsafe {
        match libc::fork() {
            0 => {
                libc::alarm(60); // should it hang, and its parent be killed
                libc::_exit(i32::from(batch.bytes() != bytes))
            }
            child => child,
        }
    };
    if child < 0 {
        return Err("fork failed".to_owned());
    }
    let begin = Instant::now();
    let mut status = 0;
    // SAFETY: a child of this process that was not waited for yet.
    while unsafe { libc::waitpid(child, &mut status, libc::WNOHANG) } == 0 {
        if begin.elapsed() > hang {
            // SAFETY: as above.
            unsafe { libc::kill(child, libc::SIGKILL) };
            return Err(format!("a forked child that reads a batch hangs: {hang:?}"));
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    match status {
        0 => Ok(()),
        status => Err(format!("WRONG: a forked child sees another batch, or died: {status:#x}")),
    }
}
