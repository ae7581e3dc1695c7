//! The id of this process, also in a forked child.

#![allow(unsafe_code)] // how a forked child learns that it is one

use std::sync::Once;
use std::sync::atomic::{AtomicU32, Ordering};

/// The id of this process. To ask the kernel each time would take a tenth of a lane's round trip. A child is
/// noticed if it was made by libc's `fork`, as Python's are.
#[inline]
pub(crate) fn process_id() -> u32 {
    /// 0 until the handler is registered.
    static ID: AtomicU32 = AtomicU32::new(0);
    static REGISTRATION: Once = Once::new();

    extern "C" fn in_forked_child() {
        ID.store(std::process::id(), Ordering::Relaxed);
    }

    let id = ID.load(Ordering::Relaxed);
    if id != 0 {
        return id;
    }
    REGISTRATION.call_once(|| {
        // SAFETY: the handler only asks for the process's id and stores it in an atomic, both of which are
        // allowed between a fork and the child's return from it.
        let error = unsafe { nix::libc::pthread_atfork(None, None, Some(in_forked_child)) };
        if error == 0 {
            ID.store(std::process::id(), Ordering::Relaxed);
        }
    });
    std::process::id()
}
