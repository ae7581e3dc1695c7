//! Synchronisation primitives: those of the standard library and of crossbeam, or loom's where its tests
//! explore every interleaving (`just loom`).

#[cfg(not(loom))]
pub(crate) use crossbeam::queue::ArrayQueue;
#[cfg(loom)]
pub(crate) use loom::{
    hint::spin_loop,
    sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering, fence},
    sync::{Condvar, Mutex, MutexGuard},
    thread::yield_now,
};
#[cfg(not(loom))]
pub(crate) use std::{
    hint::spin_loop,
    sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering, fence},
    sync::{Condvar, Mutex, MutexGuard},
    thread::yield_now,
};

/// Locks a mutex, also a poisoned one: the lane itself catches and reports panics, and the data under these
/// locks is consistent at every point where one can occur.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
}

/// What loom explores in place of crossbeam's queue, whose atomics it cannot replace (`cfg(crossbeam_loom)`
/// is for `crossbeam-utils`; `crossbeam-queue` 0.3 does not have it). Loom does not explore therefore:
///
/// - the time within a push in which `is_empty` is false and the item cannot be taken yet. A `pop` waits for
/// its
///   end, so to the code here a push is one operation, as under the mutex;
/// - crossbeam's memory orders: a push releases to the pop of its item, and moving and reading the ends of
/// the
///   queue is sequentially consistent, which the handshakes of `parking` need of `is_empty`.
#[cfg(loom)]
pub(crate) struct ArrayQueue<T>(Mutex<std::collections::VecDeque<T>>, usize);

#[cfg(loom)]
impl<T> ArrayQueue<T> {
    pub(crate) fn new(capacity: usize) -> Self {
        ArrayQueue(Mutex::default(), capacity)
    }

    pub(crate) fn push(&self, item: T) -> Result<(), T> {
        let mut items = lock(&self.0);
        if items.len() == self.1 {
            return Err(item);
        }
        items.push_back(item);
        Ok(())
    }

    pub(crate) fn pop(&self) -> Option<T> {
        lock(&self.0).pop_front()
    }

    pub(crate) fn is_empty(&self) -> bool {
        lock(&self.0).is_empty()
    }
}
