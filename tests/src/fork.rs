//! Forked children that read a batch of their parent.

#![allow(unsafe_code)] // `fork`

use smaclite_ipc::Batch;
use std::time::{Duration, Instant};

/// Forks a child that compares a batch with its bytes, and waits for it.
///
/// # Errors
/// If the child sees other bytes, dies, or takes longer than `hang`.
pub fn child_reads(batch: &Batch, bytes: &[u8], hang: Duration) -> Result<(), String> {
    // SAFETY: the child has only this thread. It compares memory, takes no lock that another thread could
    // have held, and ends with `_exit`, so nothing of its parent is dropped.
    let child = unsafe {
        match libc::fork() {
            0 => {
                libc::alarm(60); // ends a child that hangs after its parent was killed
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
    // SAFETY: a child of this process that has not been waited for yet.
    while unsafe { libc::waitpid(child, &mut status, libc::WNOHANG) } == 0 {
        if begin.elapsed() > hang {
            // SAFETY: as above.
            unsafe { libc::kill(child, libc::SIGKILL) };
            return Err(format!("a forked child did not read a batch within {hang:?}"));
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    match status {
        0 => Ok(()),
        status => Err(format!("WRONG BATCH in a forked child, or it died: status {status:#x}")),
    }
}
