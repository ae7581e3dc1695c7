//! What a forked child notices at once: that it is another process, and has no pool.

#![allow(unsafe_code)] // what runs in a forked child

use nix::libc;
use std::os::fd::{AsFd, AsRawFd};
use std::sync::Once;
use std::sync::atomic::{AtomicI32, AtomicU32, Ordering};

/// Descriptors that forked children give up; -1 is a free place. Not behind a lock, which another thread
/// could hold at the fork.
static GIVEN_UP: [AtomicI32; 256] = [const { AtomicI32::new(-1) }; 256];

/// A descriptor that forked children give up: a lock is held and a socket listened at until the last copy of
/// its descriptor is closed, and a pool that was killed would seem to run for as long as a child of its
/// process does. To be dropped before the descriptor is closed.
pub(crate) struct NotInherited {
    raw: i32,
    /// `None` for more than 128 pools in one process, whose names a forked child then keeps.
    place: Option<&'static AtomicI32>,
}

impl NotInherited {
    pub(crate) fn new(descriptor: &impl AsFd) -> NotInherited {
        process_id(); // registers the handler
        let raw = descriptor.as_fd().as_raw_fd();
        let is_taken = |place: &&AtomicI32| {
            place.compare_exchange(-1, raw, Ordering::Relaxed, Ordering::Relaxed).is_ok()
        };
        NotInherited { raw, place: GIVEN_UP.iter().find(is_taken) }
    }
}

impl Drop for NotInherited {
    fn drop(&mut self) {
        if let Some(place) = self.place {
            // In a forked child the place can be that of another descriptor by now.
            let _ = place.compare_exchange(self.raw, -1, Ordering::Relaxed, Ordering::Relaxed);
        }
    }
}

/// In a forked child, replaces the descriptors. They stay open, as their owners will close them.
fn give_up_descriptors() {
    let given_up = || GIVEN_UP.iter().filter(|place| place.load(Ordering::Relaxed) >= 0);
    if given_up().next().is_none() {
        return;
    }
    // SAFETY: these calls are allowed between a fork and the child's return from it, and the descriptors are
    // open: places are free before that of theirs is closed.
    unsafe {
        let null = libc::open(c"/dev/null".as_ptr(), libc::O_RDWR | libc::O_CLOEXEC);
        if null >= 0 {
            for place in given_up() {
                libc::dup3(null, place.swap(-1, Ordering::Relaxed), libc::O_CLOEXEC);
            }
            libc::close(null);
        }
    }
}

/// The id of this process. To ask the kernel each time would take a tenth of a lane's round trip. A child is
/// noticed if it was made by libc's `fork`, as Python's are.
#[inline]
pub(crate) fn process_id() -> u32 {
    /// 0 until the handler is registered.
    static ID: AtomicU32 = AtomicU32::new(0);
    static REGISTRATION: Once = Once::new();

    extern "C" fn in_forked_child() {
        ID.store(std::process::id(), Ordering::Relaxed);
        give_up_descriptors();
    }

    let id = ID.load(Ordering::Relaxed);
    if id != 0 {
        return id;
    }
    REGISTRATION.call_once(|| {
        // SAFETY: the handler asks for the process's id, uses atomics and makes system calls, all of which is
        // allowed between a fork and the child's return from it.
        let error = unsafe { libc::pthread_atfork(None, None, Some(in_forked_child)) };
        if error == 0 {
            ID.store(std::process::id(), Ordering::Relaxed);
        }
    });
    std::process::id()
}
