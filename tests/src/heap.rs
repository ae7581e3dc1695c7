//! The heap memory of a thread: how often it allocates, what it holds, and the most that it held. A test that
//! needs it makes [`Counting`] its `#[global_allocator]`.
#![expect(unsafe_code, reason = "an allocator is an unsafe trait")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static HEAP: Cell<Heap> = const { Cell::new(Heap { allocations: 0, bytes: 0, most: 0 }) };
}

/// Of one thread, since it began. Memory that another thread frees counts as held for ever.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heap {
    /// How many allocations it has made.
    pub allocations: u64,
    /// How many bytes it holds.
    pub bytes: i64,
    /// The most that it held since [`Heap::forget_most`].
    pub most: i64,
}

impl Heap {
    /// That of the calling thread.
    pub fn of_thread() -> Heap {
        HEAP.get()
    }

    /// From now on, `most` is what comes.
    pub fn forget_most() {
        let heap = HEAP.get();
        HEAP.set(Heap { most: heap.bytes, ..heap });
    }
}

/// The system's allocator, with counts.
pub struct Counting;

fn count(allocations: u64, bytes: i64) {
    let heap = HEAP.get();
    let held = heap.bytes + bytes;
    HEAP.set(Heap { allocations: heap.allocations + allocations, bytes: held, most: heap.most.max(held) });
}

// SAFETY: every call is forwarded unchanged to the system's allocator, which fulfils the contract. Counting
// touches a thread-local cell that is initialised at compile time and has no destructor, so it neither
// allocates nor unwinds.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(1, layout.size() as i64);
        // SAFETY: the caller guarantees for `layout` what the system's allocator requires.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        count(0, -(layout.size() as i64));
        // SAFETY: `memory` came from `alloc` above with this layout, and so from the system's allocator.
        unsafe { System.dealloc(memory, layout) }
    }
}
