//! The synchronisation primitives of the hand-off: the standard ones, or loom's when its tests explore every
//! interleaving (`RUSTFLAGS="--cfg loom" cargo test -p smaclite-pool --release leader_followers`).

#[cfg(loom)]
pub(crate) use loom::{
    sync::atomic::{AtomicBool, AtomicUsize, Ordering},
    sync::{Condvar, Mutex, MutexGuard},
    thread::yield_now,
};
#[cfg(not(loom))]
pub(crate) use std::{
    sync::atomic::{AtomicBool, AtomicUsize, Ordering},
    sync::{Condvar, Mutex, MutexGuard},
    thread::yield_now,
};

/// Locks, also after a panic of another thread: a panic inside a lane is caught and reported by the lane itself, and
/// the data under these locks stays consistent at every point where one can occur.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
}
